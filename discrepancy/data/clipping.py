"""Flat tops: samples that stand at the channel's extreme value because the converter ended there.

A clip collects on one value what would have spread above it, so that value is far more frequent than the next below.
The crest of a sine collects too: rounded to levels, its highest has up to sqrt(1)/(sqrt(2) - 1) = 2.4 times the
samples of the next, and 3 times where the sampling is synchronous and a crest has 3 samples on it. So does a mass that
rests at the end of its way. It comes there slowing down, and would not have gone on for as long as it rests: a clipped
signal would.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from discrepancy.data.stretches import stretches

CROWDING: Final = 5.0
"""Times the next value's samples; above the 3 of a crest."""
SAMPLES: Final = 8
"""At the extreme at least: fewer come by chance where a noise is rounded to few levels."""
SAME: Final = 1e-9
"""Of the range: samples as near as this are the same; a converter of 24 bits has steps of 6e-8."""
VISITS: Final = 3
"""Separate stays at the extreme at least: one that begins and never ends is a signal that settled."""
BESIDE, FEWEST = 0.25, 3
"""Part of a stay, and samples, beside it that say whether the signal would have gone on; what is away from the extreme
for less than that part is noise."""
GONE_ON: Final = 0.2
"""Of a stay, for which a signal that is clipped would have stood beyond the limit by its speed and its slowing down
beside it: 1 with a clipped sine. Of 2,834 clipped beats under noise of up to 3 % 12 are missed, of 600 masses moved
from place to place 52 pass for clipped; with 0.1 and 0.5 it is 10 and 36, 59 and 41, without this 2 and 178."""


def flat_tops(v: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Which samples of v (n, axes) [V] are clipped, shape (n, axes): both ends of each channel apart."""
    clipped = np.zeros(v.shape, dtype=np.bool_)
    for axis in range(v.shape[1]):
        for sign in (1.0, -1.0):
            clipped[:, axis] |= _at_top(sign * v[:, axis])
    return clipped


def _at_top(v: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Clipped samples at the upper end of one channel (n,)."""
    # A clipped and then rounded sample is the same number every time, but for the rounding of a scale.
    same = SAME * np.ptp(v)
    at_top = v >= v.max() - same
    below = v[~at_top]
    crowd = np.count_nonzero(at_top)
    visits = np.count_nonzero(np.diff(at_top.astype(np.int8), prepend=0) == 1)
    if crowd < SAMPLES or visits < VISITS or below.size == 0:
        return np.zeros_like(at_top)
    beside = np.count_nonzero(below >= below.max() - same)
    if crowd <= CROWDING * beside or not _goes_on(v, at_top):
        return np.zeros_like(at_top)
    return at_top


def _goes_on(v: NDArray[np.float64], at_top: NDArray[np.bool_]) -> bool:
    """Whether v (n,) comes to its extreme and leaves it as what goes on beyond."""
    below, stays, last = v.max() - v, _stays(at_top), len(v)
    return _over(below, stays) and _over(below[::-1], [(last - end, last - begin) for begin, end in stays])


def _over(below: NDArray[np.float64], stays: list[tuple[int, int]]) -> bool:
    """Whether a signal so far ``below`` its extreme (n,) comes to its stays there as what goes on beyond."""
    terms, values = [], []
    for begin, end in stays:
        came = below[max(begin - max(round(BESIDE * (end - begin)), FEWEST), 0) : begin][::-1]
        # The extreme was met half a sample before the stay, in the mean.
        u = np.arange(len(came)) + 0.5
        terms.append(np.stack([u * (end - begin), u**2], axis=1))
        values.append(came)
    # A parabola that leaves the limit where a stay ends has one factor for both terms.
    speed, slowing = np.linalg.lstsq(np.concatenate(terms), np.concatenate(values), rcond=None)[0]
    return bool(speed > GONE_ON * max(slowing, 0.0))


def _stays(at_top: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Where the signal comes to its extreme, and where it has left: what noise takes away from a stay for a moment is
    part of it."""
    stays: list[tuple[int, int]] = []
    for begin, end in stretches(at_top):
        if stays and begin - stays[-1][1] < BESIDE * max(end - begin, stays[-1][1] - stays[-1][0]):
            begin = stays.pop()[0]
        stays.append((begin, end))
    return stays
