"""The masses that mostly rest do, and the report says which were right."""

import numpy as np
import pytest

from benchmarks import resting
from benchmarks.resting import FRICTION, REST, drawn, make_report
from benchmarks.rubbing import motion
from benchmarks.structures import Outcome


@pytest.mark.parametrize("seed", [1, 2])
def test_it_rests_for_a_part_of_the_time(seed: int) -> None:
    own = drawn(np.random.default_rng(seed))
    assert FRICTION[0] <= own.friction <= FRICTION[1]
    rng = np.random.default_rng(seed)
    speed = np.abs(motion(own, rng.standard_normal(2000), 1 / (20 * own.structure.modes[0]), "zero")[:, 1])
    assert 0.1 < np.mean(speed < REST * speed.max()) < 0.9


def test_the_report_counts_what_is_right(monkeypatch: pytest.MonkeyPatch) -> None:
    values = {"over noise": 1.0, "friction off": 1e-4}
    outcomes = [Outcome("one", [1.0], "said", True, values), Outcome("two", [1.0], "no linear start", False, {})]
    monkeypatch.setattr(resting, "in_processes", lambda f, seeds, jobs: outcomes)
    report = make_report([5, 6], 1)
    assert report.name == "resting" and "seeds from 5" in report.title
    assert report.tables[0].rows[0].values == {"share": 0.5}
