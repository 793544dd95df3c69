"""Adaptive observer whose gain comes from a Lyapunov function (TW 201137310, eqs. 3-4).

Construction (an adaptive observer of the Kreisselmeier-Zhang type, one step a sample)
    x- = f(x, theta, u)        exact motion over one period; F = df/dx, D = df/dtheta
    Y- = F Y + D,  Y = (I - G C) Y-     response of the state error to the parameter error
    e  = z - C x-              innovation, z the sensed coordinates
    dtheta = Gamma Y-' C' S^-1 e,  S = C Y- Gamma Y-' C' + r
    x  = x- + G e + Y dtheta
    Gamma = Gamma - Gamma Y-' C' S^-1 C Y- Gamma, then Gamma = Gamma + Q
G = kappa C': the sensed coordinates move by kappa e. That is kappa E^-1 C' (C E^-1 C')^-1 for the
energy E(eta) = eta_v' eta_v + eta_q' (K/m) eta_q, so it suits every positive stiffness and needs no
Riccati equation.

Lyapunov function, with theta_err and x_err the errors and eta = x_err - Y theta_err:
    V = E(eta) / (r kappa (2 - kappa) k) + theta_err' Gamma^-1 theta_err,
r the smallest noise variance, kappa the smallest gain, k the lowest eigenvalue of K/m (1 where
velocity is sensed). Decrease, for constant theta and samples without noise:
1. eta- = F eta, for the terms with theta_err cancel. Free motion gains no energy: E(eta-) <= E(eta).
2. The gain takes kappa (2 - kappa) k |C eta-|^2 or more out of E, so the first term of V falls by at least b' r^-1
   b, b = C eta-.
3. e = C Y- theta_err + b. The identity of least squares says that the second term of V changes by b' r^-1 b - e'
   S^-1 e. A larger r, and Q >= 0, only lower it.
Together V falls by at least e' S^-1 e every sample, for any sequences kappa and r above their smallest values and
any Q >= 0. With the tones and the vibration exciting all parameters, e = 0 leaves only zero error. Assumed: f
linear in theta_err. Exactly, x_err- carries a remainder rho of second order in the error, and then sqrt(V+) <=
sqrt(V) + sqrt(E(rho) / (r kappa (2 - kappa) k)).

The sequences follow the data. While omega_z changes, kappa rises so that the lag of omega_z stays below its
deviation. While the innovation exceeds the noise, r and kappa rise, so that what a jump of omega_z leaves in eta
dies fast and moves nothing else; and Q rises, faster for omega_z and the dampings than for the stiffnesses and the
mass, so that parameters may change. When the innovation leaves the noise after a calm, omega_z has probably jumped:
its column of Y starts at zero again. That is a new start, with a V of its own; the decrease holds between such
events.
Gamma is kept as U diag(d) U' (Bierman; Agee-Turner for Q), which rounding can't make negative, and Q stops where a
parameter is as uncertain as at the start.
"""

from math import pi, sqrt
from typing import Final

import numpy as np
import numpy.typing as npt
from numba import njit

from cosim.layout import KXX, OMEGA_Z, M
from cosim.observers.record import (
    INIT_SIGNATURE,
    NOISE_RMS,
    SENSE_GAIN_X,
    SENSES_VELOCITY,
    STEP_SIGNATURE,
    Observer,
)
from cosim.propagation import (
    PHI,
    STATE,
    THETA_SIZE,
    WIDTH,
    WORK_SIZE,
    linearise,
    parameters_of,
    taylor_order,
    theta_of,
)
from cosim.setting import Setting

N: Final = THETA_SIZE
BLOCK: Final = 64

