"""A mass without a spring: what moves and resists it, by integrals alone; the motion by a simulation of its own."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.ndimage import uniform_filter1d
from scipy.signal import lfilter

from discrepancy.data.checks import excitation
from discrepancy.data.dataset import Dataset
from discrepancy.data.excitation import cramer_rao_bounds
from discrepancy.data.linear_start import linear_start
from discrepancy.data.record import Record, make_record
from discrepancy.data.resisted import Resisted, alternatives, fewest, moves_alone, one_way

RATE, SAMPLES, FINE = 1000.0, 10_000, 20
MASS, DAMPING = 1.4e-4, 1.4e-4


def motor(force: Callable[[float], float], friction: float = 0.0, constant: float = 0.0, senses: str = "position"
          ) -> Record:  # fmt: skip
    """An inertia on an encoder, or a tachometer, turned by ``force`` of time, which is held between samples."""
    return turned(lambda t, x, v: force(t), friction, constant, senses)


def turned(force: Callable[[float, float, float], float], friction: float, constant: float, senses: str = "position"
           ) -> Record:  # fmt: skip
    """The same by a force of time, place and speed."""
    x, v = 0.0, 0.0
    seen, u = np.empty(SAMPLES), np.empty(SAMPLES)
    for k in range(SAMPLES):
        seen[k], u[k] = x if senses == "position" else v, force(k / RATE, x, v)
        for _ in range(FINE):
            f = u[k] + constant - DAMPING * v
            if v == 0 and abs(f) <= friction:
                continue
            after = v + (f - friction * np.sign(v or f)) / MASS / RATE / FINE
            after = 0.0 if v * after < 0 else after
            x, v = x + 0.5 * (v + after) / RATE / FINE, after
    seen = 6e-4 * np.round(seen / 6e-4)
    return make_record("motor", np.arange(SAMPLES) / RATE, u[:, None], seen[:, None], sample_rate=RATE, senses=senses)


def resisted(runs: list[Record], gain: float) -> Resisted | None:
    """What resists by the fewest forces."""
    return fewest(alternatives(runs, gain))


def stairs(t: float) -> float:
    return 0.05 if t < 4 else 0.07


def back_and_forth(t: float) -> float:
    return 0.05 * float(np.sin(2 * np.pi * 0.3 * t)) + 0.03 * float(np.sin(2 * np.pi * 0.77 * t))


def with_rests(t: float) -> float:
    """Strokes there and back, between which the force is less than what holds the mass."""
    phase = t % 2.5
    return 0.05 * float(np.sign(np.sin(0.8 * np.pi * t))) if phase % 1.25 < 0.3 else 0.02


@pytest.mark.parametrize(
    ("force", "friction", "constant", "room"),
    [(stairs, 0.0, 0.0, 1e-3), (stairs, 0.03, 0.0, 0.05), (back_and_forth, 0.0, 0.004, 1e-2),
     (back_and_forth, 0.012, 0.004, 0.2)],
    ids=["free", "one way", "weight", "both"],
)  # fmt: skip
def test_what_resists_is_found_where_it_plainly_shows(
    force: Callable[[float], float], friction: float, constant: float, room: float
) -> None:
    found = resisted([motor(force, friction, constant)], 1.0)
    assert found is not None
    # Values to start from: where it sets out and turns round its speed is smoothed over a hundredth of the run.
    assert found.m == pytest.approx(MASS, rel=room)
    assert found.d == pytest.approx(DAMPING, rel=room)
    if force is stairs:
        # One way friction is a constant force against it, and no sample tells which.
        assert found.friction - found.constant == pytest.approx(friction, abs=room * 0.03)
    else:
        assert (found.friction, found.constant) == pytest.approx((friction, constant), rel=room, abs=1e-5)


def test_a_friction_of_most_of_the_force_does_not_lead_the_start_astray() -> None:
    # By windows of a part of the run m came out 0.7 times, and d three times as large.
    nominal = linear_start([motor(stairs, 0.03)], (1.0,))
    assert nominal is not None
    assert nominal["m"] == pytest.approx(MASS, rel=0.05)
    assert nominal["dxx"] == pytest.approx(DAMPING, rel=0.05)


@pytest.mark.parametrize("senses", ["position", "velocity"])
def test_while_friction_holds_a_mass_no_force_moves_it(senses: str) -> None:
    run = motor(with_rests, 0.03, senses=senses)
    found = resisted([run], run.reference**run.order)
    assert found is not None
    # With the force of the rests among what moves it the mass was 1.6 times as large at best, beside a constant force.
    assert found.m == pytest.approx(MASS, rel=0.1)
    # Where it stops and sets out the speed is smoothed over a hundredth of the run.
    assert found.friction == pytest.approx(0.03, rel=0.3)
    assert abs(found.constant) < 0.1 * found.friction


def test_an_inertia_is_found_where_its_bearings_rub_more_in_one_run_than_in_another() -> None:
    shares = (0.9, 1.0, 1.1, 0.95, 1.08)
    runs = [motor(stairs if i % 2 else lambda t: -stairs(t), 0.02 * own, -0.004) for i, own in enumerate(shares)]
    *_, both = alternatives(runs, 1.0)
    assert both.m == pytest.approx(MASS, rel=0.2)
    assert both.d == pytest.approx(DAMPING, rel=0.2)
    assert (both.friction, both.constant) == pytest.approx((0.02, -0.004), rel=0.2)


def test_runs_that_go_either_way_tell_friction_from_a_constant_force() -> None:
    there, back = motor(stairs, 0.02), motor(lambda t: -stairs(t), 0.02)
    assert one_way([there]) and one_way([back]) and not one_way([there, back])


def test_the_mean_speed_of_a_mass_that_nothing_holds_is_its_own() -> None:
    one_way = motor(stairs, 0.03, senses="velocity")
    assert one_way.v.mean() > one_way.v.std() > 0
    # A spring that holds it makes an offset of the sensor of all that is steady.
    t = np.arange(SAMPLES) / RATE
    u = np.random.default_rng(3).standard_normal(SAMPLES)
    held = lfilter([0.0, 1.0, -1.0], [1.0, -1.9, 0.99], u)
    record = make_record("held", t, u, held + 5 * held.std(), sample_rate=RATE, senses="velocity")
    assert abs(record.v.mean()) < 0.1 * record.v.std()


def test_other_sensors_and_decays_are_left_to_others() -> None:
    own = motor(stairs)
    for other in (replace(own, senses="acceleration"), replace(own, u=0 * own.u)):
        assert resisted([other], 1.0) is None


def test_a_spring_that_is_none_need_not_be_known() -> None:
    own = motor(stairs, 0.03)
    nominal = linear_start([own], (1.0,))
    assert nominal is not None
    # Known to no more than a few times of next to nothing, it was refused as too poor an excitation.
    nominal = {**nominal, "kxx": 1e-3 * nominal["kxx"]}
    assert cramer_rao_bounds((own,), nominal)["kxx"] > 0.5
    assert not [finding for finding in excitation(Dataset(Path(), nominal, (own,))) if "kxx" in finding.message]


def test_a_damping_that_is_none_need_not_be_known() -> None:
    own = motor(with_rests, 0.03)
    nominal = {"m": MASS, "kxx": 1e-3 * MASS, "dxx": 1e-9, "sense_gain_x": 1.0}
    assert cramer_rao_bounds((own,), nominal)["dxx"] > 0.5
    assert not [finding for finding in excitation(Dataset(Path(), nominal, (own,))) if "dxx" in finding.message]


def test_an_axis_in_its_loop_moves_by_what_resists_it_alone() -> None:
    """The force follows the tones of a reference, which a linear model takes for modes."""

    def follows(t: float, x: float, v: float) -> float:
        wanted = 2.0 * np.sin(2 * np.pi * 0.3 * t) + 0.5 * np.sin(2 * np.pi * 0.77 * t)
        return float(0.02 * (wanted - x) - 2e-3 * v)

    record = turned(follows, 0.012, -0.004)
    assert moves_alone(alternatives([record], 1.0))
    assert not moves_alone(alternatives([motor(back_and_forth)], 1.0))
    data = Dataset(Path(), {"m": MASS, "kxx": 1e-9, "dxx": DAMPING, "sense_gain_x": 1.0},
                   (record, replace(record, role="held-out")))  # fmt: skip
    assert data.modes == ([], [])


def test_a_mass_that_turns_round_as_a_run_begins_has_a_speed() -> None:
    """At rest for a sample, as far as its smoothed speed shows, is not at rest."""
    t = np.arange(SAMPLES) / RATE
    runs = []
    for seed in range(2):
        phase = np.random.default_rng(seed).uniform(0, 2 * np.pi, 30)
        w = 2 * np.pi * np.linspace(1.5, 40, 30)
        u = np.sin(w * t[:, None] + phase).sum(axis=1)
        x = -(np.sin(w * t[:, None] + phase) / w**2).sum(axis=1) / MASS
        first, own = (np.gradient(uniform_filter1d(way, 101, mode="nearest"))[0] for way in (x, t))
        turning = (x - first / own * t)[:, None]
        runs.append(make_record(f"{seed}", t, u[:, None], turning, sample_rate=RATE, hold="band-limited"))
    found = resisted(runs, 1.0)
    assert found is not None
    assert found.m == pytest.approx(MASS, rel=0.01)
