"""A bias that wanders: a random walk beside the white noise of the blocks, an offset of its own in every cycle.

Least squares that takes both for white books the walk on whatever input moves as slowly. Here the values of a cycle are
taken as differences, of which the offset drops out, and these are made white: their covariance has two diagonals
(docs/theory/compensation.md, eq. 4),

    <(d_k)²> = σ_k² + σ_{k+1}² + q (t_{k+1} - t_k),  <d_k d_{k+1}> = -σ_{k+1}²

with the walk q (A. C. Aitken, On least squares and linear combination of observations, 1935: generalised least
squares).
"""

from typing import Final

import numpy as np
from scipy.linalg import cholesky_banded, solve_banded

from calibration.compensation.points import Points
from calibration.compensation.record import Floats

WALKED: Final = 300.0
"""Over this time a walk is read off [s]: it has risen above the noise of two blocks, and a slow lag takes little of
it."""
LEVEL: Final = 1e-8
"""Ridge of that regression: many of its columns move together."""
SMALLEST: Final = 1e-9
"""Standard error at least, of the values' range: rounding."""


def whitened(points: Points, walk: float, columns: Floats) -> Floats:
    """Differences of ``columns``, shape (n, k), within each cycle, made white and of unit size where their noise is
    that of the points and a walk of ``walk`` [unit²/s]: shape (n - cycles, k)."""
    found = [np.zeros((0, columns.shape[1]))]
    if not len(points.value):
        return found[0]
    least = (SMALLEST * max(float(np.ptp(points.value)), SMALLEST)) ** 2
    for number in np.unique(points.blocks.cycle):
        chosen = points.blocks.cycle == number
        if chosen.sum() < 2:
            continue
        noise = np.maximum(points.noise[chosen] ** 2, least)
        covariance = np.zeros((2, len(noise) - 1))
        covariance[0] = noise[1:] + noise[:-1] + walk * np.diff(points.blocks.t[chosen])
        covariance[1, :-1] = -noise[1:-1]
        root = cholesky_banded(covariance, lower=True)
        found.append(solve_banded((1, 0), root, np.diff(columns[chosen], axis=0)))
    return np.concatenate(found)


def walk_of(points: Points, columns: Floats) -> float:
    """Variance by which the values wander in a second [unit²/s]: what ``columns``, shape (n, k), leave of their
    differences over WALKED, less the noise; 0 where the record is too short to tell."""
    t, cycle = points.blocks.t, points.blocks.cycle
    lag = max(round(WALKED / float(np.median(np.diff(t)))), 1) if len(t) > 1 else 1
    same = cycle[lag:] == cycle[:-lag]
    if same.sum() < 2 * columns.shape[1]:
        return 0.0
    moved, values = (columns[lag:] - columns[:-lag])[same], (points.value[lag:] - points.value[:-lag])[same]
    size = np.maximum(np.sqrt(np.mean(moved**2, axis=0)), 1e-12)
    moved = moved / size
    gram = moved.T @ moved + LEVEL * len(moved) * np.eye(moved.shape[1])
    left = values - moved @ np.linalg.solve(gram, moved.T @ values)
    noise = (points.noise[lag:] ** 2 + points.noise[:-lag] ** 2)[same]
    return max(float(np.mean(left**2 - noise)) / float(np.mean((t[lag:] - t[:-lag])[same])), 0.0)
