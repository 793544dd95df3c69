"""Covariance of the extended Kalman filters as U D U', on flat arrays.

The first four states move (x, x', y, y'), the eight after them are theta of cosim.propagation, and
any further ones are constants of the sensor. The parameters end up correlated to 1 part in 1e12, so
a covariance matrix loses its sign to rounding; its factors can't: U is unit upper triangular, all
of D is positive (Bierman 1977). F is the identity but for its first four rows, so the factors of
everything after the state survive a prediction unchanged, and it costs less than F P F'.

U is f8[size * size], column j from j * size on, with its diagonal of ones and zeros below.
"""

from typing import Final

import numpy as np
import numpy.typing as npt
from numba import njit

from cosim.propagation import PHI, WIDTH

Array = npt.NDArray[np.float64]

MOVING: Final = 12
"""Size of [x, x', y, y', theta]."""
SCRATCH_SIZE: Final = 32
"""Length of `scratch`; also the largest size of a filter."""


@njit(cache=True)
def predict_factors(u: Array, d: Array, size: int, jacobian: Array) -> None:
    """Turn the factors of P into those of F P F'.

    `jacobian` is `work` of `propagation.linearise`; its part after the first four rows is used up.
    """
    for j in range(4, size):
        column = j * size
        a_0, a_1, a_2, a_3 = 0.0, 0.0, 0.0, 0.0
        for k in range(4):
            factor = u[column + k]
            a_0 += jacobian[PHI + k] * factor
            a_1 += jacobian[WIDTH + PHI + k] * factor
            a_2 += jacobian[2 * WIDTH + PHI + k] * factor
            a_3 += jacobian[3 * WIDTH + PHI + k] * factor
        for k in range(8):
            factor = u[column + 4 + k]
            a_0 += jacobian[k] * factor
            a_1 += jacobian[WIDTH + k] * factor
            a_2 += jacobian[2 * WIDTH + k] * factor
            a_3 += jacobian[3 * WIDTH + k] * factor
        u[column] = a_0
        u[column + 1] = a_1
        u[column + 2] = a_2
        u[column + 3] = a_3
    _orthogonalise(u, d, size, jacobian)


@njit(cache=True)
def _orthogonalise(u: Array, d: Array, size: int, jacobian: Array) -> None:
    """Factor (phi U_s) D_s (phi U_s)' by weighted Gram-Schmidt (Thornton 1976)."""
    w = jacobian[4 * WIDTH :]
    weight = jacobian[5 * WIDTH :]
    for i in range(4):
        weight[i] = d[i]
        for j in range(4):
            total = 0.0
            for k in range(j + 1):
                total += jacobian[i * WIDTH + PHI + k] * u[j * size + k]
            w[4 * i + j] = total
    for j in range(3, -1, -1):
        total = 0.0
        for k in range(4):
            total += w[4 * j + k] * w[4 * j + k] * weight[k]
        d[j] = total
        for i in range(j):
            cross = 0.0
            for k in range(4):
                cross += w[4 * i + k] * w[4 * j + k] * weight[k]
            cross /= total
            u[j * size + i] = cross
            for k in range(4):
                w[4 * i + k] -= cross * w[4 * j + k]


@njit(cache=True)
def add_variance(u: Array, d: Array, size: int, last: int, variance: float, v: Array) -> None:
    """Add variance * v v' to P (Agee and Turner 1972); v is zero after index `last`, and used up."""
    for j in range(last, -1, -1):
        head = v[j]
        total = d[j] + variance * head * head
        if total > 0.0:
            beta = variance * head / total
            variance *= d[j] / total
            d[j] = total
            for i in range(j):
                v[i] -= head * u[j * size + i]
                u[j * size + i] += beta * v[i]


@njit(cache=True)
def inflate(u: Array, d: Array, size: int, index: int, factor: float) -> None:
    """Multiply the standard deviation of one state by `factor`; correlations stay."""
    for j in range(index + 1, size):
        u[j * size + index] *= factor
    for i in range(index):
        u[index * size + i] /= factor
    d[index] *= factor * factor


@njit(cache=True)
def correct_factors(
    state: Array,
    u: Array,
    d: Array,
    size: int,
    f: Array,
    noise: float,
    innovation: float,
    gain: Array,
) -> float:
    """Correct `state` and the factors with one scalar; return the variance of the innovation.

    f = U' h of the measurement's row h; noise is its variance. Leaves P h in `gain`.
    """
    for i in range(size):
        gain[i] = 0.0
    total = noise
    for j in range(size):
        weight = d[j] * f[j]
        before = total
        total += f[j] * weight
        ratio = 1.0 / before
        d[j] *= before / total
        slope = -f[j] * ratio
        column = j * size
        for i in range(size):
            beta = u[column + i]
            u[column + i] = beta + gain[i] * slope
            gain[i] += weight * beta
    step = innovation / total
    for i in range(size):
        state[i] += gain[i] * step
    return total


@njit(cache=True)
def variance_of(u: Array, d: Array, size: int, index: int) -> float:
    """Return P[index, index]."""
    total = 0.0
    for j in range(index, size):
        total += u[j * size + index] * u[j * size + index] * d[j]
    return total
