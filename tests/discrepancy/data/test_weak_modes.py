"""Modes that stand in what others leave, held against the eigenvalues of the structures that made the records."""

from typing import get_args

import numpy as np
import pytest
from hidden_sets import made

from benchmarks.structures import Structure, drawn, runs
from discrepancy.data.linear_start import linear_start
from discrepancy.data.modes import further_modes
from discrepancy.data.record import Record, Senses
from discrepancy.data.weak_modes import all_modes


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