SETTINGS: Final = {
    "settling": Setting(6e-4, 1e-6, 1.0, "s"),
    "settling_moving": Setting(2e-4, 1e-6, 1.0, "s"),
    "damping_max": Setting(0.8, 1e-3, 10.0),
    "omega_walk": Setting(5.0, 0.0, 1e4, "rad/s/√s"),
    "memory_stiffness": Setting(3.0, 1e-4, 1e6, "s"),
    "memory_damping": Setting(1.0, 1e-4, 1e6, "s"),
    "residual_memory": Setting(20.0, 1.0, 1e6, "samples", why="a memory of less than a sample is none"),
    "patience": Setting(5.0, 0.0, 1e6, "periods"),
    "relearn": Setting(0.6, 1e-3, 1e6, "periods"),
    "noise_memory": Setting(15.0, 0.1, 1e6, "periods"),
    "slope_memory": Setting(3.0, 0.1, 1e6, "periods"),
}
"""settling [s]: time constant at which the gain lets the state error die while omega_z rests; settling_moving [s]: the
least while omega_z moves; damping_max: damping ratio that the gain gives the observer at most, while the innovation
exceeds the noise; omega_walk: angular rate as a random walk [rad/s per sqrt(s)]; memory_stiffness (and mass),
memory_damping [s]: older samples count less by exp(-age/memory); residual_memory [samples]: the innovation is
averaged over.
In periods of x alone: patience: a large innovation that lasts longer is no jump of omega_z; relearn: memory_damping
from then on, and memory_stiffness in proportion; noise_memory: the noise, taken as stated at first, grows or falls
e-fold in this time towards the innovation; slope_memory: the change of omega_z is averaged over."""

_SETTLING, _SETTLING_MOVING, _DAMPING_MAX, _OMEGA_WALK, _MEMORY_K, _MEMORY_D = range(6)
_RESIDUAL, _PATIENCE, _RELEARN, _NOISE, _SLOPE = range(6, 11)

# A mean of 20 squared pairs of unit noise passes 3 once in more than 1e10 samples.
_EXCESS: Final = 3.0
# Half a squared pair of unit noise passes 25 once in e^25 samples.
_OUTLIER: Final = 25.0
# The noise counts as at least this part of the first uncertainty of the motion.
_SMALLEST_NOISE: Final = 1e-6

_THETA: Final = 4
_Y: Final = _THETA + N
_U: Final = _Y + 4 * N
_D: Final = _U + N * N
_WORK: Final = _D + N
_GAIN: Final = _WORK + WORK_SIZE
_CHANGE: Final = _GAIN + N
_LIMIT: Final = _CHANGE + N
_CONST: Final = _LIMIT + N
_GAIN_X, _GAIN_Y, _R_X, _R_Y, _ROW, _PERIOD, _COUNT, _ORDER = range(_CONST, _CONST + 8)
_KAPPA, _KAPPA_MIN, _KAPPA_MAX, _RHO, _FLOOR, _GROWTH = range(_CONST + 8, _CONST + 14)
_LASTED, _LONG, _BOOST, _OMEGA_1, _OMEGA_2, _SHARE = range(_CONST + 14, _CONST + 20)
MEMORY_SIZE: Final = _CONST + 20


@njit(cache=True)
def _fold(u, d, h, r, gain):  # type: ignore[no-untyped-def]
    """Take the scalar h' theta + noise of variance r into u d u'; return S, write gain * S."""
    s = r
    for j in range(N):
        f = h[j]
        for i in range(j):
            f += u[i * N + j] * h[i]
        v = d[j] * f
        s_next = s + f * v
        factor = -f / s
        d[j] *= s / s_next
        for i in range(j):
            old = u[i * N + j]
            u[i * N + j] = old + factor * gain[i]
            gain[i] += old * v
        gain[j] = v
        s = s_next
    return s


@njit(cache=True)
def _raise(u, d, index, q, column):  # type: ignore[no-untyped-def]
    """Add the variance q to parameter `index` of u d u'; `column` f8[N] is scratch."""
    for i in range(index):
        column[i] = 0.0
    column[index] = 1.0
    for j in range(index, -1, -1):
        old = d[j]
        d[j] = old + q * column[j] * column[j]
        if d[j] == 0.0:
            continue
        factor = q * column[j] / d[j]
        q *= old / d[j]
        for i in range(j):
            column[i] -= column[j] * u[i * N + j]
            u[i * N + j] += factor * column[i]


@njit(cache=True)
def _covariance(u, d, i, j):  # type: ignore[no-untyped-def]
    total = 0.0
    for k in range(max(i, j), N):
        total += u[i * N + k] * u[j * N + k] * d[k]
    return total


