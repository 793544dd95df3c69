"""What a compensation is fitted to and judged by: scale factors and biases that the blocks of a test show."""

from typing import Final, NamedTuple

import numpy as np

from cosim.compensation.record import Blocks, Floats
from gyro_model.errors import InputError

NEAR: Final = 3.0
"""The bias at a turning block comes from rest blocks within this many times the usual distance either side."""
SMALLEST_RATE: Final = 1e-12
"""A rate of turn below this is none."""


class Points(NamedTuple):
    """Values at blocks, shape (n,): blocks holds their inputs; value: scale factor [1] or bias [unit of the rate];
    noise: standard error of each."""

    blocks: Blocks
    value: Floats
    noise: Floats

    def part(self, chosen: np.ndarray) -> "Points":
        """The points chosen, shape (n,)."""
        return Points(self.blocks.part(chosen), self.value[chosen], self.noise[chosen])


def scale_points(blocks: Blocks) -> Points:
    """The scale factor at each turning block, less the bias of the rest blocks before and after it: a bias that drifts
    evenly drops out. Empty for a test at rest. Raises InputError where a test turns and never rests."""
    turning = ~blocks.at_rest & (np.abs(blocks.rate_true) > SMALLEST_RATE)
    rest_t = blocks.t[blocks.at_rest]
    if turning.any() and len(rest_t) < 2:
        raise InputError(
            f"{blocks.name}: {len(rest_t)} blocks at rest (rate_true = 0): bias and scale factor need two; "
            "let the rate step between rest and turning, as gyrotwin rate --rate-step does"
        )
    if not turning.any():
        return Points(blocks.part(turning), np.zeros(0), np.zeros(0))
    after = np.searchsorted(rest_t, blocks.t)
    usual = NEAR * float(np.median(np.diff(rest_t)))
    inside = turning & (after > 0) & (after < len(rest_t))
    inside[inside] = rest_t[after[inside]] - rest_t[after[inside] - 1] <= usual
    chosen = blocks.part(inside)
    bias = np.interp(chosen.t, rest_t, blocks.rate[blocks.at_rest])
    value = (chosen.rate - bias) / chosen.rate_true
    # A mean of two rest blocks adds half of their variance.
    return Points(chosen, value, np.sqrt(1.5) * chosen.noise / np.abs(chosen.rate_true))


def bias_points(blocks: Blocks, scale: Floats | None = None) -> Points:
    """The bias at each block at rest, after division by ``scale``, shape of ``blocks`` (n,), or undivided.

    Raises InputError where no block is at rest.
    """
    rest = blocks.at_rest
    if not rest.any():
        raise InputError(f"{blocks.name}: no block at rest (rate_true = 0): the bias can't be told from the rate")
    chosen = blocks.part(rest)
    divisor = np.ones(len(chosen)) if scale is None else scale[rest]
    return Points(chosen, chosen.rate / divisor, chosen.noise / divisor)
