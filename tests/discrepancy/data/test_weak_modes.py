"""Modes that stand in what others leave, held against the eigenvalues of the structures that made the records."""

from collections.abc import Sequence
from typing import get_args

import numpy as np
import pytest
from hidden_sets import made
from structures import DAMPING, drive
from structures import Structure as Hung

from benchmarks.rubbing import Rubbing, motion
from benchmarks.structures import Structure, chain, drawn, runs, runs_of
from discrepancy.data.absorbers import carried
from discrepancy.data.courses import left_by, may_act, plainly_act
from discrepancy.data.linear_start import linear_start
from discrepancy.data.modes import Mode, further_modes
from discrepancy.data.record import Record, Senses, make_record
from discrepancy.data.rubbed import rubbed
from discrepancy.data.weak_modes import _without_tones, all_modes


def structure(seed: int) -> tuple[Structure, list[Record]]:
    """That of the benchmark, without its held-out run."""
    rng = np.random.default_rng(seed)
    own = drawn(rng)
    senses: Senses = get_args(Senses)[int(rng.integers(3))]
    return own, runs(own, rng, senses, ("zero", "first")[int(rng.integers(2))])[:2]


# A chain of five and one of three whose displacement is measured: in the band of almost all of it are two modes.
@pytest.mark.parametrize("seed", [4613, 4607])
def test_modes_beyond_the_band_of_almost_all_power_are_found_in_what_the_others_leave(seed: int) -> None:
    own, records = structure(seed)
    assert len(further_modes(records)[1]) == 1
    first, further = all_modes(records)
    # Poles of noise of 0.003 of the motion, the weakest a hundredth of that motion.
    np.testing.assert_allclose([mode.frequency for mode in sorted([*first, *further])], own.modes, rtol=3e-3)


# Seeds of which what the friction leaves had hidden the first mode; of one, another is not found either.
@pytest.mark.parametrize(("seed", "friction", "missed"), [(1, 0.2, 1), (3, 0.4, 0), (6, 0.2, 0)])
def test_a_mode_stands_out_around_its_peak_where_the_mass_rubs(seed: int, friction: float, missed: int) -> None:
    rng = np.random.default_rng(seed)
    own = chain(rng, 4)
    rubbing = Rubbing(own, friction, 0.0, 1.0)
    records = runs_of(own.modes, rng, "velocity", "zero", 1e-3, lambda u, step: motion(rubbing, u, step, "zero"))[:2]
    first, further = further_modes(records)
    found = sorted(mode.frequency for mode in (*first, *further))
    # A friction of a fifth of the force and more shifts what a linear model sees.
    np.testing.assert_allclose(found, own.modes[: 4 - missed], rtol=5e-3)


def rubbing(own: Structure, friction: float, senses: Senses, band: Sequence[float]) -> list[Record]:
    """Of what rubs on the ground where it is forced and sensed; no line of the motion is the FMU's."""
    rubs = Rubbing(own, friction, 0.0, 1.0)
    rng = np.random.default_rng(1)
    return runs_of(band, rng, senses, "zero", 1e-3, lambda u, step: motion(rubs, u, step, "zero"))[:2]


def of_poles(own: Structure) -> list[tuple[float, float]]:
    """Frequency [Hz] and quality factor of each mode, lowest first, by the eigenvalues of the damped motion."""
    inverse, n = np.linalg.inv(own.mass), len(own.mass)
    rates = np.block([[np.zeros((n, n)), np.eye(n)], [-inverse @ own.stiffness, -inverse @ own.damping]])
    upper = sorted((s for s in np.linalg.eigvals(rates) if s.imag > 0), key=abs)
    return [(abs(s) / (2 * np.pi), abs(s) / (-2 * s.real)) for s in upper]


@pytest.mark.parametrize("senses", ["position", "velocity", "acceleration"])
def test_a_friction_is_no_damping_of_the_modes_beside_it(senses: Senses) -> None:
    own = chain(np.random.default_rng(2), 3)
    records = rubbing(own, 0.15, senses, own.modes)
    found = sorted([mode for modes in all_modes(records) for mode in modes])
    # Taken for damping it makes quality factors of 77, 138 and 116 ones of 40, 42 and 74.
    for mode, (frequency, quality) in zip(found, of_poles(own), strict=True):
        assert mode.frequency == pytest.approx(frequency, rel=5e-3)
        assert mode.quality == pytest.approx(quality, rel=0.05)
    told = carried(rubbed(records), found, [records[0].reference ** records[0].order])
    assert told is not None
    assert told.friction == pytest.approx(0.15, rel=0.1)


def test_no_friction_is_seen_where_none_is() -> None:
    for seed in (4601, 4602, 4610):
        _, records = structure(seed)
        modes = sorted([mode for own in all_modes(records) for mode in own])
        before = left_by(records, modes)
        assert not may_act(before, rubbed(records), modes)
        assert not plainly_act(before, rubbed(records), modes)


def test_a_place_that_drifts_far_hides_no_mode() -> None:
    between = np.array([[1.0, -1.0], [-1.0, 1.0]])
    own = Structure(np.diag([1.7, 0.4]), 0.2 * between + np.diag([1.5, 0.1]), 1800 * between, 0, 0)
    records = rubbing(own, 0.03, "position", np.array([1.0, of_poles(own)[-1][0]]))
    whole, mode = sorted([mode for modes in all_modes(records) for mode in modes])
    assert not whole.seen
    assert mode.frequency == pytest.approx(of_poles(own)[-1][0], rel=5e-3)