@njit(cache=True)
def _respond(memory, work):  # type: ignore[no-untyped-def]
    """Turn the derivatives by theta in `work` into Y- = F Y + D."""
    for i in range(4):
        for k in range(4):
            factor = work[i * WIDTH + PHI + k]
            for j in range(N):
                work[i * WIDTH + j] += factor * memory[_Y + k * N + j]


@njit(cache=True)
def _excess(memory, rho):  # type: ignore[no-untyped-def]
    return max(rho / memory[_FLOOR] - _EXCESS, 0.0)


@njit(cache=True)
def _start_rate_anew(work):  # type: ignore[no-untyped-def]
    """Forget the response to the error of omega_z: a jump has no past."""
    for i in range(4):
        work[i * WIDTH] = 0.0


@njit(cache=True)
def _gain_of_slope(memory, settings):  # type: ignore[no-untyped-def]
    """Return the gain at which omega_z, which lags by slope * settling, lags by its deviation."""
    memory[_OMEGA_1] += memory[_SHARE] * (memory[_THETA] - memory[_OMEGA_1])
    memory[_OMEGA_2] += memory[_SHARE] * (memory[_OMEGA_1] - memory[_OMEGA_2])
    change = memory[_SHARE] * abs(memory[_OMEGA_1] - memory[_OMEGA_2])
    kappa = 2.0 * change / sqrt(_covariance(memory[_U:_D], memory[_D:_WORK], 0, 0))
    kappa = min(kappa, 2.0 * memory[_PERIOD] / settings[_SETTLING_MOVING])
    return max(kappa, memory[_KAPPA_MIN])


@njit(cache=True)
def _adapt(memory, settings, work, e_x, e_y):  # type: ignore[no-untyped-def]
    """Follow the innovation with kappa; return the factor on the noise variances."""
    now = 0.5 * (e_x * e_x / memory[_R_X] + e_y * e_y / memory[_R_Y])
    memory[_RHO] += (now - memory[_RHO]) / settings[_RESIDUAL]
    if _excess(memory, memory[_RHO]) > 0.0 or now > _OUTLIER * memory[_FLOOR]:
        if memory[_LASTED] < -memory[_LONG]:
            _start_rate_anew(work)
        memory[_LASTED] = max(memory[_LASTED], 0.0) + 1.0
        memory[_FLOOR] *= 1.0 + memory[_GROWTH]
    else:
        memory[_LASTED] = min(memory[_LASTED], 0.0) - 1.0
        if memory[_RHO] < memory[_FLOOR]:
            memory[_FLOOR] = max(memory[_FLOOR] * (1.0 - memory[_GROWTH]), 1.0)
    excess = _excess(memory, max(memory[_RHO], now))
    kappa = _gain_of_slope(memory, settings) * sqrt(max(excess, 1.0))
    memory[_KAPPA] = min(kappa, memory[_KAPPA_MAX])
    return memory[_FLOOR] * (1.0 + excess)


@njit(cache=True)
def _correct(memory, work, e_x, e_y, factor):  # type: ignore[no-untyped-def]
    """Correct theta, Gamma and the state with the innovation."""
    u = memory[_U:_D]
    d = memory[_D:_WORK]
    gain = memory[_GAIN:_CHANGE]
    change = memory[_CHANGE:_LIMIT]
    row = int(memory[_ROW])
    h = work[row * WIDTH : row * WIDTH + N]
    scaled = e_x / _fold(u, d, h, memory[_R_X] * factor, gain)
    for j in range(N):
        change[j] = gain[j] * scaled
    h = work[(row + 2) * WIDTH : (row + 2) * WIDTH + N]
    rest = e_y
    for j in range(N):
        rest -= h[j] * change[j]
    scaled = rest / _fold(u, d, h, memory[_R_Y] * factor, gain)
    for j in range(N):
        change[j] += gain[j] * scaled
        memory[_THETA + j] += change[j]
    for i in range(4):
        kappa = 0.0
        if i % 2 == row:
            kappa = memory[_KAPPA]
        total = work[i * WIDTH + STATE] + kappa * (e_x if i < 2 else e_y)
        for j in range(N):
            response = (1.0 - kappa) * work[i * WIDTH + j]
            memory[_Y + i * N + j] = response
            total += response * change[j]
        memory[i] = total


