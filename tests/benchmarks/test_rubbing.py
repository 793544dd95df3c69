"""The masses that rub are what they say: by Coulomb's textbook decay, and by an integrator while they slide one way."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from benchmarks import rubbing
from benchmarks.rubbing import Rubbing, drawn, make_report, motion
from benchmarks.structures import Outcome, Structure


def one(m: float, k: float, d: float, friction: float) -> Rubbing:
    return Rubbing(Structure(*(np.array([[value]]) for value in (m, d, k)), 0, 0), friction, 0.0, 1.0)


def test_a_free_decay_loses_four_f_over_k_a_period_and_ends_at_rest():
    own = one(2.0, 200.0, 0.0, 0.5)
    period = 2 * np.pi / np.sqrt(200.0 / 2.0)
    x = motion(own, np.zeros(800), period / 100, "zero", np.array([[0.0331], [0.0]]))[:, 0]
    # 2 * 0.5/200 each half period, as far as the spring overcomes the friction: 0.0331, -0.0281, ..., 0.0031, -0.0019.
    for half in range(1, 8):
        turned = (-1) ** half * (0.0331 - half * 0.005)
        # A step is 1e-5 of a period; the parabola about a turn makes nothing of it.
        assert x[50 * half] == pytest.approx(turned, rel=1e-3)
    assert (x[360:] == x[360]).all()
    assert abs(x[-1]) <= 0.5 / 200


def test_less_than_the_friction_moves_nothing():
    assert not motion(one(1.0, 50.0, 1.0, 0.5), np.full(50, 0.49), 1e-2, "zero")[:, :2].any()


@pytest.mark.parametrize("hold", ["zero", "first"])
def test_while_it_slides_one_way_it_is_a_constant_force(hold):
    own = drawn(np.random.default_rng(3))._replace(excess=0.0)
    structure, n = own.structure, len(own.structure.mass)
    step = 1 / (24 * structure.modes[-1])
    u = 20 * own.friction * (1 + np.arange(5) / 10)
    found, z = motion(own, u, step, hold), np.zeros(2 * n)
    for i in range(len(u) - 1):
        rise = (u[i + 1] - u[i]) / step if hold == "first" else 0.0

        def rates(t, z, force=u[i], rise=rise):
            pushed = np.zeros(n)
            pushed[0] = force + rise * t - own.friction
            return [*z[n:], *np.linalg.solve(structure.mass, pushed - structure.stiffness @ z[:n]
                                             - structure.damping @ z[n:])]  # fmt: skip

        z = solve_ivp(rates, (0, step), z, method="DOP853", rtol=1e-11, atol=1e-16).y[:, -1]
        shown = z[0], z[n], rates(step, z)[n]
        # Steps of a thousandth of a sample, of first order: the acceleration is that of the middle of the last one. Of
        # eight drawn chains 7e-6 of the motion and 1.04e-4 of the acceleration were the most.
        assert (np.abs(found[i + 1] - shown) < [2e-5, 2e-5, 2e-4] * np.abs(found).max(axis=0)).all()
    assert (found[1:, 1] > 0).all()


def test_shares_are_of_all(monkeypatch):
    monkeypatch.setattr(rubbing, "in_processes", lambda f, seeds, jobs: [
        Outcome("one", [], "missing effects: dry_friction", True, {"over noise": 1.0}),
        Outcome("other", [], "unexplained: ", False, {"over noise": 8.0}),
    ])  # fmt: skip
    rows = make_report([1, 2], 1).tables[0].rows
    assert [row.values["share"] for row in rows] == [0.5, 0.5]
