"""Displacements seen as speeds: where a mass goes far that nothing holds, its way hides what answers quickly."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from discrepancy.data.record import Record


def are_displacements(records: Sequence[Record]) -> bool:
    """Whether that is what the sensors sense."""
    return all(record.order == 0 for record in records)


def as_speeds(records: Sequence[Record]) -> list[Record]:
    """Records of displacements as those of their speeds [V/s], by central differences. These show a frequency f smaller
    by sin(a)/a, a = 2 pi f over the sample rate, by which any answer of a mode there is smaller alike."""
    return [
        replace(record, senses="velocity", reference=1.0, v=np.gradient(record.v, axis=0) * record.sample_rate)
        for record in records
    ]
