"""The drives that the diagnosis is tried on are held by nothing."""

from typing import Any

import numpy as np
import pytest

from benchmarks import drives, drives_damped, drives_rubbing, drives_sticking, structures
from benchmarks.drives import band, drawn
from benchmarks.structures import Outcome


@pytest.mark.parametrize("seed", range(5))
def test_a_drive_moves_as_a_whole(seed: int) -> None:
    own = drawn(np.random.default_rng(seed))
    modes = own.modes
    # Rounding of a stiffness of which one mode has none.
    assert modes[0] < 1e-6 * modes[1] and len(modes) in (2, 3)
    assert own.driven == 0 and own.sensed < len(modes)
    # No damper turns it back, and a force at rest meets all of its mass.
    assert (np.linalg.eigvalsh(own.damping) > 0).all()
    np.testing.assert_allclose(own.stiffness @ np.ones(len(modes)), 0, atol=1e-12 * np.abs(own.stiffness).max())
    # The force begins well below the first mode that swings.
    assert 0.5 * band(own)[0] == pytest.approx(0.1 * modes[1])


@pytest.mark.parametrize("seed", range(5))
def test_no_peak_shows_the_load_of_a_motor_that_is_damped_heavily(seed: int) -> None:
    own, alone = drives_damped.drawn(np.random.default_rng(seed))
    held = np.sqrt(own.stiffness[1, 1] / own.mass[1, 1]) / (2 * np.pi)
    assert held == pytest.approx(alone, rel=1e-12)
    inverse = np.linalg.inv(own.mass)
    rates = np.block([[np.zeros((2, 2)), np.eye(2)], [-inverse @ own.stiffness, -inverse @ own.damping]])
    swings = [s for s in np.linalg.eigvals(rates) if s.imag > 0]
    # A quality factor of ten is that of the load alone, whose damping is small.
    assert all(abs(s) / (-2 * s.real) < 10 for s in swings)
    low, high = drives_damped.band(alone)
    assert 0.5 * low == pytest.approx(0.1 * alone) and 1.2 * high == pytest.approx(3 * alone)


@pytest.mark.parametrize(
    ("benchmark", "name"),
    [
        (drives, "drives"),
        (drives_damped, "drives_damped"),
        (drives_rubbing, "drives_rubbing"),
        (drives_sticking, "drives_sticking"),
    ],
)
def test_the_report_is_of_drives(benchmark: Any, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    values = {"refit": 0.9, "final": 3e-3, "over noise": 1.0, "s": 10.0, "s of processor": 10.0}
    outcomes = [Outcome("a", [0.0, 9.0], "missing effects: 1 resonators", True, values)]
    monkeypatch.setattr(structures, "in_processes", lambda f, seeds, jobs: outcomes)
    report = benchmark.make_report([1], 1)
    assert report.name == name and report.tables[0].rows[0].values["share"] == 1
