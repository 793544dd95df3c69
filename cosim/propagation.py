"""One sample of the plant (TW 201137310, eq. 1), exactly, with its derivatives.

The state is [x, x', y, y'] (m, m/s). The parameters are the eight rates

    theta = [omega_z, kxx/m, kyy/m, kxy/m, dxx/m, dyy/m, dxy/m, 1/m]

in which the acceleration is linear. Force and angular rate are held over the sample, so the
Taylor series of the motion is the exact solution once its remainder is below the rounding.
"""

from typing import Final

import numpy as np
import numpy.typing as npt
from numba import njit

from cosim.layout import DXX, DXY, DYY, KXX, KXY, KYY, OMEGA_Z, M

THETA_SIZE: Final = 8
"""Length of theta."""

WIDTH: Final = 16
"""Columns of a row of `work`: 8 of d/d theta, 4 of d/d state, the state itself, 3 idle."""
PHI: Final = 8
"""First column of d state(t + T) / d state(t)."""
STATE: Final = 12
"""Column of the state."""
_FORCE: Final = 4 * WIDTH
_TERM: Final = 6 * WIDTH
WORK_SIZE: Final = 10 * WIDTH
"""Length of `work` of `linearise`."""

_REMAINDER: Final = 1e-13
_ORDER_MAX: Final = 40


@njit(cache=True)
def taylor_order(theta: npt.NDArray[np.float64], period: float) -> int:
    """Return the order at which the Taylor remainder over `period` (s) falls below 1e-13."""
    stiffness = max(abs(theta[1]), abs(theta[2])) + abs(theta[3])
    damping = max(abs(theta[4]), abs(theta[5])) + abs(theta[6]) + 2.0 * abs(theta[0])
    ratio = period * (np.sqrt(stiffness) + damping)
    remainder = ratio
    order = 1
    while remainder > _REMAINDER and order < _ORDER_MAX:
        order += 1
        remainder *= ratio / order
    return order


@njit(cache=True)
def propagate(
    x: float,
    x_dot: float,
    y: float,
    y_dot: float,
    theta: npt.NDArray[np.float64],
    u_x: float,
    u_y: float,
    period: float,
    order: int,
) -> tuple[float, float, float, float]:
    """Return [x, x', y, y'] one `period` (s) later, with the forces u_x, u_y (N) held."""
    sum_x, sum_x_dot, sum_y, sum_y_dot = x, x_dot, y, y_dot
    force_x = theta[7] * u_x
    force_y = theta[7] * u_y
    cross_x = 2.0 * theta[0] - theta[6]
    cross_y = -2.0 * theta[0] - theta[6]
    for n in range(1, order + 1):
        c = period / n
        a_x = force_x - theta[1] * x - theta[3] * y - theta[4] * x_dot + cross_x * y_dot
        a_y = force_y - theta[3] * x - theta[2] * y - theta[5] * y_dot + cross_y * x_dot
        x, y, x_dot, y_dot = c * x_dot, c * y_dot, c * a_x, c * a_y
        sum_x += x
        sum_x_dot += x_dot
        sum_y += y
        sum_y_dot += y_dot
        force_x = 0.0
        force_y = 0.0
    return sum_x, sum_x_dot, sum_y, sum_y_dot


@njit(cache=True)
def linearise(
    state: npt.NDArray[np.float64],
    theta: npt.NDArray[np.float64],
    u_x: float,
    u_y: float,
    period: float,
    order: int,
    work: npt.NDArray[np.float64],
) -> None:
    """Write the state one `period` (s) later and its derivatives into `work`.

    state f8[>=4], theta f8[>=8], forces u_x, u_y in N, work f8[WORK_SIZE]. Row i = 0..3 (x, x', y,
    y') of the result starts at work[i * WIDTH]: columns 0..7 d/d theta, PHI..PHI+3 d/d state(t),
    STATE the state itself; the rest of `work` is scratch.
    """
    for i in range(4 * WIDTH):
        work[i] = 0.0
        work[_TERM + i] = 0.0
    for i in range(2 * WIDTH):
        work[_FORCE + i] = 0.0
    for i in range(4):
        work[i * WIDTH + PHI + i] = 1.0
        work[_TERM + i * WIDTH + PHI + i] = 1.0
        work[i * WIDTH + STATE] = state[i]
        work[_TERM + i * WIDTH + STATE] = state[i]
    work[_FORCE + 7] = u_x
    work[_FORCE + WIDTH + 7] = u_y
    work[_FORCE + STATE] = theta[7] * u_x
    work[_FORCE + WIDTH + STATE] = theta[7] * u_y
    for n in range(1, order + 1):
        _force_of_parameters(work)
        _next_term(theta, period / n, work)
        work[_FORCE + 7] = 0.0
        work[_FORCE + WIDTH + 7] = 0.0
        work[_FORCE + STATE] = 0.0
        work[_FORCE + WIDTH + STATE] = 0.0


