"""What a compensation is fitted to and judged by: scale factors and biases that the blocks of a test show."""

from functools import lru_cache
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from calibration.compensation.record import Blocks, Floats
from gyro_model.errors import InputError

NEAR: Final = 3.0
"""The bias at a turning block comes from rest blocks within this many times the usual distance either side."""
FEWEST_RESTS: Final = 4
"""Stretches at rest that a cubic between them needs."""
SMALLEST_RATE: Final = 1e-12
"""A rate of turn below this is none."""


class Points(NamedTuple):
    """Values at blocks, shape (n,): blocks holds their inputs; value: scale factor [1] or bias [unit of the rate];
    noise: standard error of each."""

    blocks: Blocks
    value: Floats
    noise: Floats

    def part(self, chosen: NDArray[np.bool_]) -> "Points":
        """The points chosen, shape (n,)."""
        return Points(self.blocks.part(chosen), self.value[chosen], self.noise[chosen])


@lru_cache(maxsize=16)
def scale_points(blocks: Blocks) -> Points:
    """The scale factor at each turning block, less the bias of the rest blocks before and after it: a bias that drifts
    drops out. Empty for a test at rest. Raises InputError where a test turns and never rests."""
    turning = ~blocks.at_rest & (np.abs(blocks.rate_true) > SMALLEST_RATE)
    if not turning.any():
        return Points(blocks.part(turning), np.zeros(0), np.zeros(0))
    rest_t, rest_rate = _rests(blocks)
    if len(rest_t) < FEWEST_RESTS:
        raise InputError(
            f"{blocks.name}: {len(rest_t)} stretches at rest (rate_true = 0): bias and scale factor need "
            f"{FEWEST_RESTS}; let the rate step between rest and turning, as gyrotwin rate --rate-step does"
        )
    bias = np.full(len(blocks), np.nan)
    usual = NEAR * float(np.median(np.diff(rest_t)))
    # A gap, or the next record, ends a run.
    ends = np.flatnonzero(np.diff(rest_t) > usual) + 1
    for t, rate in zip(np.split(rest_t, ends), np.split(rest_rate, ends), strict=True):
        if len(t) >= FEWEST_RESTS:
            within = turning & (blocks.t > t[0]) & (blocks.t < t[-1])
            bias[within] = CubicSpline(t, rate)(blocks.t[within])
    inside = np.isfinite(bias)
    chosen = blocks.part(inside)
    value = (chosen.rate - bias[inside]) / chosen.rate_true
    # Halfway between evenly spaced rests a cubic has weights of about 9, 9, -1, -1 sixteenths: 0.64 of their variance.
    return Points(chosen, value, np.sqrt(1.64) * chosen.noise / np.abs(chosen.rate_true))


def _rests(blocks: Blocks) -> tuple[Floats, Floats]:
    """Time [s] and rate of the stretches at rest, shape (n,): means over neighbouring rest blocks, at most as many as
    usually turn in a row, so that a cubic between them does not follow the noise within."""
    rest = blocks.at_rest
    apart = np.diff(blocks.t)
    edges = np.flatnonzero(np.diff(rest) | (apart > NEAR * np.median(apart))) + 1
    run = np.split(np.arange(len(blocks)), edges)
    lengths = [len(part) for part in run if not rest[part[0]]]
    most = max(int(np.median(lengths)), 1)
    parts = [piece for part in run if rest[part[0]] for piece in np.array_split(part, -(-len(part) // most))]
    return np.array([blocks.t[p].mean() for p in parts]), np.array([blocks.rate[p].mean() for p in parts])


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
