"""A population from individual estimates of unlike accuracy: the normal hierarchical model with columns to explain it.

y_i ~ N(theta_i, s_i²), theta_i ~ N(z_i b, tau²): tau by restricted maximum likelihood, b by weighted least squares with
the interval of Hartung and Knapp (docs/theory/records.md, eq. 4 to 6). Individuals that do not belong to it are left
out of the estimate, and said.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq, minimize_scalar
from scipy.stats import chi2, norm, t

from discrepancy.data.record import Floats

Flags = NDArray[np.bool_]

LEAST: Final = 4
"""Individuals beyond the columns, from which on anything is said of a population."""
FAR: Final = 4.0
"""Robust deviations from which on an individual is left out of the first estimate; each is then tested again."""
ROUNDS: Final = 20
WIDTH: Final = float(norm.ppf(0.975))
SPREADS: Final = np.concatenate([[0.0], np.geomspace(1e-6, 30.0, 200)])
"""Of the raw scatter: where the likelihood of the spread is looked at before its maximum is refined."""


@dataclass(frozen=True)
class Range:
    """A number with its 95 % interval."""

    value: float
    low: float
    high: float


@dataclass(frozen=True)
class Population:
    """mean: where all columns are at their mean; spread: standard deviation of the true values about the mean and the
    slopes; slopes: by column, per its unit; individuals: each as estimated with what the others say; distances: of each
    from what the others let expect, in standard deviations; outliers: numbers of those that do not belong."""

    mean: Range
    spread: Range
    slopes: tuple[Range, ...]
    individuals: tuple[Range, ...]
    expected: tuple[float, ...]
    distances: tuple[float, ...]
    outliers: tuple[int, ...]


def population(values: Floats, deviations: Floats, columns: Floats, chance: float) -> Population | None:
    """The population of ``values`` (n,), each with its standard deviation, over ``columns`` (n, k).

    chance: of an individual that belongs to be called an outlier. None where there are fewer than LEAST beyond the
    columns, or where the columns of these do not tell one slope from another.
    """
    n, k = columns.shape
    if n < k + 1 + LEAST or not independent(columns):
        return None
    scale = float(np.ptp(values)) or float(np.max(deviations)) or 1.0
    y, s = (values - np.median(values)) / scale, deviations / scale
    size = np.ptp(columns, axis=0)
    design = np.column_stack([np.ones(n), (columns - columns.mean(axis=0)) / size])
    kept = _central(y, s, design)
    seen: list[bytes] = []
    while True:
        fit = _Fit(y[kept], s[kept], design[kept])
        distance = fit.distances(y, s, design, kept)
        now = 2 * t.sf(np.abs(distance), kept.sum() - k - 1) >= chance
        if np.array_equal(now, kept) or now.tobytes() in seen or now.sum() < k + 1 + LEAST or len(seen) == ROUNDS:
            break
        seen.append(kept.tobytes())
        kept = now
    inside = [_range(own, scale, float(np.median(values))) for own in fit.shrunk(y, s, design)]
    alone = [
        Range(float(v), float(v - WIDTH * d), float(v + WIDTH * d)) for v, d in zip(values, deviations, strict=True)
    ]
    coefficients = fit.coefficients()
    return Population(
        mean=_range(coefficients[0], scale, float(np.median(values))),
        spread=_range(fit.spread_range(), scale),
        slopes=tuple(_range(own, scale / float(unit)) for own, unit in zip(coefficients[1:], size, strict=True)),
        individuals=tuple(inside[i] if kept[i] else alone[i] for i in range(n)),
        expected=tuple(float(v) for v in design @ fit.b * scale + np.median(values)),
        distances=tuple(map(float, distance)),
        outliers=tuple(int(i) for i in np.flatnonzero(~kept)),
    )


def independent(columns: Floats) -> bool:
    """Whether each column (n, k) has a slope of its own beside the others and a mean."""
    centred = columns - columns.mean(axis=0)
    size = np.abs(centred).max(axis=0, initial=0.0)
    return bool(np.linalg.matrix_rank(centred / np.where(size > 0, size, 1.0), tol=1e-6) == columns.shape[1])


def _range(of: tuple[float, float, float], scale: float, offset: float = 0.0) -> Range:
    return Range(*(float(v * scale + offset) for v in of))


def _central(y: Floats, s: Floats, design: Floats) -> Flags:
    """Those within FAR robust deviations of the line of least absolute residuals, at least half of all."""
    b = np.linalg.lstsq(design, y, rcond=None)[0]
    for _ in range(50):
        weight = 1 / np.sqrt(np.maximum(np.abs(y - design @ b), 1e-9))
        b = np.linalg.lstsq(design * weight[:, None], y * weight, rcond=None)[0]
    off = np.abs(y - design @ b)
    # 1.4826: the median of absolute residuals of a normal distribution to its standard deviation.
    robust = off / np.sqrt(np.maximum((1.4826 * np.median(off)) ** 2, 1e-24) + s**2)
    least = max(len(y) // 2 + 1, design.shape[1] + LEAST)
    return np.asarray(robust <= max(FAR, float(np.sort(robust)[least - 1])))


class _Fit:
    """The model fitted to scaled values ``y`` with deviations ``s`` over the columns ``z``, the first of ones."""

    def __init__(self, y: Floats, s: Floats, z: Floats) -> None:
        self.y, self.s, self.z = y, s, z
        self.raw = float(np.std(y - z @ np.linalg.lstsq(z, y, rcond=None)[0])) or 1e-12
        self.grid = SPREADS * self.raw
        self.spread = self._likeliest()
        self._solve()

    def _solve(self) -> None:
        weight = 1 / self._variance(self.spread)
        self.inverse = np.linalg.inv(self.z.T * weight @ self.z)
        self.b = self.inverse @ (self.z.T @ (weight * self.y))
        self.freedom = len(self.y) - self.z.shape[1]
        rest = float(np.sum(weight * (self.y - self.z @ self.b) ** 2)) / self.freedom
        self.covariance = self.inverse * max(rest, 1.0)

    def _variance(self, spread: float) -> Floats:
        # A value known exactly, in a population without a spread, would have an infinite weight.
        return np.asarray(spread**2 + np.maximum(self.s, 1e-9 * self.raw) ** 2)

    def _deviance(self, spread: float) -> float:
        """-2 log of the restricted likelihood."""
        variance = self._variance(spread)
        gram = self.z.T / variance @ self.z
        b = np.linalg.solve(gram, self.z.T @ (self.y / variance))
        rest = float(np.sum((self.y - self.z @ b) ** 2 / variance))
        return float(np.sum(np.log(variance)) + np.linalg.slogdet(gram)[1] + rest)

    def _likeliest(self) -> float:
        deviances = [self._deviance(spread) for spread in self.grid]
        best = int(np.argmin(deviances))
        if best == 0:
            return 0.0
        around = self.grid[best - 1], self.grid[min(best + 1, len(self.grid) - 1)]
        return float(minimize_scalar(self._deviance, bounds=around, method="bounded", options={"xatol": 1e-9}).x)

    def spread_range(self) -> tuple[float, float, float]:
        """The spread with its interval by the profile of the likelihood."""
        limit = self._deviance(self.spread) + float(chi2.ppf(0.95, 1))

        def beyond(spread: float) -> float:
            return self._deviance(spread) - limit

        low = 0.0 if beyond(0.0) <= 0 else _crossing(beyond, 0.0, self.spread)
        top = float(self.grid[-1])
        high = top if beyond(top) <= 0 else _crossing(beyond, self.spread, top)
        return self.spread, low, high

    def coefficients(self) -> list[tuple[float, float, float]]:
        """Of each column, with its interval."""
        reach = float(t.ppf(0.975, self.freedom)) * np.sqrt(np.diag(self.covariance))
        return [(float(b), float(b - r), float(b + r)) for b, r in zip(self.b, reach, strict=True)]

    def distances(self, y: Floats, s: Floats, z: Floats, kept: Flags) -> Floats:
        """Of all individuals from what the others let expect: one in the fit has drawn the fit to itself."""
        leverage = np.einsum("ij,jk,ik->i", z, self.inverse, z)
        variance = self.spread**2 + np.maximum(s, 1e-9 * self.raw) ** 2
        own = np.where(kept, np.maximum(variance - leverage, 1e-6 * variance), variance + leverage)
        return np.asarray((y - z @ self.b) / np.sqrt(own))

    def shrunk(self, y: Floats, s: Floats, z: Floats) -> list[tuple[float, float, float]]:
        """Each individual between its own estimate and what the population lets expect, by their variances."""
        own, wide = np.maximum(s, 1e-9 * self.raw) ** 2, self.spread**2
        share = wide / (wide + own)
        expected = z @ self.b
        value = share * y + (1 - share) * expected
        known = np.einsum("ij,jk,ik->i", z, self.covariance, z)
        reach = WIDTH * np.sqrt(share * own + (1 - share) ** 2 * known)
        return [(float(v), float(v - r), float(v + r)) for v, r in zip(value, reach, strict=True)]


def _crossing(of: Callable[[float], float], low: float, high: float) -> float:
    return float(brentq(of, low, high, xtol=1e-9))
