"""What a hold does to the feedback of source 000 (eqs. 5-7), and how to undo it.

The force is K q + D q' - k q, held over a period T. Held, it acts T/2 late and shrunk by
sin(omega T / 2) / (omega T / 2). So it is computed from the state half a period ahead, which
depends on the force itself (a 2 x 2 solve), and divided by that factor. What is left of order
(omega T)^2 is taken from the sampled loop itself, whose slow dynamics are made exactly isotropic.
"""

from math import cos, pi, sin, sqrt
from typing import Final

import numpy as np
import numpy.typing as npt
from numba import njit

from cosim.layout import DXX, DXY, DYY, KXX, KXY, KYY, M
from cosim.propagation import (
    PHI,
    STATE,
    WIDTH,
    WORK_SIZE,
    linearise,
    taylor_order,
    theta_of,
)

Array = npt.NDArray[np.float64]

# Sampled plant: state' = phi state + force (u_x, u_y).
_PHI: Final = 0  # 4 x 4
_FORCE: Final = 16  # 2 x 4: response to a unit force along x, along y
_THETA: Final = 24
_RATE: Final = 32  # 2 x 4 and 2 x 2: feedback before the solve
_LINEAR: Final = 44  # 8 x 9
_WORK: Final = _LINEAR + 72
_ROUNDS: Final = 4
HOLD_SIZE: Final = _WORK + WORK_SIZE
"""Length of `scratch`."""


@njit(cache=True)
def _sample(duration: float, s: Array) -> None:
    """Write phi and the force responses of the plant over `duration` into s."""
    theta = s[_THETA:_RATE]
    work = s[_WORK:]
    order = taylor_order(theta, duration)
    rest = s[_LINEAR : _LINEAR + 4]
    rest[:] = 0.0
    for axis in range(2):
        linearise(rest, theta, 1.0 - axis, 1.0 * axis, duration, order, work)
        for i in range(4):
            s[_FORCE + 4 * axis + i] = work[i * WIDTH + STATE]
            for j in range(4):
                s[_PHI + 4 * i + j] = work[i * WIDTH + PHI + j]


@njit(cache=True)
def _solve_for_force(s: Array, gain: Array, mix: Array) -> None:
    """Solve u = rate (phi state + force u) + w for u."""
    rate = s[_RATE:_LINEAR]
    for i in range(2):
        for axis in range(2):
            total = 1.0 if i == axis else 0.0
            for j in range(4):
                total -= rate[4 * i + j] * s[_FORCE + 4 * axis + j]
            rate[8 + 2 * i + axis] = total
    det = rate[8] * rate[11] - rate[9] * rate[10]
    mix[0] = rate[11] / det
    mix[1] = -rate[9] / det
    mix[2] = -rate[10] / det
    mix[3] = rate[8] / det
    for j in range(4):
        f_x = 0.0
        f_y = 0.0
        for i in range(4):
            f_x += rate[i] * s[_PHI + 4 * i + j]
            f_y += rate[4 + i] * s[_PHI + 4 * i + j]
        gain[j] = mix[0] * f_x + mix[1] * f_y
        gain[4 + j] = mix[2] * f_x + mix[3] * f_y


@njit(cache=True)
def _mode(omega: float, gain: Array, s: Array, a: int, b: int, twin: bool) -> complex:
    """Return l_a (phi + force gain) r_b, or with the conjugate of r_b (`twin`).

    r = (1, i omega) and l = (1, -i / omega) / 2 on axis a, b: the oscillator turning exp(i omega t).
    """
    total = 0.0j
    for i in range(2):
        left = 0.5 + 0.0j if i == 0 else complex(0.0, -0.5 / omega)
        for j in range(2):
            right = 1.0 + 0.0j if j == 0 else complex(0.0, -omega if twin else omega)
            row = 2 * a + i
            column = 2 * b + j
            loop = s[_PHI + 4 * row + column]
            loop += s[_FORCE + row] * gain[column]
            loop += s[_FORCE + 4 + row] * gain[4 + column]
            total += left * loop * right
    return total


@njit(cache=True)
def _make_isotropic(omega_squared: float, omega_z: float, period: float, gain: Array, s: Array) -> None:
    """Correct `gain` so that the sampled loop turns exp(i omega T), and by -omega_z T in the plane.

    The slow motion sees l A r between either axis, and by way of the counter-rotating motion (a
    Schur complement, second order). A change of the gain by dk + dd d/dt moves it by
    (l force) (dk + i omega dd): one division an entry, repeated for what is of higher order.
    """
    omega = sqrt(omega_squared)
    angle = omega * period
    wanted = complex(cos(angle), sin(angle))
    for _ in range(_ROUNDS):
        n_00 = _mode(omega, gain, s, 0, 0, True)
        n_01 = _mode(omega, gain, s, 0, 1, True)
        n_10 = _mode(omega, gain, s, 1, 0, True)
        n_11 = _mode(omega, gain, s, 1, 1, True)
        for a in range(2):
            push = 0.5 * complex(s[_FORCE + 6 * a], -s[_FORCE + 6 * a + 1] / omega)
            left = n_00 if a == 0 else n_10
            right = n_01 if a == 0 else n_11
            for b in range(2):
                down = (n_00 if b == 0 else n_01).conjugate()
                up = (n_10 if b == 0 else n_11).conjugate()
                total = _mode(omega, gain, s, a, b, False)
                total += (left * down + right * up) / complex(0.0, 2.0 * sin(angle))
                if a == b:
                    total -= wanted * cos(omega_z * period)
                else:
                    total -= wanted * sin(omega_z * period) * (b - a)
                change = -total / push
                gain[4 * a + 2 * b] += change.real
                gain[4 * a + 2 * b + 1] += change.imag / omega


