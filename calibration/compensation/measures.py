"""Temperature coefficients before and after a compensation, beside what the noise of the record alone would leave.

A coefficient is (max - min)/range over the temperatures of the test (docs/theory/rate.md, eq. 6). Its values are means
over *passes*: neighbouring blocks of at most PASS_BLOCKS and PASS_SPAN of temperature; up and down of a ramp stay
apart, so that a lag does not cancel.
"""

from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from calibration.compensation.model import Compensation
from calibration.compensation.points import Points, bias_points, scale_points
from calibration.compensation.record import Blocks, Floats
from cosim.rate.metrics import PER_HOUR
from gyro_model.errors import InputError

PASS_BLOCKS: Final = 40
"""Blocks of a pass at most."""
PASS_SPAN: Final = 1 / 40
"""Share of the temperature range that a pass covers at most: 2 °C of -20 .. 60."""
PASS_FEWEST: Final = 2
"""A pass of fewer blocks than this would make the largest value the noisiest one; kept where most are no longer."""


class Curve(NamedTuple):
    """Means over passes, shape (n,): t [s], temperature [°C, or Hz where there is none], before, after, noise: standard
    error of both. Scale factor [1] or bias [unit]."""

    t: Floats
    temperature: Floats
    before: Floats
    after: Floats
    noise: Floats

    @property
    def range(self) -> float:
        """Range of the temperatures."""
        return float(np.ptp(self.temperature))


class Change(NamedTuple):
    """A coefficient [1/°C or unit/°C] before and after; noise: what the noise alone would leave on average."""

    before: float
    after: float
    noise: float

    @property
    def factor(self) -> float:
        """By how much the coefficient fell."""
        return self.before / self.after

    @property
    def possible(self) -> float:
        """By how much it would have fallen to the noise."""
        return self.before / self.noise if self.noise > 0 else np.inf


class Result(NamedTuple):
    """A compensation on one test.

    Curves over temperature; scale is None where the test never turns; rms_before: of the bias at blocks about its mean
    [unit]; rms: of what remains of it, an offset included; floor: rms of their noise; outside: blocks clamped, of
    ``blocks``.
    """

    scale: Curve | None
    bias: Curve
    rms_before: float
    rms: float
    floor: float
    outside: int
    blocks: int


def judge(blocks: Blocks, compensation: Compensation, outside: str = "refuse") -> Result:
    """What a compensation leaves of a test. Raises InputError as ``Compensation.at`` does."""
    applied = compensation.at(blocks, outside)
    raw, divided = bias_points(blocks), bias_points(blocks, applied.scale)
    remains = divided.value - applied.bias[blocks.at_rest]
    bias = _curve(raw, raw.value, remains, divided.noise)
    found = scale_points(blocks)
    scale = None
    if len(found.value):
        left = found.value / applied.scale[np.searchsorted(blocks.t, found.blocks.t)]
        scale = _curve(found, found.value, left, found.noise)
    before, rms, floor = (
        float(np.sqrt(np.mean(values**2))) for values in (raw.value - raw.value.mean(), remains, divided.noise)
    )
    return Result(scale, bias, before, rms, floor, int(applied.outside.sum()), len(blocks))


def _curve(points: Points, before: Floats, after: Floats, noise: Floats) -> Curve:
    group = passes(points.blocks)
    size = np.bincount(group).astype(float)
    kept = size >= min(PASS_FEWEST, np.median(size))

    def mean(values: Floats) -> Floats:
        return (np.bincount(group, values) / size)[kept]

    error = np.sqrt(mean(noise**2) / size[kept])
    return Curve(mean(points.blocks.t), mean(points.blocks.temperature), mean(before), mean(after), error)


def passes(blocks: Blocks) -> NDArray[np.int64]:
    """Number of the pass of each block, shape (n,), rising from 0."""
    temperature = blocks.temperature
    span = PASS_SPAN * float(np.ptp(temperature))
    group = np.zeros(len(blocks), dtype=np.int64)
    low = high = temperature[0]
    first = 0
    for k in range(1, len(blocks)):
        low, high = min(low, temperature[k]), max(high, temperature[k])
        group[k] = group[k - 1]
        if k - first >= PASS_BLOCKS or high - low > span:
            group[k] += 1
            low = high = temperature[k]
            first = k
    return group


def change(curve: Curve) -> Change:
    """The coefficient of a curve. Raises InputError where the temperature never changes."""
    if not curve.range > 0:
        raise InputError("the temperature of the test never changes: it has no temperature coefficient")
    spans = (np.ptp(curve.before), np.ptp(curve.after), expected_range(curve.noise))
    return Change(*(float(span) / curve.range for span in spans))


def spread_over_temperature(blocks: Blocks, values: Floats) -> float:
    """(max - min)/range of means over passes of ``values`` at ``blocks``, shape (n,) [unit/°C]."""
    points = Points(blocks, values, blocks.noise)
    curve = _curve(points, values, values, blocks.noise)
    return change(curve).after


def expected_range(deviations: Floats) -> float:
    """Mean of max - min of independent normal values with these standard deviations: ∫ 1 - ΠF - Π(1 - F)."""
    widest = float(deviations.max())
    if len(deviations) < 2 or widest == 0:
        return 0.0
    x = np.linspace(-9 * widest, 9 * widest, 2001)
    with np.errstate(divide="ignore"):
        f = ndtr(x[:, None] / deviations)
    inside = 1 - np.prod(f, axis=1) - np.prod(1 - f, axis=1)
    return float(inside.sum() * (x[1] - x[0]))


def summary(result: Result, unit: str) -> dict[str, Any]:
    """As JSON-ready values: ppm/°C; bias in deg/h where the unit of the rate is rad/s, else in that."""
    factor = bias_factor(unit)
    return {
        "scale_factor_ppm_per_c": None if result.scale is None else _change(change(result.scale), 1e6),
        "bias_per_c": _change(change(result.bias), factor),
        "bias_rms": {
            "before": factor * result.rms_before,
            "after": factor * result.rms,
            "noise": factor * result.floor,
            "factor": result.rms_before / result.rms,
        },
        "residual_rms": factor * result.rms,
        "block_noise": factor * result.floor,
        "clamped_blocks": result.outside,
        "blocks": result.blocks,
    }


def bias_factor(unit: str) -> float:
    """From the unit of the rate to that in which a bias is told."""
    return PER_HOUR if unit == "rad/s" else 1.0


def _change(change: Change, factor: float) -> dict[str, float | None]:
    return {
        "before": factor * change.before,
        "after": factor * change.after,
        "noise": factor * change.noise,
        "factor": change.factor,
        "noise_allows": change.possible if np.isfinite(change.possible) else None,
    }
