"""The course of a friction as sensors show it, against the friction of motions that no line of the FMU made."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.drives import band, drawn
from benchmarks.rubbing import Rubbing, motion
from benchmarks.structures import NOISE, Structure, runs_of
from discrepancy.data.record import Floats, Record, Senses, make_record
from discrepancy.data.rubbed import rubbed
from discrepancy.data.weak_modes import all_modes


def shaft(friction: float, senses: Senses) -> tuple[Structure, list[Record], list[np.ndarray]]:
    """Of a shaft that rubs and carries a mass on a mass: two runs, and the signs of its speed."""
    own, signs = drawn(np.random.default_rng(5644))._replace(sensed=0), list[np.ndarray]()

    def moved(u: Floats, step: float) -> Floats:
        found = motion(Rubbing(own, friction, 0.0, 1.0), u, step, "zero")
        signs.append(np.sign(found[:, 1]))
        return found

    records = runs_of(band(own), np.random.default_rng(1), senses, "zero", NOISE, moved)
    return own, records[:2], signs[:2]


# Displacements reach 0.986 and 0.988, 0.916 and 0.969 with the noise of their speeds; accelerations 0.971 and 0.959.
@pytest.mark.parametrize(("senses", "least"), [("position", 0.98), ("velocity", 0.98), ("acceleration", 0.95)])
def test_the_course_of_a_friction_is_seen_through_noise(senses: Senses, least: float) -> None:
    _, records, signs = shaft(0.1, senses)
    for record, way in zip(rubbed(records), signs, strict=True):
        assert np.corrcoef(-record.courses["friction"][:, 0], way)[0, 1] > least


def test_a_shaft_that_turns_one_way_is_not_at_rest() -> None:
    t = np.arange(4000) / 1000.0
    speed = (1 + 0.9 * np.sin(2 * np.pi * 60.0 * t) + 1e-3 * np.random.default_rng(1).standard_normal(len(t)))[:, None]
    record = replace(make_record("run", t, speed, speed, senses="velocity"), v=speed, centred=False)
    [found] = rubbed([record])
    assert (found.courses["friction"] < 0).all()


def test_the_way_of_a_shaft_hides_no_load_that_answers_quickly() -> None:
    own, records, _ = shaft(0.1, "position")
    whole, *loads = sorted([mode for modes in all_modes(records) for mode in modes])
    assert not whole.seen
    np.testing.assert_allclose([mode.frequency for mode in loads], own.modes[1:], rtol=5e-3)


def test_a_shaft_without_friction_shows_no_more_than_its_loads() -> None:
    own, records, _ = shaft(0.0, "position")
    whole, *loads = sorted([mode for modes in all_modes(records) for mode in modes])
    assert loads and not whole.seen
    # That of the second is hidden in noise of the speeds.
    assert all(np.abs(own.modes / mode.frequency - 1).min() < 1e-3 for mode in loads)
