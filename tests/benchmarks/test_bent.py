"""The spring that bends is what it says, by another integrator; what is chaotic is so."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from benchmarks import bent
from benchmarks.bent import Bent, drawn, motion, runs


@pytest.mark.parametrize("hold", ["zero", "first"])
def test_the_motion_is_that_of_another_integrator(hold):
    own, step = Bent(0.7, 0.3, 40.0, 25.0, 0.2), 0.02
    u = 300 * np.random.default_rng(1).standard_normal(60)
    found, z = motion(own, u, step, hold), np.zeros(2)
    for i in range(len(u) - 1):
        rise = (u[i + 1] - u[i]) / step if hold == "first" else 0.0

        def rates(t, z, force=u[i], rise=rise):
            x, v = z
            return [v, (force + rise * t - (own.d + own.d2 * x**2) * v - own.k * x - own.k3 * x**3) / own.m]

        z = solve_ivp(rates, (0, step), z, method="DOP853", rtol=1e-12, atol=1e-14).y[:, -1]
        # Before a held force changes.
        shown = z[0], z[1], rates(step, z)[1]
        # Some 1e-12 a step of either, grown by a motion that is hardly damped.
        assert (np.abs(found[i + 1] - shown) < 1e-9 * np.abs(found).max(axis=0)).all()
    # The cube is most of the force of the spring.
    assert own.k3 * np.abs(found[:, 0]).max() ** 2 > own.k


def test_what_hardly_bends_is_regular_and_the_change_of_a_place_fades():
    rng = np.random.default_rng(2)
    own, f = drawn(rng)
    _, grown = runs(own._replace(k3=0.0, d2=0.0), f, rng, "position", "zero", 1e-3)
    assert grown <= 1.0


def test_a_spring_that_is_mostly_cube_is_chaotic():
    _, grown = runs(Bent(1.0, 0.628, 158.0, 7.2e6, 0.0), 2.0, np.random.default_rng(7), "position", "zero", 1e-3)
    assert grown > bent.CHAOTIC
