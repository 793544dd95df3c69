"""What no step of a fit goes beyond, by hand."""

from math import pi, sqrt

import pytest

from discrepancy.fit.passive import CROSS, passive
from discrepancy.name.more_modes import copies, with_copies
from gyro_model.model import load_model

MODEL = load_model()
LONG = 1e12
"""Duration [s] over which nothing may run away."""
ONE_AXIS = {"m": 2.0, "kxx": 10.0, "dxx": 0.1}
TWO_AXES = {**ONE_AXIS, "kyy": 40.0, "dyy": 0.4, "kxy": 0.0, "dxy": 0.0}


def mode(coupling: float, frequency: float, suffix: str = "") -> dict[str, float]:
    return {f"parasitic_coupling{suffix}": coupling, f"parasitic_frequency{suffix}": frequency}


def test_what_swings_does_not_push_the_mass_away_at_rest() -> None:
    # Coupled by 8 N/m to 2 kg at 1 rad/s: 64/2 N/m are taken from the spring. Half a N/m less than none: 2 kg with
    # 0.1 N s/m then run away as exp(0.475 t), by hand: 2 s² + 0.1 s = 0.5. Over 1/0.475 s that is e.
    rate = (-0.1 + sqrt(0.1**2 + 4 * 2 * 0.5)) / 4
    held = passive({**ONE_AXIS, **mode(8.0, 1 / (2 * pi))}, 1, MODEL, 1 / rate)
    assert held["kxx"] == pytest.approx(31.5, rel=1e-12)
    assert {name: held[name] for name in ("m", "dxx")} == {"m": 2.0, "dxx": 0.1}


def test_a_spring_that_is_strong_enough_stays_as_it_is() -> None:
    given = {**ONE_AXIS, **mode(4.0, 1 / (2 * pi))}
    assert passive(given, 1, MODEL, LONG) == given
    assert passive(ONE_AXIS, 1, MODEL, LONG) == ONE_AXIS


def test_all_that_swings_counts_on_its_axis() -> None:
    model = with_copies(MODEL, copies(MODEL, 2, 2))
    given = {**TWO_AXES, **mode(4.0, 1 / (2 * pi)), **mode(4.0, 1 / (2 * pi), "_2"), **mode(10.0, 1 / (2 * pi), "_y")}
    held = passive(given, 2, model, LONG)
    assert held["kxx"] == pytest.approx(16.0, rel=1e-9)
    assert held["kyy"] == pytest.approx(50.0, rel=1e-9)


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_cross_terms_are_those_of_a_passive_device(sign: float) -> None:
    held = passive({**TWO_AXES, "kxy": sign * 30.0, "dxy": sign * 0.1}, 2, MODEL, LONG)
    assert held["kxy"] == pytest.approx(sign * CROSS * 20.0, rel=1e-12)
    assert held["dxy"] == sign * 0.1
