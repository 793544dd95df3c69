"""The structures that the diagnosis is tried on are what they say."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from benchmarks import structures
from benchmarks.structures import Outcome, drawn, make_report, motion
from discrepancy.data.linear_start import linear_start


@pytest.mark.parametrize("hold", ["zero", "first"])
def test_the_motion_is_that_of_masses_springs_and_dampers(hold):
    own = drawn(np.random.default_rng(5))
    n, step = len(own.mass), 1 / (24 * own.modes[-1])
    u = np.random.default_rng(6).standard_normal(40)
    found, z = motion(own, u, step, hold), np.zeros(2 * n)
    for i in range(len(u) - 1):
        rise = (u[i + 1] - u[i]) / step if hold == "first" else 0.0

        def rates(t, z, force=u[i], rise=rise):
            pushed = np.zeros(n)
            pushed[own.driven] = force + rise * t
            return [*z[n:], *np.linalg.solve(own.mass, pushed - own.stiffness @ z[:n] - own.damping @ z[n:])]

        z = solve_ivp(rates, (0, step), z, method="DOP853", rtol=1e-11, atol=1e-16).y[:, -1]
        shown = z[own.sensed], z[n + own.sensed], rates(step, z)[n + own.sensed]
        # DOP853 keeps 1e-11 of a step.
        assert (np.abs(found[i + 1] - shown) < 1e-8 * np.abs(found).max(axis=0)).all()


def test_a_structure_that_no_single_mode_explains_has_a_mass_all_the_same(monkeypatch):
    rng = np.random.default_rng(4502)
    own = drawn(rng)
    records = structures.runs(own, rng, "acceleration", "first")[:2]
    gains = (records[0].reference ** records[0].order,)
    found = linear_start(records, gains)
    assert found["m"] > 0
    # Held at the frequency of the first mode, known to a hundredth of its width.
    assert np.sqrt(found["kxx"] / found["m"]) / (2 * np.pi) == pytest.approx(own.modes[0], rel=1e-3)
    monkeypatch.setattr("discrepancy.data.linear_start.answering", lambda records: [])
    assert linear_start(records, gains) is None


def test_what_is_not_named_is_shown_beside_what_is(monkeypatch):
    values = {"refit": 0.9, "final": 3e-3, "over noise": 1.0, "s": 10.0, "s of processor": 10.0}
    monkeypatch.setattr(structures, "in_processes", lambda f, seeds, jobs: [
        Outcome("a", [3.0, 9.0], "missing effects: 1 resonators", True, values),
        Outcome("b", [3.0, 9.0], "no linear start", False, {}),
    ])  # fmt: skip
    shares, _, each = make_report([1, 2], 1).tables
    assert [row.values["share"] for row in shares.rows] == [0.5, 0.5]
    assert each.rows[1].note.endswith("no linear start")
