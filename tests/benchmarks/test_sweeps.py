"""The mass that is swept moves as another integrator says, and its shares are of all and of each kind."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from benchmarks.sweeps import PARTS, Swept, drawn, motion, runs


def test_the_motion_is_that_of_another_integrator():
    own, step = Swept(0.7, 0.3, 40.0, 25.0, 0.4, 0.05), 2e-3
    u = 3 * np.random.default_rng(1).standard_normal(40)
    found = motion(own, np.repeat(u, PARTS), np.append(u[:1], u[:-1]), step / PARTS)
    z = np.zeros(2)
    for i in range(len(u) - 1):

        def rates(t, z, force=u[i]):
            x, v = z
            rubs = own.friction * np.tanh(v / own.speed)
            return [v, (force - own.d * v - own.k * x - own.k3 * x**3 - rubs) / own.m]

        z = solve_ivp(rates, (0, step), z, method="DOP853", rtol=1e-12, atol=1e-14).y[:, -1]
        # The midpoint rule leaves 6e-7, of second order in steps of a thousandth of what the friction turns within.
        assert (np.abs(found[i + 1] - (*z, rates(0, z)[1])) < 2e-6 * np.abs(found).max(axis=0)).all()


def test_what_is_drawn_rubs_and_half_of_it_bends():
    own = [drawn(np.random.default_rng(seed))[0] for seed in range(200)]
    assert all(0.03 <= each.friction <= 0.3 for each in own)
    # 200 throws of a coin: within 5 deviations.
    assert 64 < sum(each.k3 > 0 for each in own) < 136


@pytest.mark.parametrize("senses", ["position", "velocity", "acceleration"])
def test_runs_pass_the_resonance_and_say_nothing_of_the_hold(senses):
    own, rate = Swept(1.0, 0.3, 40.0, 0.0, 0.05, 1e-4), 80.0
    records = runs(own, rate, np.random.default_rng(1), senses, "first", 1e-3)
    assert [record.role for record in records] == ["fit", "fit", "held-out"]
    assert {record.hold for record in records} == {"zero"}
    moved = np.abs(records[0].v[:, 0])
    assert moved[2000:10_000].max() > 2 * max(moved[:200].max(), moved[-200:].max())
