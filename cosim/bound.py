"""Posterior Cramer-Rao bound on the seven parameters and the angular rate.

No estimator that sees the samples up to t, and knows the priors, has a smaller rms error. The model
is linearised along the true motion with u held fixed, so the bound is the covariance of the Kalman
filter that is told the truth (Tichavsky, Muravchik, Nehorai 1998, for a state without noise but
for the random walk of omega_z).
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt
from numba import njit

from cosim.observers.kalman import add_variance, correct_factors, predict_factors
from cosim.propagation import THETA_SIZE, WORK_SIZE, linearise, taylor_order

Array = npt.NDArray[np.float64]

_SIZE: Final = 4 + THETA_SIZE


@dataclass(frozen=True)
class Prior:
    """What is known beside the samples.

    omega_walk: omega_z is a random walk [rad/s per sqrt(s)]; omega: standard deviation of its first
    value [rad/s]; parameters: relative standard deviation of the seven; amplitude: standard
    deviation of the first position [m], and times sqrt(kxx/m) of the first velocity.
    """

    omega_walk: float
    omega: float = 10.0
    parameters: float = 0.3
    amplitude: float = 1e-6


@dataclass(frozen=True)
class Motion:
    """The true motion, one row a sample: the samples are taken at t = k * period [s].

    states f8[n, 4] = x, x', y, y' [m, m/s]; forces f8[n, 2] [N], row k held from t_k; omega_z f8[n]
    [rad/s]; parameters f8[7] = kxx, kyy, kxy, dxx, dyy, dxy, m (SI).
    """

    states: Array
    forces: Array
    omega_z: Array
    parameters: Array
    period: float


def parameter_bound(
    motion: Motion,
    noise: tuple[float, float],
    times: Array,
    prior: Prior,
    per_mass: bool = False,
) -> tuple[Array, Array]:
    """Return the bounds at `times` [s] on the seven (relative, f8[t, 7]) and omega_z (f8[t], rad/s).

    noise: standard deviation of one sample along x and y [m]; per_mass: bound k/m and d/m in place
    of k and d, as the table of SYSTEM.md section 2 does. Raises ValueError for a time that the
    motion does not reach.
    """
    index = np.rint(np.asarray(times) / motion.period).astype(np.int64)
    if index.size and (index.min() < 0 or index.max() >= len(motion.states)):
        last = (len(motion.states) - 1) * motion.period
        raise ValueError(f"times = {times} s: choose times from 0 to {last} s, where the motion ends")
    factors, diagonals = _covariance_factors(
        np.ascontiguousarray(motion.states),
        np.ascontiguousarray(motion.forces),
        motion.omega_z,
        motion.parameters,
        motion.period,
        np.array(noise) ** 2,
        index,
        np.array([prior.omega_walk, prior.omega, prior.parameters, prior.amplitude]),
    )
    to_physical = _physical(motion.parameters, per_mass)
    bounds = np.empty((len(index), 7))
    omega = np.empty(len(index))
    for i, (u, d) in enumerate(zip(factors, diagonals, strict=True)):
        factor = u.reshape(_SIZE, _SIZE).T
        covariance = (factor * d) @ factor.T
        physical = to_physical @ covariance[5:, 5:] @ to_physical.T
        # A cross term may be zero; its relative bound is then no number.
        with np.errstate(divide="ignore", invalid="ignore"):
            bounds[i] = np.sqrt(np.diag(physical)) / np.abs(motion.parameters)
        omega[i] = np.sqrt(covariance[4, 4])
    return bounds, omega


def _physical(parameters: Array, per_mass: bool) -> Array:
    """Return d(kxx .. dxy, m) / d(kxx/m .. dxy/m, 1/m), (7, 7), with k/m as m * k/m if `per_mass`."""
    mass = parameters[6]
    jacobian = np.diag(np.full(7, mass))
    if not per_mass:
        jacobian[:6, 6] = -mass * parameters[:6]
    jacobian[6, 6] = -mass * mass
    return jacobian


@njit(cache=True)
def _covariance_factors(  # type: ignore[no-untyped-def]
    states, forces, omega_z, parameters, period, noise, index, prior
):
    size = _SIZE
    mass = parameters[6]
    theta = np.empty(8)
    for i in range(6):
        theta[1 + i] = parameters[i] / mass
    theta[7] = 1.0 / mass
    u = np.zeros(size * size)
    d = np.zeros(size)
    _set_prior(u, d, theta, prior)
    nothing = np.zeros(size)
    work = np.empty(WORK_SIZE)
    row = np.zeros(size)
    gain = np.empty(size)
    factors = np.zeros((len(index), size * size))
    diagonals = np.zeros((len(index), size))
    order = taylor_order(theta, period) + 2
    last = -1
    for i in index:
        last = max(last, i)
    for k in range(last + 1):
        if k > 0:
            theta[0] = omega_z[k - 1]
            force = forces[k - 1]
            linearise(states[k - 1], theta, force[0], force[1], period, order, work)
            for j in range(4):
                row[j] = 0.0
            row[4] = 1.0
            add_variance(u, d, size, 4, prior[0] ** 2 * period, row)
            predict_factors(u, d, size, work)
        for axis in range(2):
            for j in range(size):
                row[j] = u[j * size + 2 * axis]
            correct_factors(nothing, u, d, size, row, noise[axis], 0.0, gain)
        for i in range(len(index)):
            if index[i] == k:
                for j in range(size):
                    diagonals[i, j] = d[j]
                for j in range(size * size):
                    factors[i, j] = u[j]
    return factors, diagonals


@njit(cache=True)
def _set_prior(u, d, theta, prior):  # type: ignore[no-untyped-def]
    """The seven have independent relative errors, so k/m and d/m share that of 1/m."""
    for i in range(_SIZE):
        u[i * _SIZE + i] = 1.0
    for i in range(4):
        scale = np.sqrt(theta[1]) if i % 2 == 1 else 1.0
        d[i] = (prior[3] * scale) ** 2
    d[4] = prior[1] ** 2
    for i in range(1, 8):
        d[4 + i] = (prior[2] * theta[i]) ** 2
        if i < 7:
            u[11 * _SIZE + 4 + i] = theta[i] / theta[7]
