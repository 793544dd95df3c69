"""The drives that the diagnosis is tried on are held by nothing."""

import numpy as np
import pytest

from benchmarks import structures
from benchmarks.drives import band, drawn, make_report
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


def test_the_report_is_of_drives(monkeypatch: pytest.MonkeyPatch) -> None:
    values = {"refit": 0.9, "final": 3e-3, "over noise": 1.0, "s": 10.0, "s of processor": 10.0}
    outcomes = [Outcome("a", [0.0, 9.0], "missing effects: 1 resonators", True, values)]
    monkeypatch.setattr(structures, "in_processes", lambda f, seeds, jobs: outcomes)
    report = make_report([1], 1)
    assert report.name == "drives" and report.tables[0].rows[0].values["share"] == 1