@njit(cache=True)
def feedback(
    estimate: Array,
    omega_z: float,
    k: float,
    period: float,
    compensate: bool,
    gain: Array,
    mix: Array,
    s: Array,
) -> None:
    """Write the held force as gain (2 x 4) times the state at t_k plus mix (2 x 2) times w.

    estimate in the order of cosim.layout (SI), omega_z [rad/s] in place of its own, k [N/m],
    period [s]; s f8[HOLD_SIZE] is scratch. w is the rest of the force, at mid-hold.
    `compensate` False: a plain hold.
    """
    theta = s[_THETA:_RATE]
    theta_of(estimate, theta)
    theta[0] = omega_z
    half = 0.0
    boost = 1.0
    if compensate:
        half = 0.5 * period
        angle = sqrt(k / estimate[M]) * half
        boost = angle / sin(angle)
    rate = s[_RATE:_LINEAR]
    rate[0] = boost * (estimate[KXX] - k)
    rate[1] = boost * estimate[DXX]
    rate[2] = boost * estimate[KXY]
    rate[3] = boost * estimate[DXY]
    rate[4] = boost * estimate[KXY]
    rate[5] = boost * estimate[DXY]
    rate[6] = boost * (estimate[KYY] - k)
    rate[7] = boost * estimate[DYY]
    _sample(half, s)
    _solve_for_force(s, gain, mix)
    _sample(period, s)
    if compensate:
        _make_isotropic(k / estimate[M], omega_z, period, gain, s)


@njit(cache=True)
def forced_response(
    frequency: float,
    axis: int,
    amplitude: float,
    period: float,
    lead: float,
    gain: Array,
    mix: Array,
    phasor: Array,
    s: Array,
) -> None:
    """Write the steady response of the sampled loop to one tone into phasor f8[8].

    w = amplitude sin(2 pi frequency (t_k + lead)) along `axis`; state i at t_k is then
    phasor[2i] sin(2 pi frequency t_k) + phasor[2i + 1] cos(...). Call `feedback` before.
    """
    angle = 2.0 * pi * frequency * period
    cos_lead = amplitude * cos(2.0 * pi * frequency * lead)
    sin_lead = amplitude * sin(2.0 * pi * frequency * lead)
    a = s[_LINEAR : _LINEAR + 72]
    for i in range(4):
        for j in range(4):
            loop = s[_PHI + 4 * i + j]
            loop += s[_FORCE + i] * gain[j] + s[_FORCE + 4 + i] * gain[4 + j]
            # (exp(i angle) - loop) phasor = force, real and imaginary part
            real = cos(angle) - loop if i == j else -loop
            imaginary = sin(angle) if i == j else 0.0
            a[9 * i + j] = real
            a[9 * i + 4 + j] = -imaginary
            a[9 * (4 + i) + j] = imaginary
            a[9 * (4 + i) + 4 + j] = real
        push = s[_FORCE + i] * mix[axis] + s[_FORCE + 4 + i] * mix[2 + axis]
        a[9 * i + 8] = push * cos_lead
        a[9 * (4 + i) + 8] = push * sin_lead
    _eliminate(a)
    for i in range(4):
        phasor[2 * i] = a[9 * i + 8]
        phasor[2 * i + 1] = a[9 * (4 + i) + 8]


@njit(cache=True)
def _eliminate(a: Array) -> None:
    """Solve the 8 x 8 system a[:, :8] z = a[:, 8] in place (Gauss-Jordan, row pivots)."""
    for i in range(8):
        pivot = i
        for r in range(i + 1, 8):
            if abs(a[9 * r + i]) > abs(a[9 * pivot + i]):
                pivot = r
        for j in range(9):
            a[9 * i + j], a[9 * pivot + j] = a[9 * pivot + j], a[9 * i + j]
        scale = 1.0 / a[9 * i + i]
        for j in range(9):
            a[9 * i + j] *= scale
        for r in range(8):
            if r != i:
                factor = a[9 * r + i]
                for j in range(9):
                    a[9 * r + j] -= factor * a[9 * i + j]
