"""The course of a friction as sensors show it, against the friction of motions that no line of the FMU made."""

from typing import get_args

import numpy as np
import pytest

from benchmarks.drives import band, drawn
from benchmarks.rubbing import Rubbing, motion
from benchmarks.structures import PER_PERIOD, SAMPLES, Structure
from discrepancy.data.record import Record, Senses, make_record
from discrepancy.data.rubbed import rubbed
from discrepancy.data.weak_modes import all_modes

NOISE = 3e-3


def shaft(friction: float, senses: Senses) -> tuple[Structure, list[Record], list[np.ndarray]]:
    """Of a shaft that rubs and carries a mass on a mass: two runs, and the signs of its speed."""
    own = drawn(np.random.default_rng(5644))._replace(sensed=0)
    rng, modes = np.random.default_rng(1), band(own)
    rate, records, signs = PER_PERIOD * float(modes[-1]), [], []
    t, f = np.arange(SAMPLES) / rate, np.arange(1, SAMPLES // 2) * rate / SAMPLES
    lines = f[(f > 0.5 * modes[0]) & (f < 1.2 * modes[-1])]
    for name in ("a", "b"):
        u = np.cos(2 * np.pi * np.outer(t, lines) + rng.uniform(0, 2 * np.pi, len(lines))).sum(axis=1)
        moved = motion(Rubbing(own, friction, 0.0, 1.0), u / u.std(), 1 / rate, "zero")
        v = moved[:, get_args(Senses).index(senses)]
        v = v + NOISE * v.std() * rng.standard_normal(len(v))
        records.append(make_record(name, t, (u / u.std())[:, None], v[:, None], sample_rate=rate, senses=senses))
        signs.append(np.sign(moved[:, 1]))
    return own, records, signs


# Without the noise taken off their speeds 0.90 of displacements.
@pytest.mark.parametrize(("senses", "least"), [("position", 0.97), ("velocity", 0.98), ("acceleration", 0.9)])
def test_the_course_of_a_friction_is_seen_through_noise(senses: Senses, least: float) -> None:
    _, records, signs = shaft(0.1, senses)
    for record, way in zip(rubbed(records), signs, strict=True):
        assert record.rubs is not None
        assert np.corrcoef(-record.rubs[:, 0], way)[0, 1] > least


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
