"""Values at one temperature that is reached again and again from either side, and what the side makes of them.

A value whose temperature comes in with the time constant τ is, some τ after the ambient has arrived, a series in
e^{-t/τ}: v(t) = v_0 + v_1 e^{-t/τ} + v_2 e^{-2t/τ}. v_0 is the value there, whatever curve v is of the temperature.
"""

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm, t

from calibration.analysis.regression import least_squares

Floats = NDArray[np.float64]

POWERS: Final = 2
"""Of e^{-t/τ}: three time constants after 60 K the cube is 0.1 K of a curve's third order."""


class Side(NamedTuple):
    """What is left of the side that the temperature came from: value after warming less that after cooling, and its
    standard error, in the unit of the values."""

    difference: float
    error: float


def settled_value(since: Floats, values: Floats, lag: float) -> tuple[float, float]:
    """v_0 and its standard error of ``values`` at times ``since`` [s] the ambient temperature arrived, shapes (n,)."""
    found = least_squares(np.exp(-np.outer(since / lag, np.arange(POWERS + 1))), values)
    return float(found.values[0]), float(found.errors[0])


def side(settled: Sequence[float] | Floats, errors: Sequence[float] | Floats) -> Side:
    """Of values ``settled`` after cooling and after warming in turns, with their standard errors, shapes (n,), n ≥ 4.

    A mean and a straight drift are taken out. The error is by the scatter of what is left, which has what wanders from
    one to the next, but is never less than the values' own; by Student's quantile it covers as much of so few values as
    a standard error of many.
    """
    count = len(settled)
    turns = np.where(np.arange(count) % 2, 0.5, -0.5)
    design = np.stack([turns, np.ones(count), np.arange(count) - (count - 1) / 2], axis=1)
    fit = least_squares(design, np.asarray(settled, dtype=float))
    own = float(np.sqrt(np.mean(np.square(errors))) * np.sqrt(np.linalg.inv(design.T @ design)[0, 0]))
    few = float(t.ppf(norm.cdf(1.0), count - design.shape[1]))
    return Side(float(fit.values[0]), max(few * float(fit.errors[0]), own))
