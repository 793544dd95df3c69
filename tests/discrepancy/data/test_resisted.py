"""A mass without a spring: what moves and resists it, by integrals alone; the motion by a simulation of its own."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from discrepancy.data.checks import excitation
from discrepancy.data.dataset import Dataset
from discrepancy.data.excitation import cramer_rao_bounds
from discrepancy.data.linear_start import linear_start
from discrepancy.data.record import Record, make_record
from discrepancy.data.resisted import resisted

RATE, SAMPLES, FINE = 1000.0, 10_000, 20
MASS, DAMPING = 1.4e-4, 1.4e-4


def motor(force: Callable[[float], float], friction: float = 0.0, constant: float = 0.0) -> Record:
    """An inertia on an encoder, turned by ``force`` of time, which is held between samples."""
    x, v = 0.0, 0.0
    seen, u = np.empty(SAMPLES), np.array([force(k / RATE) for k in range(SAMPLES)])
    for k in range(SAMPLES):
        seen[k] = x
        for _ in range(FINE):
            f = u[k] + constant - DAMPING * v
            if v == 0 and abs(f) <= friction:
                continue
            after = v + (f - friction * np.sign(v or f)) / MASS / RATE / FINE
            after = 0.0 if v * after < 0 else after
            x, v = x + 0.5 * (v + after) / RATE / FINE, after
    seen = 6e-4 * np.round(seen / 6e-4)
    return make_record("motor", np.arange(SAMPLES) / RATE, u[:, None], seen[:, None], sample_rate=RATE)


def stairs(t: float) -> float:
    return 0.05 if t < 4 else 0.07


def back_and_forth(t: float) -> float:
    return 0.05 * float(np.sin(2 * np.pi * 0.3 * t)) + 0.03 * float(np.sin(2 * np.pi * 0.77 * t))


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


def test_other_sensors_and_decays_are_left_to_others() -> None:
    own = motor(stairs)
    for other in (replace(own, senses="velocity"), replace(own, u=0 * own.u)):
        assert resisted([other], 1.0) is None


def test_a_spring_that_is_none_need_not_be_known() -> None:
    own = motor(stairs, 0.03)
    nominal = linear_start([own], (1.0,))
    assert nominal is not None
    # Known to no more than a few times of next to nothing, it was refused as too poor an excitation.
    nominal = {**nominal, "kxx": 1e-3 * nominal["kxx"]}
    assert cramer_rao_bounds((own,), nominal)["kxx"] > 0.5
    assert not [finding for finding in excitation(Dataset(Path(), nominal, (own,))) if "kxx" in finding.message]
