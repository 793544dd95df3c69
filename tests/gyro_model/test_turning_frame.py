"""Coriolis, centrifugal and Euler force together are nothing but a turning frame: a free mass moves straight."""

from collections.abc import Callable

import numpy as np
from gyro_runner import Floats, Runner

Residual = Callable[[str, float, float], None]

PERIOD = 5e-6
N = 401
T = np.arange(N) * PERIOD
# Springs so weak that k t²/2m = 1e-14 of the displacement at the end: a free mass.
FREE = {"kxx": 1e-15, "kyy": 1e-15, "kxy": 0.0, "dxx": 0.0, "dyy": 0.0, "dxy": 0.0, "frame_rotation": 1.0}
P0, V0 = np.array([1e-6, -0.5e-6]), np.array([-2e-3, 3e-3])
# Rates of 2000 rad/s rms, new every 10 samples, in which the body turns by 0.1 rad.
OMEGA = np.repeat(2000.0 * np.random.default_rng(41).standard_normal(41), 10)[:N]


def start(omega: float) -> dict[str, float]:
    """The start of the straight motion P0 + V0 t in the body's frame: q' = v - Ω×q."""
    velocity = {"x_dot_start": V0[0] + omega * P0[1], "y_dot_start": V0[1] - omega * P0[0]}
    return {"x_start": P0[0], "y_start": P0[1], **velocity}


def seen_from_the_body(t: Floats, omega: Floats) -> Floats:
    """The straight motion, turned back by the angle that the body has turned; shape (n, 2)."""
    angle = np.concatenate(([0.0], np.cumsum(omega[:-1] * np.diff(t))))
    straight = P0 + V0 * t[:, None]
    c, s = np.cos(angle), np.sin(angle)
    return np.stack([c * straight[:, 0] + s * straight[:, 1], -s * straight[:, 0] + c * straight[:, 1]], axis=1)


def test_a_free_mass_moves_straight_in_space(plant: Runner, residual: Residual) -> None:
    out = plant.run(FREE | start(OMEGA[0]), T, {"omega_z": OMEGA})
    wanted = seen_from_the_body(T, OMEGA)
    scale = np.max(np.abs(wanted))
    # The springs 1e-14; 2000 internal steps that round 1e-16 of it and of the velocity jumps, 2000 rad/s · 2 ms = 4.
    residual("x", np.max(np.abs(out["x"] - wanted[:, 0])) / scale, 2e-13)
    residual("y", np.max(np.abs(out["y"] - wanted[:, 1])) / scale, 2e-13)


def test_each_of_the_forces_is_needed(plant: Runner) -> None:
    wanted = seen_from_the_body(T, OMEGA)
    for missing in ({"frame_rotation": 0.0}, {"frame_rotation": 0.99}, {"angular_gain": 0.99}):
        out = plant.run(FREE | start(OMEGA[0]) | missing, T, {"omega_z": OMEGA})
        assert np.max(np.abs(out["x"] - wanted[:, 0])) > 1e-3 * np.max(np.abs(wanted)), missing


def test_a_rate_set_before_the_first_step_is_no_change(plant: Runner) -> None:
    # Initialised at rest; the importer gives the rate with its first step.
    slave = plant._started(FREE | start(700.0), {})
    reference = {name: plant.variables[name].valueReference for name in ("omega_z", "x", "y")}
    try:
        slave.setFloat64([reference["omega_z"]], [700.0])
        step = plant._step(slave)
        for k in range(100):
            assert step(k * PERIOD, PERIOD) == 0
        found = slave.getFloat64([reference["x"], reference["y"]])
    finally:
        slave.freeInstance()
    wanted = seen_from_the_body(T[:101], np.full(101, 700.0))[-1]
    # As above.
    assert np.max(np.abs(found - wanted)) <= 2e-13 * np.max(np.abs(P0))


def test_a_change_acts_once_however_long_the_steps(plant: Runner) -> None:
    fine = np.arange(2001) * 1e-6
    omega = np.where(np.arange(2001) < 1000, 300.0, -800.0)
    short = plant.run(FREE | start(300.0), fine, {"omega_z": omega})
    long = plant.run(FREE | start(300.0), fine[::50], {"omega_z": omega[::50]})
    for name in short:
        assert np.array_equal(short[name][::50], long[name]), name