@njit(cache=True)
def _forget(memory, settings):  # type: ignore[no-untyped-def]
    """Add Q: to omega_z, and to the other seven in turn."""
    u = memory[_U:_D]
    d = memory[_D:_WORK]
    period = memory[_PERIOD]
    q = settings[_OMEGA_WALK] ** 2 * period * (1.0 + _excess(memory, memory[_RHO]))
    room = memory[_LIMIT] - _covariance(u, d, 0, 0)
    d[0] += max(min(q, room), 0.0)
    index = 1 + int(memory[_COUNT]) % (N - 1)
    duration = settings[_MEMORY_K]
    if 4 <= index <= 6:
        duration = settings[_MEMORY_D]
    rate = 2.0 * (N - 1) * period / duration
    if memory[_LASTED] > memory[_LONG]:
        rate *= memory[_BOOST]
    variance = _covariance(u, d, index, index)
    q = min(rate * variance, memory[_LIMIT + index] - variance)
    if q > 0.0:
        _raise(u, d, index, q, memory[_GAIN:_CHANGE])


@njit(cache=True)
def _write(memory, estimate, deviation):  # type: ignore[no-untyped-def]
    """Write the estimates; the deviations are those of Gamma times the measured innovation."""
    u = memory[_U:_D]
    d = memory[_D:_WORK]
    parameters_of(memory[_THETA:_Y], estimate)
    scale = sqrt(max(memory[_RHO] / memory[_FLOOR], 1.0))
    mass = estimate[M]
    p_mm = d[N - 1]
    deviation[OMEGA_Z] = scale * sqrt(_covariance(u, d, 0, 0))
    for i in range(1, 7):
        value = estimate[KXX + i - 1]
        p_im = u[i * N + N - 1] * p_mm
        variance = _covariance(u, d, i, i) - 2.0 * value * p_im + value * value * p_mm
        deviation[KXX + i - 1] = scale * mass * sqrt(max(variance, 0.0))
    deviation[M] = scale * mass * mass * sqrt(p_mm)
    # Without parameter error a lossless mode driven by kappa * noise has kappa/2 of its variance.
    share = 0.5 * memory[_KAPPA]
    omega = sqrt(max(memory[_THETA + 1], 0.0))
    for i in range(4):
        unit = 1.0
        if i % 2 != memory[_ROW]:
            unit = omega if i % 2 == 1 else 1.0 / max(omega, 1.0)
        variance = share * memory[_FLOOR] * memory[_R_X if i < 2 else _R_Y] * unit * unit
        for k in range(N):
            f = memory[_Y + i * N + k]
            for j in range(k):
                f += memory[_Y + i * N + j] * u[j * N + k]
            variance += f * f * d[k]
        estimate[i] = memory[i]
        deviation[i] = scale * sqrt(variance)


@njit(INIT_SIGNATURE, cache=True)
def _init(memory, settings, start, start_deviation, sensor, period):  # type: ignore[no-untyped-def]
    memory[:] = 0.0
    memory[0:4] = start[0:4]
    theta_of(start, memory[_THETA:_Y])
    mass = start[M]
    relative_m = start_deviation[M] / mass
    # k/m and 1/m share the error of m: without their covariance the prior on k would be wrong.
    memory[_D] = start_deviation[OMEGA_Z] ** 2
    memory[_D + 7] = (relative_m / mass) ** 2
    for i in range(6):
        memory[_D + 1 + i] = (start_deviation[KXX + i] / mass) ** 2
        memory[_U + (1 + i) * N + 7] = start[KXX + i]
    for j in range(N):
        memory[_U + j * N + j] = 1.0
    for j in range(N):
        memory[_LIMIT + j] = _covariance(memory[_U:_D], memory[_D:_WORK], j, j)
    row = int(sensor[SENSES_VELOCITY])
    memory[_ROW] = row
    for i in range(2):
        noise = sensor[NOISE_RMS] / sensor[SENSE_GAIN_X + i]
        smallest = _SMALLEST_NOISE * start_deviation[row + 2 * i]
        memory[_R_X + i] = max(noise, smallest) ** 2
        memory[_GAIN_X + i] = sensor[SENSE_GAIN_X + i]
    memory[_PERIOD] = period
    memory[_ORDER] = taylor_order(memory[_THETA:_Y], period) + 2
    once = 2.0 * sqrt(start[KXX] / mass) * period
    cycle = 4.0 * pi / once
    memory[_FLOOR] = 1.0
    memory[_GROWTH] = 1.0 / (settings[_NOISE] * cycle)
    memory[_SHARE] = min(1.0 / (settings[_SLOPE] * cycle), 1.0)
    memory[_LONG] = settings[_PATIENCE] * cycle
    memory[_BOOST] = settings[_MEMORY_D] / (settings[_RELEARN] * cycle * period)
    memory[_KAPPA_MAX] = min(once * settings[_DAMPING_MAX], 1.0)
    memory[_KAPPA_MIN] = min(2.0 * period / settings[_SETTLING], memory[_KAPPA_MAX])
    memory[_KAPPA] = memory[_KAPPA_MIN]
    memory[_OMEGA_1] = start[OMEGA_Z]
    memory[_OMEGA_2] = start[OMEGA_Z]


