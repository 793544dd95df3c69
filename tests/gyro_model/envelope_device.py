"""A rate gyroscope for the tests of the envelope form: two axes 50 Hz apart, and both forms of its FMU in one grip."""

from collections.abc import Mapping
from math import pi

import numpy as np
from gyro_runner import Runner
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

M, F_X, F_Y = 1.8e-7, 3000.0, 3050.0
W_X, W_Y = 2 * pi * F_X, 2 * pi * F_Y
OUTPUTS = tuple(f"{name}_{part}" for name in ("v_x", "v_y", "x", "y") for part in "iq")


def rate_device(q: float, **changes: float) -> dict[str, float]:
    """Parameters of the device with quality factor ``q`` on both axes, a quadrature of 300 deg/s, and ``changes``."""
    quadrature = 2 * M * W_X * np.radians(300.0)
    own = {"m": M, "kxx": M * W_X**2, "kyy": M * W_Y**2, "kxy": quadrature}
    return own | {"dxx": M * W_X / q, "dyy": M * W_Y / q, "dxy": 0.0} | changes


LOSSLESS = rate_device(1e9, kxy=0.0)


def start_at(x: complex, y: complex) -> dict[str, float]:
    """Parameters of a start at these amplitudes [m]."""
    return {"x_start_i": x.real, "x_start_q": x.imag, "y_start_i": y.real, "y_start_q": y.imag}


def matrices(p: Mapping[str, float], rate: float = 0.0) -> tuple[Floats, Floats, Floats]:
    """Mass, damping with the Coriolis coupling at ``rate`` [rad/s], stiffness; TW 201137310, eq. 1."""
    coriolis = 2 * p["m"] * rate * np.array([[0.0, -1.0], [1.0, 0.0]])
    damping = np.array([[p["dxx"], p["dxy"]], [p["dxy"], p["dyy"]]]) + coriolis
    return p["m"] * np.eye(2), damping, np.array([[p["kxx"], p["kxy"]], [p["kxy"], p["kyy"]]])


def answer(p: Mapping[str, float], frequency: float, force: Complexes, rate: float = 0.0) -> Complexes:
    """Amplitudes [m] of x, y under the ``force`` amplitudes [N]: the inverse of the dynamic stiffness."""
    mass, damping, stiffness = matrices(p, rate)
    w = 2 * pi * frequency
    return np.linalg.solve(stiffness - w**2 * mass + 1j * w * damping, force)


def envelopes(
    runner: Runner, p: Mapping[str, float], t: Floats, force: Complexes, frequency: float = F_X, **inputs: float
) -> Complexes:
    """Amplitudes of v_x, v_y [V], x, y [m] by the envelope FMU at ``t`` [s], shape (n, 4), under a held ``force``."""
    given = {"u_x_i": force[0].real, "u_x_q": force[0].imag, "u_y_i": force[1].real, "u_y_q": force[1].imag}
    given |= {"carrier_frequency": frequency} | inputs
    columns = {name: np.full(len(t), value) for name, value in given.items()}
    rows = runner.run(p, t, columns, OUTPUTS)
    return np.array([rows[f"{name}_i"] + 1j * rows[f"{name}_q"] for name in ("v_x", "v_y", "x", "y")]).T


def settled(
    runner: Runner, p: Mapping[str, float], force: Complexes, frequency: float = F_X, **inputs: float
) -> Complexes:
    """The same after 40 time constants of the amplitude, in ten calls. A transient is then below 1e-17."""
    step = p.get("internal_step", 1e-3)
    calls = np.ceil(40 * 2 * M / min(p["dxx"], p["dyy"]) / step / 10)
    return envelopes(runner, p, np.arange(11) * calls * step, force, frequency, **inputs)[-1]


def held(frequency: float, period: float) -> complex:
    """What a hold over ``period`` [s] makes of a sine: its amplitude is shrunk and half a period late."""
    half = pi * frequency * period
    return np.sin(half) / half * np.exp(-1j * half)


def demodulated(
    runner: Runner,
    p: Mapping[str, float],
    start: Complexes,
    force: Complexes,
    frequency: float,
    seconds: float,
    **inputs: float,
) -> Complexes:
    """Amplitudes of v_x, v_y [V] by the full FMU over its last 0.1 s, set off at the amplitudes ``start`` [m]."""
    period = p.get("sample_period", 5e-6)
    t = np.arange(round(seconds / period) + 1) * period
    wave = np.exp(2j * pi * frequency * t)
    u = (force / held(frequency, period))[:, None] * wave
    columns = {"u_x": u[0].real, "u_y": u[1].real} | {name: np.full(len(t), value) for name, value in inputs.items()}
    speed = 2j * pi * frequency * start
    begin = {
        "x_start": start[0].real,
        "y_start": start[1].real,
        "x_dot_start": speed[0].real,
        "y_dot_start": speed[1].real,
    }
    rows = runner.run({**p, **begin}, t, columns, ("v_x", "v_y"))
    # Whole cycles: 0.1 s holds some of every frequency that is a multiple of 10 Hz.
    last = slice(-round(0.1 / period), None)
    return np.array([2 * np.mean(rows[name][last] / wave[last]) for name in ("v_x", "v_y")])
