"""A search through openings of the runs: it simulates less, and comes to the same end."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hidden_sets import MODEL, RATE, made, names
from hypothesis import given
from hypothesis import strategies as st

from discrepancy.criteria import Criteria
from discrepancy.data.record import Floats, Record
from discrepancy.diagnose import diagnose
from discrepancy.fit import openings
from discrepancy.fit.fitted import Fitted
from discrepancy.fit.openings import LEAST, LONG, TRIED, parts
from discrepancy.fit.refit import SETTLED, Fitter
from discrepancy.fit.simulate import Simulator
from discrepancy.name import competition
from discrepancy.name.further import Wider
from discrepancy.name.look import fewer_parts
from discrepancy.name.score import Score
from discrepancy.tell.answer import Diagnosis

WHOLE, SHORT = 10**9, 1_000
"""Samples of the shortest openings: no run is so long, and a sixteenth of a set's."""


@given(runs=st.lists(st.integers(100, 400_000), min_size=1, max_size=40))
def test_parts_end_with_the_whole_and_openings_are_no_shorter_than_worth_it(runs: list[int]) -> None:
    @dataclass
    class Run:
        t: range
        v: Floats
        drift: None = None

    numbers = parts([Run(range(n), np.ones((n, 1))) for n in runs])  # type: ignore[misc]
    assert numbers[-1] == 1
    assert all(long * LONG <= short for short, long in pairwise(numbers))
    assert sum(runs) / numbers[0] >= min(TRIED, sum(runs))
    assert numbers == [1] or min(runs) / numbers[0] >= LEAST


def test_openings_have_what_moves_in_them() -> None:
    n = 64_000
    t = np.arange(n) / n
    # A sweep that comes to its resonance after so much of the run, a hundredth as wide.
    for passed, most in ((0.02, 32), (0.1, 8), (0.3, 1), (0.9, 1)):
        v = 0.01 * np.sin(2 * np.pi * 400 * t) + np.exp(-(((t - passed) / 0.01) ** 2))
        run = SimpleNamespace(t=t, v=v[:, None], drift=None)
        assert parts([run, run])[0] == most  # type: ignore[list-item]


def test_two_effects_are_found_with_less_simulated(monkeypatch: pytest.MonkeyPatch) -> None:
    data = made({"k3_x": 2e9, "k3_y": 2e9, "feedthrough": 8.0}, samples=16_000)
    simulated = 0
    plain = Simulator.run

    def counted(
        self: Simulator, record: Record, parameters: Mapping[str, float], *, parts: bool | None = None
    ) -> Floats:
        nonlocal simulated
        simulated += len(record.t)
        return plain(self, record, parameters, parts=parts)

    monkeypatch.setattr(Simulator, "run", counted)
    samples = {}
    for tried in (WHOLE, 4 * SHORT):
        simulated = 0
        monkeypatch.setattr(openings, "TRIED", tried)
        assert names(diagnose(data, MODEL)) == {"cubic_stiffness", "drive_feedthrough"}
        samples[tried] = simulated
    # The start, the last scan, which is one of three, and fits of the accepted effects are over whole runs.
    assert samples[4 * SHORT] < 0.9 * samples[WHOLE]


@pytest.mark.parametrize(
    ("statistic", "share", "expected"),
    [
        (7.0, 1e-2, 5),  # 28 in openings four times as long, beyond the 23.9 that one test in a million has by chance
        (5.0, 1e-2, 1),  # 20
        (7.0, 1e-4, 1),  # sure in time, and not worth a parameter
    ],
)
def test_openings_grow_to_those_that_may_show_something(statistic: float, share: float, expected: int) -> None:
    result = Score(statistic, 1, share, (1.0,), (1.0,), 1.0, 1.0)
    # 30 runs of 40,000 samples are cut into 20 parts, 5, and 1.
    runs = SimpleNamespace(fit=[SimpleNamespace(t=range(40_000), v=np.ones((40_000, 1)), drift=None)] * 30)
    scored = [(SimpleNamespace(trials=1), result)]
    search: Any = SimpleNamespace(dataset=runs, number=20, scored=scored, criteria=Criteria())
    assert fewer_parts(search) == expected


def test_a_first_fit_ends_at_its_share_of_the_cost() -> None:
    data = made({}, samples=2000)
    with Simulator(MODEL, jobs=1) as simulator:
        fitter = Fitter(simulator, data.fit)
        begun = fitter.begin(data.nominal)
        p = {**begun.parameters, "kxx": 1.02 * begun.parameters["kxx"]}
        far = fitter.evaluated(replace(begun, parameters=p, whiten=fitter.plain(p)))
        rough, fine = fitter.fit(far, share=0.05), fitter.fit(far)
    assert fine.left < SETTLED < rough.left < 0.05 * rough.count
    # Near a minimum what is left is what a step promises, to the tenth that is not linear.
    assert rough.cost - fine.cost == pytest.approx(rough.left * rough.variance, rel=0.1)


def test_what_shows_after_the_openings_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(openings, "TRIED", SHORT)
    late = 0.6 * 8000 / RATE
    data = made({"k3_x": 2e9, "k3_y": 2e9, "damping_step_factor": 1.3, "damping_step_time": late})
    found = diagnose(data, MODEL)
    assert names(found) == {"cubic_stiffness", "damping_step"}
    [step] = [f for f in found.effects if f.id == "damping_step"]
    assert step.parameters["damping_step_time"].value == pytest.approx(late, rel=0.02)


def test_interrupted_search_resumes_in_its_opening(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(openings, "TRIED", SHORT)
    data, file = made({"k3_x": 2e9, "k3_y": 2e9, "feedthrough": 8.0}), tmp_path / "search.json"
    whole = diagnose(data, MODEL, checkpoint=file)

    def interrupt(line: str) -> None:
        if line.startswith("accepted") and json.loads(file.read_text())["state"]["opening"] > 1:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        diagnose(data, MODEL, progress=interrupt, checkpoint=file)
    assert diagnose(data, MODEL, checkpoint=file).report() == whole.report()


@dataclass
class Asked:
    """A further search that finds nothing, and remembers what it was asked."""

    folder: Path
    least: list[float] = field(default_factory=list)

    def __call__(self, fitter: Fitter, at: Fitted, named: Sequence[str], room: int, least: float) -> Wider | None:
        assert bool(least) != bool(named), "names are questioned in the end, not before one more is accepted"
        self.least.append(least)
        return None


def asked(folder: Path) -> tuple[Diagnosis, list[float]]:
    further = Asked(folder)
    # Of 8 V/N the spring takes 0.9989 or 0.9990 of both, of 4 it takes 0.9997: plainly no weak name.
    return diagnose(made({"k3_x": 2e9, "k3_y": 2e9, "feedthrough": 4.0}), MODEL, further=further), further.least


def test_before_a_weak_name_a_term_that_takes_more_is_asked_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Whole runs: of openings the first takes 0.998 of what is missing.
    monkeypatch.setattr(openings, "TRIED", WHOLE)
    plain, before = asked(tmp_path)
    # Each of the two takes most of what is missing when its turn comes.
    assert before == [0.0]
    monkeypatch.setattr(competition, "WEAK", 2.0)
    found, least = asked(tmp_path)
    assert names(found) == names(plain) == {"cubic_stiffness", "drive_feedthrough"}
    assert len(least) == 3
    assert min(least[:2]) > 0 == least[2]
