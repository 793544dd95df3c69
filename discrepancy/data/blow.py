"""A force that is blows, as of a hammer: between them its record is nothing but the noise of its own channel, which
drives no device. The force window of modal testing (D. J. Ewins, Modal Testing, 2000) takes it out."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from scipy.ndimage import binary_dilation

from discrepancy.data.record import Floats, Record
from discrepancy.data.stretches import stretches

BEYOND, PEAK = 8.0, 50.0
"""Deviations of the noise, from which a force is no noise, and that a blow reaches: judgements. Of 60,000 samples of
white noise none is 8 off."""
SHORT: Final = 0.2
"""Of a run, that blows take at most: a judgement. A tone is loud for most of a run."""
AROUND: Final = 0.25
"""Of a blow's length, before and after what stands out of the noise: a half sine of PEAK is below BEYOND for a
twentieth of its length at each end, and one that dies away for longer."""
LEAST: Final = 4
"""Samples of that, at least."""
WHITE: Final = 0.1
"""Correlation of neighbours up to which a noise is white: a judgement. 400 samples know it to 0.05, and a tone of
thirty samples a period has 0.98."""
OF_MEDIAN: Final = 1.4826
"""Deviation of a normal distribution over the median of what is off."""


def windowed(records: Sequence[Record]) -> tuple[tuple[Record, ...], list[str]]:
    """The records, forces that are blows without the noise of their channel between these, and notes that say so."""
    found, said = [], []
    for record in records:
        columns = [_blows(u) for u in record.u.T]
        for axis, (_, noise) in zip("xy", columns, strict=False):
            if noise:
                between = f"between them the noise of its channel, {noise:.3g} N rms, is taken out"
                said.append(f"{record.name}: u_{axis} is blows; {between}")
        struck = any(noise for _, noise in columns)
        found.append(replace(record, u=np.column_stack([u for u, _ in columns])) if struck else record)
    return tuple(found), said


def _blows(u: Floats) -> tuple[Floats, float]:
    """A force (n,) that is the same between blows, and the noise that was there; as it was, and 0, if it is none."""
    level = float(np.median(u))
    off = np.abs(u - level)
    noise = OF_MEDIAN * float(np.median(off))
    if not 0 < PEAK * noise < off.max():
        return u, 0.0
    loud = off > BEYOND * noise
    # What crosses zero within a blow is a part of it.
    loud = binary_dilation(loud, iterations=LEAST)
    for begin, end in stretches(loud):
        around = int(AROUND * (end - begin))
        loud[max(begin - around, 0) : end + around] = True
    quiet = np.where(loud, 0.0, u - level)
    alike = float(quiet[1:] @ quiet[:-1]) / float(quiet @ quiet)
    if loud.mean() > SHORT or abs(alike) > WHITE:
        return u, 0.0
    return np.where(loud, u, level), float(np.std(quiet[~loud]))