@njit(STEP_SIGNATURE, cache=True)
def _step(memory, settings, u_x, u_y, v_x, v_y, estimate, deviation):  # type: ignore[no-untyped-def]
    row = int(memory[_ROW])
    z_x = v_x / memory[_GAIN_X]
    z_y = v_y / memory[_GAIN_Y]
    if memory[_COUNT] == 0.0:
        memory[row] = z_x
        memory[row + 2] = z_y
    else:
        work = memory[_WORK:_GAIN]
        theta = memory[_THETA:_Y]
        linearise(memory, theta, u_x, u_y, memory[_PERIOD], int(memory[_ORDER]), work)
        _respond(memory, work)
        e_x = z_x - work[row * WIDTH + STATE]
        e_y = z_y - work[(row + 2) * WIDTH + STATE]
        factor = _adapt(memory, settings, work, e_x, e_y)
        _correct(memory, work, e_x, e_y, factor)
        _forget(memory, settings)
        if memory[_COUNT] % BLOCK == 0.0:
            memory[_ORDER] = taylor_order(theta, memory[_PERIOD])
    memory[_COUNT] += 1.0
    _write(memory, estimate, deviation)


def energy_weight(memory: npt.NDArray[np.float64], theta: npt.NDArray[np.float64]) -> float:
    """Return 1/(r kappa (2 - kappa) k) of the Lyapunov function, for the true `theta` f8[8]."""
    kappa = memory[_KAPPA_MIN]
    lowest = 1.0
    if memory[_ROW] == 0.0:
        lowest = float(np.linalg.eigvalsh([[theta[1], theta[3]], [theta[3], theta[2]]])[0])
    return float(1.0 / (min(memory[_R_X], memory[_R_Y]) * kappa * (2.0 - kappa) * lowest))


def energy(error: npt.NDArray[np.float64], theta: npt.NDArray[np.float64]) -> float:
    """Return twice the energy per mass [m^2/s^2] of a motion [x, x', y, y'] under `theta` f8[8]."""
    x, x_dot, y, y_dot = error
    strain = theta[1] * x * x + 2.0 * theta[3] * x * y + theta[2] * y * y
    return float(x_dot * x_dot + y_dot * y_dot + strain)


def split_error(
    memory: npt.NDArray[np.float64], state: npt.NDArray[np.float64], theta: npt.NDArray[np.float64]
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Return eta f8[4] and theta_err f8[8] of an observer's memory, given the truth (SI)."""
    theta_error = theta - memory[_THETA:_Y]
    return state - memory[:4] - memory[_Y:_U].reshape(4, N) @ theta_error, theta_error


def lyapunov_function(
    memory: npt.NDArray[np.float64], state: npt.NDArray[np.float64], theta: npt.NDArray[np.float64]
) -> float:
    """Return V of an observer's memory, given the true state f8[4] and theta f8[8] (SI)."""
    eta, theta_error = split_error(memory, state, theta)
    whitened = np.linalg.solve(memory[_U:_D].reshape(N, N), theta_error)
    return float(energy_weight(memory, theta) * energy(eta, theta) + np.sum(whitened * whitened / memory[_D:_WORK]))


OBSERVER: Final = Observer("lyapunov", MEMORY_SIZE, SETTINGS, _init, _step)
