"""What would mislead without a word in the rows of a temperature test: told, and units that can't be are refused."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from calibration.analysis.clipping import is_clipped
from gyro_model.errors import InputError

Floats = NDArray[np.float64]

REPEATED: Final = 0.3
"""Share of neighbouring rows that are equal from which on they are looked at: noise of one step rms repeats in 28 %."""
BLURRED: Final = 0.58
"""Of a step: noise of half a step leaves 0.2 % of one in a mean, and the two together are √(1/4 + 1/12) of one."""
HELD: Final = 0.6
"""Share of equal neighbours that noise which blurs the steps does not make: half a step rms repeats in half."""
WILD: Final = 25.0
"""Variance of a block over that of the median block: of white noise in 8 rows 1e-20 of the blocks have more, in 4 rows
1e-5."""
WILD_SHARE: Final = 0.01
"""Share of such blocks that is told."""
APART: Final = 5.0
"""The rate over the true one may be this, or one over it: beyond that the units differ (57.3 of deg/s over rad/s)."""
DEGREES: Final = 0.2
"""How far a ratio of degrees to radians may be off, relative: the scale factor is not 1."""


def rounding_step(rate: Floats, variance: float) -> float:
    """The step in which ``rate``, shape (n,), is rounded [its unit], where the noise of rows with this ``variance``,
    rounding included, does not blur it; else 0."""
    if not np.mean(np.diff(rate) == 0) > REPEATED:
        return 0.0
    levels = np.unique(rate)
    step = float(np.diff(levels).min()) if len(levels) > 1 else 0.0
    return step if variance**0.5 < BLURRED * step else 0.0


def doubts(rate: Floats, variance: Floats, step: float, unit: str) -> tuple[str, ...]:
    """What to know of the rows of ``rate``, shape (n,), of their ``variance`` within each block, shape (b,), nan where
    a block has too few, and of the ``step`` [unit] in which they are rounded."""
    if step > 0.0:
        return (
            f"the rate is rounded in steps of {step:.3g} {unit}, wider than its noise: no mean is surer than a step",
        )
    if is_clipped(rate):
        return ("the rate stays at the end of its range: it is clipped, and what lies beyond is not in the fit",)
    told = []
    repeated = float(np.mean(np.diff(rate) == 0))
    if repeated > HELD:
        told.append(
            f"{100 * repeated:.0f} % of the rows equal the one before, written more often than the rate is measured: "
            "its noise is more than it seems"
        )
    known = variance[np.isfinite(variance)]
    usual = float(np.median(known)) if len(known) else 0.0
    share = float(np.mean(known > WILD * usual)) if usual > 0 else 0.0
    if share > WILD_SHARE:
        told.append(
            f"in {100 * share:.0f} % of the blocks the rate scatters more than {WILD**0.5:g} times as much as in the "
            "others: spikes, steps of rate_true at another time than the rate's, or a --settling that is too short"
        )
    return tuple(told)


def check_units(name: str, rate: Floats, true: Floats) -> tuple[str, ...]:
    """What to know of ``rate`` over the ``true`` one, shape (n,) each: that it runs the other way.

    Raises InputError where the ratio of the two can only be that of two units.
    """
    swing = true - true.mean()
    power = float(swing @ swing)
    if power == 0.0:
        return ()
    slope = float(swing @ rate) / power
    ratio = abs(slope)
    if 1 / APART <= ratio <= APART:
        return ("the rate runs against rate_true: its sign is turned",) if slope < 0 else ()
    degrees = any(abs(ratio / factor - 1) < DEGREES for factor in (np.degrees(1.0), np.radians(1.0)))
    guess = "is one in deg/s and the other in rad/s? " if degrees else ""
    raise InputError(
        f"{name}: rate is {ratio:.4g} times rate_true: {guess}Name both units in the headings, or give --scale "
        "rate=UNIT, --scale rate_true=UNIT, or a factor such as --scale rate=0.001 for counts"
    )