@pytest.mark.parametrize("senses", ["velocity", "acceleration"])
@pytest.mark.parametrize("friction", [0.0, 0.1])
def test_a_shaft_moves_as_a_whole_beside_one_load(senses: Senses, friction: float) -> None:
    between = np.array([[1.0, -1.0], [-1.0, 1.0]])
    own = Structure(np.diag([1.5, 0.5]), 0.3 * between + np.diag([2.4, 0.5]), 5700 * between, 0, 0)
    (frequency, quality) = of_poles(own)[-1]
    records = rubbing(own, friction, senses, np.array([0.1 * frequency, frequency]))
    whole, mode = sorted([mode for modes in all_modes(records) for mode in modes])
    assert not whole.seen
    assert mode.frequency == pytest.approx(frequency, rel=5e-3)
    assert mode.quality == pytest.approx(quality, rel=0.1)


@pytest.mark.parametrize(("friction", "mass"), [(0.15, 1.3), (0.3, 0.5)])
def test_where_displacements_hide_a_mode_their_speeds_show_it(friction: float, mass: float) -> None:
    # A shaft at whose turns a friction leaves its place to add up is where no linear model says.
    between = np.array([[1.0, -1.0], [-1.0, 1.0]])
    own = Structure(np.diag([0.8, mass]), between + np.diag([2.0, 0.3]), 4500 * between, 0, 0)
    (frequency, quality) = of_poles(own)[-1]
    records = rubbing(own, friction, "position", np.array([0.1 * frequency, frequency]))
    whole, mode = sorted([mode for modes in all_modes(records) for mode in modes])
    assert not whole.seen
    assert mode.frequency == pytest.approx(frequency, rel=5e-3)
    assert mode.quality == pytest.approx(quality, rel=0.1)


def test_an_accelerometer_sees_a_structure_on_a_soft_suspension_as_a_whole() -> None:
    stiffness = np.array([[3e4 + 300.0, -3e4, 0], [-3e4, 8e4, -5e4], [0, -5e4, 5e4]])
    hung = Hung(np.array([1.0, 0.8, 1.2]), stiffness, [0], [0])
    own = hung.frequencies(held=[])
    records = [hung.record(name, "fit", seed, 1e-3, accelerations=True) for name, seed in (("a", 1), ("b", 2))]
    first, further = all_modes(records)
    lowest, *above = sorted(mode.frequency for mode in (*first, *further))
    # The force begins at 5 Hz; below, only a mass shows, and no frequency.
    assert own[0] < 5 and lowest < 5
    np.testing.assert_allclose(above, own[1:], rtol=1e-3)


@pytest.mark.parametrize("sensed", [0, 2])
@pytest.mark.parametrize("accelerations", [False, True])
def test_a_drive_that_nothing_holds_moves_as_a_whole(sensed: int, accelerations: bool) -> None:
    own = drive(sensed=sensed)
    records = [own.record(name, "fit", seed, 1e-3, accelerations=accelerations) for name, seed in (("a", 1), ("b", 2))]
    whole, *further = sorted([mode for modes in all_modes(records) for mode in modes])
    np.testing.assert_allclose([mode.frequency for mode in further], own.frequencies(held=[])[1:], rtol=1e-3)
    # A mass with a damper forgets its speed at the rate of damping over mass.
    assert not whole.seen
    assert 2 * np.pi * whole.frequency / whole.quality == pytest.approx(DAMPING, rel=0.1)


def test_the_first_mode_is_that_of_the_model_with_all() -> None:
    # One of two modes at 80.8 and 102 Hz: a model of one mode has its own at 81.9.
    own, records = structure(4614)
    first, further = further_modes(records)
    np.testing.assert_allclose([mode.frequency for mode in sorted([*first, *further])], own.modes, rtol=5e-4)


@pytest.mark.parametrize(
    "hidden", [{}, {"angular_gain": 0.6}, {"k3_x": 2e9, "k3_y": 2e9}, {"actuator_delay": 5e-6}, {"feedthrough": 8.0}]
)
def test_no_effect_on_two_modes_leaves_another(hidden: dict[str, float]) -> None:
    assert all_modes(made(hidden, samples=8000).fit)[1] == []


def test_a_mass_that_others_hang_on_is_no_mass_without_a_spring() -> None:
    own, records = structure(4611)
    found = linear_start(records, (records[0].reference ** records[0].order,))
    assert found is not None
    assert np.sqrt(found["kxx"] / found["m"]) / (2 * np.pi) == pytest.approx(own.modes[0], rel=1e-3)


@pytest.mark.parametrize(
    ("mode", "whole", "stays"),
    # In ten seconds: three periods; one that lasts; a load; and a slow mode of what a spring holds.
    [((0.3, 20.0), True, False), ((2.0, 1e4), True, False), ((16.0, 25.0), True, True), ((0.3, 20.0), False, True)],
)
def test_tones_of_a_reference_are_no_modes_beside_a_motion_as_a_whole(
    mode: tuple[float, float], whole: bool, stays: bool
) -> None:
    t = np.arange(1000) / 100
    record = make_record("a", t, np.cos(t)[:, None], np.sin(t)[:, None], sample_rate=100.0)
    modes = [*([Mode(1e-3, 1e-3, seen=False)] if whole else []), Mode(*mode, seen=True)]
    assert (modes[-1] in _without_tones([record], modes)) == stays
