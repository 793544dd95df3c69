"""Rivals: which are fitted before one is named, and which in its place."""

from collections.abc import Mapping

import pytest
from hidden_sets import MODEL, made

from discrepancy.data.record import Floats, Record
from discrepancy.fit.simulate import Simulator
from discrepancy.name.accepted import Refit
from discrepancy.name.competition import refitted
from discrepancy.name.exchange import exchange
from discrepancy.name.search import Search

DELAY = 2e-8
"""Seconds, so few that a delay, a lag and a filter are alike to first order."""


def test_one_that_promises_no_more_waits_and_is_tried_in_the_end(monkeypatch: pytest.MonkeyPatch) -> None:
    simulated = 0
    plain = Simulator.run

    def counted(self: Simulator, record: Record, parameters: Mapping[str, float], *, rough: bool = False) -> Floats:
        nonlocal simulated
        simulated += 1
        return plain(self, record, parameters, rough=rough)

    monkeypatch.setattr(Simulator, "run", counted)
    with Simulator(MODEL, 1) as simulator:
        search = Search(simulator, made({"actuator_delay": DELAY}), lambda _: None)
        search.begin()
        search.look()
        alike = [(c, s) for c, s in search.significant() if c.effect.id in ("actuator_delay", "amplifier_bandwidth")]
        begun = [Refit(search.with_effect(*search.view, c, s), c, s) for c, s in alike]
        [first] = refitted(search, search.view, begun)
        assert len(begun) == 2
        assert first.candidate is begun[0].candidate
        search.extend(2)
        exchange(search)
        [entry] = search.accepted
        assert {entry.id, *entry.rivals} >= {"actuator_delay", "amplifier_bandwidth"}
        # Beside the same parameters no one is tried twice.
        before, simulated = dict(entry.rivals), 0
        exchange(search)
        assert (dict(search.accepted[0].rivals), simulated) == (before, 0)