@njit(cache=True)
def _force_of_parameters(work: npt.NDArray[np.float64]) -> None:
    """Set d acceleration / d theta at the current Taylor term of the state."""
    x = work[_TERM + STATE]
    x_dot = work[_TERM + WIDTH + STATE]
    y = work[_TERM + 2 * WIDTH + STATE]
    y_dot = work[_TERM + 3 * WIDTH + STATE]
    work[_FORCE] = 2.0 * y_dot
    work[_FORCE + 1] = -x
    work[_FORCE + 3] = -y
    work[_FORCE + 4] = -x_dot
    work[_FORCE + 6] = -y_dot
    work[_FORCE + WIDTH] = -2.0 * x_dot
    work[_FORCE + WIDTH + 2] = -y
    work[_FORCE + WIDTH + 3] = -x
    work[_FORCE + WIDTH + 5] = -y_dot
    work[_FORCE + WIDTH + 6] = -x_dot


@njit(cache=True)
def _next_term(theta: npt.NDArray[np.float64], c: float, work: npt.NDArray[np.float64]) -> None:
    """Turn Taylor term n - 1 of every column into term n and add it to the sum."""
    kxx, kyy, kxy = theta[1], theta[2], theta[3]
    dxx, dyy = theta[4], theta[5]
    cross_x = 2.0 * theta[0] - theta[6]
    cross_y = -2.0 * theta[0] - theta[6]
    for j in range(WIDTH):
        x = work[_TERM + j]
        x_dot = work[_TERM + WIDTH + j]
        y = work[_TERM + 2 * WIDTH + j]
        y_dot = work[_TERM + 3 * WIDTH + j]
        a_x = work[_FORCE + j] - kxx * x - kxy * y - dxx * x_dot + cross_x * y_dot
        a_y = work[_FORCE + WIDTH + j] - kxy * x - kyy * y - dyy * y_dot + cross_y * x_dot
        x, x_dot, y, y_dot = c * x_dot, c * a_x, c * y_dot, c * a_y
        work[_TERM + j] = x
        work[_TERM + WIDTH + j] = x_dot
        work[_TERM + 2 * WIDTH + j] = y
        work[_TERM + 3 * WIDTH + j] = y_dot
        work[j] += x
        work[WIDTH + j] += x_dot
        work[2 * WIDTH + j] += y
        work[3 * WIDTH + j] += y_dot


@njit(cache=True)
def theta_of(estimate: npt.NDArray[np.float64], theta: npt.NDArray[np.float64]) -> None:
    """Write theta[0:8] of an estimate in the order of cosim.layout (SI)."""
    theta[0] = estimate[OMEGA_Z]
    theta[1] = estimate[KXX] / estimate[M]
    theta[2] = estimate[KYY] / estimate[M]
    theta[3] = estimate[KXY] / estimate[M]
    theta[4] = estimate[DXX] / estimate[M]
    theta[5] = estimate[DYY] / estimate[M]
    theta[6] = estimate[DXY] / estimate[M]
    theta[7] = 1.0 / estimate[M]


@njit(cache=True)
def parameters_of(theta: npt.NDArray[np.float64], estimate: npt.NDArray[np.float64]) -> None:
    """Write omega_z, k, d and m (SI) of theta[0:8] into an estimate; the inverse of `theta_of`."""
    mass = 1.0 / theta[7]
    estimate[OMEGA_Z] = theta[0]
    estimate[KXX] = theta[1] * mass
    estimate[KYY] = theta[2] * mass
    estimate[KXY] = theta[3] * mass
    estimate[DXX] = theta[4] * mass
    estimate[DYY] = theta[5] * mass
    estimate[DXY] = theta[6] * mass
    estimate[M] = mass
