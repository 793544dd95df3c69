"""The motion that a benchmark of springs that bend is judged by, and what it counts."""

import numpy as np
from scipy.integrate import solve_ivp

from benchmarks.bowed import drawn
from benchmarks.rubbing import Rubbing, motion
from benchmarks.structures import Structure


def test_two_masses_on_a_spring_that_bends_move_as_by_another_integrator() -> None:
    mass, damping = np.diag([0.8, 0.5]), np.diag([1.0, 0.7])
    stiffness = np.array([[5e3, -2e3], [-2e3, 2e3]])
    own = Rubbing(Structure(mass, damping, stiffness, 0, 0), 0.0, 0.0, 1.0, 3e7)
    step, t = 5e-3, np.arange(200) * 5e-3
    u = 20 * np.sin(2 * np.pi * 4 * t)

    def rate(at: float, state: np.ndarray) -> np.ndarray:
        x, v = state[:2], state[2:]
        force = np.array([np.interp(at, t, u) - 3e7 * x[0] ** 3, 0.0])
        return np.concatenate((v, np.linalg.solve(mass, force - stiffness @ x - damping @ v)))

    # A step of the force's line is no longer than a sample.
    x = solve_ivp(rate, (0, t[-1]), np.zeros(4), "DOP853", t, rtol=1e-9, atol=1e-12, max_step=step).y
    found = motion(own, u, step, "first")
    # Dampers act by the speed at the begin of a thousandth of a sample, which is 2e-5 to 5e-5; noise is 1e-3 and more.
    assert np.abs(found[:, 0] - x[0]).max() < 1e-4 * np.abs(x[0]).max()
    assert np.abs(found[:, 1] - x[2]).max() < 1e-4 * np.abs(x[2]).max()
    acceleration = (u - stiffness[0] @ x[:2] - damping[0, 0] * x[2] - 3e7 * x[0] ** 3) / mass[0, 0]
    assert np.abs(found[:, 2] - acceleration).max() < 1e-4 * np.abs(acceleration).max()


def test_springs_bend_as_far_as_they_are_drawn() -> None:
    found = [drawn(np.random.default_rng(seed)) for seed in range(4)]
    assert all(own.k3 > 0 and len(own.structure.mass) in (2, 3) for own in found)
    assert 0 < sum(own.friction > 0 for own in found) < 4
