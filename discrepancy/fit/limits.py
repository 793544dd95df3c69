"""The clip's own test: the level at which a converter ends, from samples that stand at it."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from scipy.stats import chi2

from discrepancy.data.algebra import median_deviation
from discrepancy.data.clipping import flat_tops
from discrepancy.data.record import Floats, Record

SAME: Final = 1e-9
"""Relative: samples as near as this to the level stand at it."""
REPEATED: Final = 3
"""So many samples of one value at the top are no chance where no other value comes twice."""


def clip_level(
    records: Sequence[Record], residuals: Sequence[Floats], chance: float, held_out: Sequence[Record] = ()
) -> float | None:
    """The level [V] at which samples are clipped, None where none are.

    Flat tops say it, those of ``held_out`` runs too, since no fit is asked for them; so do equal values at the top
    where no other comes twice; and so does a top that falls short of the simulation (residuals v - v_sim, (n, axes)
    each) by more than any other sample is off. chance: the probability at which what it cut off is none.
    """
    flat = np.concatenate([np.abs(r.v[flat_tops(r.v)]) for r in (*records, *held_out)])
    if flat.size:
        return float(np.median(flat))
    v = np.concatenate([r.v.ravel() for r in records])
    size = np.abs(v)
    level = float(size.max())
    top = size >= level * (1 - SAME)
    if np.count_nonzero(top) >= REPEATED and len(np.unique(size[~top])) == np.count_nonzero(~top):
        return level
    off = np.concatenate([e.ravel() for e in residuals])
    missing = -off[top] * np.sign(v[top])
    rest = np.abs(off[~top & np.concatenate([np.repeat(r.valid, r.axes) for r in records])])
    deviation = max(float(median_deviation(rest)), 1e-300)
    cut_off = float(np.sum((np.maximum(missing, 0.0) / deviation) ** 2))
    sure = missing.max() > rest.max() and cut_off > chi2.isf(chance, len(missing))
    return level if sure else None


def masked(record: Record, level: float) -> Record:
    """``record`` without the samples that stand at ``level`` [V]."""
    return replace(record, valid=record.valid & (np.abs(record.v) < level * (1 - SAME)).all(axis=1))
