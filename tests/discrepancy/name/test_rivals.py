"""Rivals: which are fitted before one is named, and which in its place."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import pytest
from blank_search import blank_search
from hidden_sets import MODEL, made

from discrepancy.data.record import Floats, Record
from discrepancy.fit.fitted import Fitted
from discrepancy.fit.refit import Fitter
from discrepancy.fit.simulate import Simulator
from discrepancy.name import competition
from discrepancy.name import look as looking
from discrepancy.name.accepted import Accepted, Instead, Refit
from discrepancy.name.begin import begin
from discrepancy.name.columns import Candidate, Probe
from discrepancy.name.competition import refitted, rivals
from discrepancy.name.exchange import _trial_parts, exchange
from discrepancy.name.extend import extend
from discrepancy.name.look import look
from discrepancy.name.scan import Scan
from discrepancy.name.score import Score
from discrepancy.name.search import Given, Search

DELAY = 2e-8
"""Seconds, so few that a delay, a lag and a filter are alike to first order."""


@pytest.fixture
def simulated(monkeypatch: pytest.MonkeyPatch) -> list[Mapping[str, float]]:
    """The parameters of every run that is simulated."""
    runs: list[Mapping[str, float]] = []
    plain = Simulator.run

    def noted(self: Simulator, record: Record, parameters: Mapping[str, float], *, parts: bool | None = None) -> Floats:
        runs.append(parameters)
        return plain(self, record, parameters, parts=parts)

    monkeypatch.setattr(Simulator, "run", noted)
    return runs


def test_the_same_fit_is_not_scanned_twice(simulated: list[Mapping[str, float]]) -> None:
    with Simulator(MODEL, 1) as simulator:
        search = look(begin(Given(made({"actuator_delay": DELAY})), simulator))
        simulated.clear()
        scored = search.scored
        assert look(search).scored is scored
        assert not simulated
        # Another model of the same runs, and other candidates, are another question.
        for other in (replace(search, at=replace(search.at)), replace(search, refused=frozenset({"play"}))):
            look(other)
            assert simulated
            simulated.clear()


def test_what_has_no_finer_grid_is_not_scanned_for_one(monkeypatch: pytest.MonkeyPatch) -> None:
    found = []
    plain = looking.scanned

    def noted(fitter: Fitter, at: Fitted, removals: Sequence[Mapping[str, float]], own: Sequence[Candidate]) -> Scan:
        found.append(len(own))
        return plain(fitter, at, removals, own)

    monkeypatch.setattr(looking, "scanned", noted)
    with Simulator(MODEL, 1) as simulator:
        search = look(begin(Given(made({"actuator_delay": DELAY})), simulator))
        assert search.significant()
        assert found
        assert all(found)


def test_one_that_promises_no_more_waits_and_is_tried_in_the_end(simulated: list[Mapping[str, float]]) -> None:
    with Simulator(MODEL, 1) as simulator:
        search = look(begin(Given(made({"actuator_delay": DELAY})), simulator))

        def fitted(*ids: str) -> list[str]:
            begun = [
                Refit(search.with_effect(*search.view, c, s), c, s)
                for c, s in search.significant()
                if c.effect.id in ids
            ]
            assert {fit.candidate.effect.id for fit in begun} == set(ids)
            return [fit.candidate.effect.id for fit in refitted(search, search.view, begun)]

        assert fitted("actuator_delay", "voltage_filter") == ["actuator_delay"]
        # Columns say nothing of a lag, whose size is tried far from neutral too.
        assert fitted("actuator_delay", "amplifier_bandwidth") == ["actuator_delay", "amplifier_bandwidth"]
        search = exchange(extend(search, 2))
        [entry] = search.accepted
        assert {entry.id, *entry.rivals} >= {"actuator_delay", "voltage_filter", "amplifier_bandwidth"}
        # Beside the same parameters no one is tried twice.
        before = dict(entry.rivals)
        simulated.clear()
        assert dict(exchange(search).accepted[0].rivals) == before
        assert not simulated


def test_every_order_of_a_filter_is_fitted() -> None:
    """Small lags do not tell them apart, and no other effect that is asked later stands for one that is not."""
    with Simulator(MODEL, 1) as simulator:
        search = look(begin(Given(made({"actuator_delay": DELAY})), simulator))
        orders = [(c, s) for c, s in search.scored if c.effect.id == "voltage_filter"]
        begun = [Refit(search.with_effect(*search.view, c, s), c, s) for c, s in orders]
        found = refitted(search, search.view, begun)
        asked = [(c.effect.id, *c.shapes.items()) for c, _ in rivals(search, search.significant())]
    assert [fit.candidate.shapes["voltage_filter_order"] for fit in found] == [1.0, 2.0, 4.0]
    assert sum(name == "voltage_filter" for name, *_ in asked) == 3
    assert len(set(asked)) == len(asked)


@pytest.mark.parametrize(("worse", "named"), [(8.0, True), (11.0, True), (14.0, False)])
def test_a_rival_as_probable_as_the_name_is_its_either(
    monkeypatch: pytest.MonkeyPatch, worse: float, named: bool
) -> None:
    """A misalignment has one parameter, a cubic spring two: 12 of chi-square make up for the second."""

    def candidate(name: str) -> Candidate:
        effect = MODEL.effect(name)
        return Candidate(effect, tuple(Probe(q, 1.0, 1) for q in effect.sizes), {})

    def fit(chi_square: float) -> Any:
        return SimpleNamespace(count=1, unlikely=chi_square, parameters={})

    cubic, other = Accepted(candidate("cubic_stiffness"), 0.1, {}), candidate("actuator_misalignment")
    tried = Instead({}, [], {other.effect.id: (fit(worse), other)})
    monkeypatch.setattr("discrepancy.name.exchange._refitted_instead", lambda *_: tried)
    monkeypatch.setattr("discrepancy.name.exchange._looked", lambda search, _: search)
    monkeypatch.setattr("discrepancy.name.exchange.own_filter", lambda fitter, at: at)
    simulator = SimpleNamespace(clock=SimpleNamespace(check=lambda: None), model=MODEL)
    [entry] = exchange(blank_search(simulator=simulator, at=fit(0.0), accepted=(cubic,))).accepted
    assert entry.id == "cubic_stiffness"
    assert (other.effect.id in entry.rivals) == named


@pytest.mark.parametrize(
    ("name", "samples", "expected"),
    [("parasitic_mode", 8000, 4), ("parasitic_mode", 7999, 1), ("cubic_stiffness", 8000, 1)],
)
def test_others_are_tried_on_a_quarter_where_whole_runs_are_dear(name: str, samples: int, expected: int) -> None:
    fitter: Any = SimpleNamespace(records=[SimpleNamespace(t=range(samples), drift=None)])
    entry = Accepted(Candidate(MODEL.effect(name), (), {}), 0.1, {})
    assert _trial_parts(blank_search(fitter=fitter), entry) == expected


def test_of_what_promises_the_same_the_electronics_come_before_a_force(monkeypatch: pytest.MonkeyPatch) -> None:
    # Under a decay nothing but the electronics' offset or a constant force moves the mean, and neither is told apart.
    found = [Candidate(MODEL.effect(name), (), {}) for name in ("constant_force", "amplifier_offset")]
    monkeypatch.setattr(competition, "_close", lambda _, worth: worth)
    ordered = competition.rivals(cast("Search", None), [(c, cast("Score", None)) for c in found])
    assert [c.effect.id for c, _ in ordered] == ["amplifier_offset", "constant_force"]
