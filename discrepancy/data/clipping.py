"""Flat tops: samples that stand at the channel's extreme value because the converter ended there.

A clip collects on one value what would have spread above it, so that value is far more frequent than the next below.
The crest of a sine collects too: rounded to levels, its highest has up to sqrt(1)/(sqrt(2) - 1) = 2.4 times the
samples of the next, and 3 times where the sampling is synchronous and a crest has 3 samples on it.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

CROWDING: Final = 5.0
"""Times the next value's samples; above the 3 of a crest."""
SAMPLES: Final = 8
"""At the extreme at least: fewer come by chance where a noise is rounded to few levels."""
SAME: Final = 1e-9
"""Of the range: samples as near as this are the same; a converter of 24 bits has steps of 6e-8."""
VISITS: Final = 3
"""Separate stays at the extreme at least: one that begins and never ends is a signal that settled."""


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
    return at_top if crowd > CROWDING * beside else np.zeros_like(at_top)
