"""Whether a signal stays at the end of a range."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

STUCK: Final = 0.01
"""Share of the samples at the very end of the range from which on it is one: noise touches its largest value once."""
STUCK_OVER: Final = 10
"""Where the end is no end, the next value comes as often; a slow signal that turns there spends some samples more."""


def is_clipped(values: Floats) -> bool:
    """Whether ``values``, shape (n,), stays at its largest or smallest value."""
    return _sticks_to_its_top(values) or _sticks_to_its_top(-values)


def _sticks_to_its_top(values: Floats) -> bool:
    below = values[values < values.max()]
    at = len(values) - len(below)
    # Of two values alone neither is an end.
    if at < STUCK * len(values) or not len(below) or below.min() == below.max():
        return False
    return at > STUCK_OVER * int(np.count_nonzero(below == below.max()))
