"""Equivalent degrees of freedom of an overlapping Allan variance.

Greenhall and Riley, "Uncertainty of stability variances based on finite differences", Proceedings of the 35th PTTI
Meeting, 2003: the combined algorithm for the unmodified variance with second differences. Equation numbers below are
theirs.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

DIFFERENCES: Final = 2
"""Order of the differences: two make it an Allan variance."""
SECOND: Final = np.array([1.0, -4.0, 6.0, -4.0, 1.0])
"""Weights of the fourth central difference, which two second differences make of a covariance."""
LONGEST_SUM: Final = 100
"""Terms of the sum at most; where more would be needed, the paper's table 2 or a coarser stride serves."""
TABLE_2: Final = {0: (2 / 3, 1 / 3), -1: (0.852, 0.375), -2: (1.079, 0.368)}
"""a0 and a1 of table 2 for second differences, by exponent of the noise."""


def degrees_of_freedom(exponent: int, averaged: int, rows: int) -> float:
    """Of the overlapping Allan variance over ``averaged`` intervals, from ``rows`` samples of the phase.

    exponent: of frequency in the density of the rate: 0 white, -1 flicker, -2 random walk. Raises ValueError for
    another, and where the record holds no second difference.
    """
    if exponent not in TABLE_2:
        raise ValueError(f"exponent {exponent}: give {', '.join(map(str, TABLE_2))}")
    estimates = 1 + rows - (1 + DIFFERENCES * averaged)
    if not averaged > 0 or estimates < 1:
        raise ValueError(f"averaged = {averaged}: {rows} samples hold no second difference over so many")
    terms = min(estimates, (DIFFERENCES + 1) * averaged)
    ratio = estimates / averaged
    if terms <= LONGEST_SUM:
        # Beyond some hundred samples the averaging filter is as good as continuous.
        filtered = averaged if averaged * (DIFFERENCES + 1) <= LONGEST_SUM else None
        return 1 / _sum(terms, estimates, averaged, filtered, exponent)
    if ratio > DIFFERENCES + 1:
        first, second = TABLE_2[exponent]
        return ratio / (first - second / ratio)
    return 1 / _sum(LONGEST_SUM, LONGEST_SUM, LONGEST_SUM / ratio, None, exponent)


def _sum(terms: int, estimates: int, stride: float, filtered: int | None, exponent: int) -> float:
    """Equation 13: the squared correlations of all pairs of estimates, over their number."""
    covariance = _covariance(np.arange(terms + 1) / stride, filtered, exponent)
    weights = 2 * (1 - np.arange(terms + 1) / estimates)
    weights[0], weights[-1] = 1.0, 1 - terms / estimates
    return float(weights @ (covariance / covariance[0]) ** 2) / estimates


def _covariance(lag: Floats, filtered: int | None, exponent: int) -> Floats:
    """Equation 9: of two estimates ``lag`` averaging times apart, up to a factor, shape of ``lag``."""
    shifts = np.arange(-DIFFERENCES, DIFFERENCES + 1)
    return _averaged(lag[:, None] + shifts, filtered, exponent) @ SECOND


def _averaged(lag: Floats, filtered: int | None, exponent: int) -> Floats:
    """Equation 8: generalised autocovariance after the averaging filter of ``filtered`` samples; None: continuous."""
    if filtered is None:
        return _phase(lag, exponent + 2)
    step = 1 / filtered
    middle, below, above = (_phase(lag + shift, exponent) for shift in (0.0, -step, step))
    return filtered**2 * (2 * middle - below - above)


def _phase(lag: Floats, exponent: int) -> Floats:
    """Equation 7: generalised autocovariance of power-law phase noise, up to a factor of its own."""
    power = np.abs(lag) ** (3 - exponent)
    if exponent % 2:
        power = lag ** (3 - exponent) * np.log(np.where(lag == 0, 1.0, np.abs(lag)))
    # The sign of each power alternates; equation 7 with exponent 2 is -|t|.
    return -power if exponent == 2 else power
