"""What is said of names that there was no time to put to the test."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from blank_search import blank_search
from hidden_sets import MODEL, TRUE, made

from discrepancy.fit.fitted import Free
from discrepancy.fit.refit import Fitter
from discrepancy.fit.simulate import Simulator
from discrepancy.name.question import _bends, ask, unasked
from discrepancy.name.search import Search, attempt
from discrepancy.name.unseen import told
from gyro_model.model import load_model


def accepted(effect_id: str, partner: str = "") -> Any:
    effect = load_model().effect(effect_id)
    names = {q.name for q in effect.sizes}
    before = SimpleNamespace(effect=SimpleNamespace(id=partner)) if partner else None
    candidate = SimpleNamespace(effect=effect, partner=before)
    return SimpleNamespace(id=effect_id, share=0.1, candidate=candidate, names=names)


def searched(*names: str, questioned: bool, partner: str = "", **own: Any) -> Search:
    """A search that found d2_x = 2 +- 1.5, d2_y = 1 +- 1 and k3_x = 8 +- 1, k3_y = 0 +- 1, and effects of further
    ``names``, comb_fringe = -1.6e-7 +- 3.5e-6; partner: the effect without which others would change nothing."""
    values = {"d2_x": 2.0, "d2_y": 1.0, "k3_x": 8.0, "k3_y": 0.0, "comb_fringe": -1.6e-7}
    spread = {"d2_x": 1.5, "d2_y": 1.0, "k3_x": 1.0, "k3_y": 1.0, "comb_fringe": 3.5e-6}
    entries = [accepted(name, partner) for name in ("nonlinear_damping", "cubic_stiffness", *names)]
    fitter = SimpleNamespace(deviations=lambda at: spread, fit=lambda at: at)
    at = SimpleNamespace(parameters=values)
    return blank_search(questioned=questioned, at=at, fitter=fitter, accepted=tuple(entries), **own)


def shows(monkeypatch: pytest.MonkeyPatch, *names: str) -> None:
    """Of these effects all parameters together explain something."""
    monkeypatch.setattr("discrepancy.name.question._shows", lambda search, entry: entry.id in names)


def test_a_name_whose_interval_holds_neutral_is_none_where_time_ran_out(monkeypatch: pytest.MonkeyPatch) -> None:
    shows(monkeypatch)
    weak = unasked(searched(questioned=False))
    # One size that is not neutral is enough to stand.
    assert list(weak) == ["nonlinear_damping"]
    assert weak["nonlinear_damping"].sizes == {"d2_x": (2.0, 1.5), "d2_y": (1.0, 1.0)}


def test_a_name_whose_parameters_show_together_stands_though_time_ran_out(monkeypatch: pytest.MonkeyPatch) -> None:
    # Of a friction over a high speed the data show the ratio alone, and each by itself may be neutral.
    shows(monkeypatch, "nonlinear_damping")
    assert unasked(searched(questioned=False)) == {}


def test_a_single_size_that_may_be_neutral_shows_by_nothing_else(monkeypatch: pytest.MonkeyPatch) -> None:
    shows(monkeypatch, "nonlinear_damping", "comb_fringe")
    assert list(unasked(searched("comb_fringe", questioned=False))) == ["comb_fringe"]


def test_what_the_fit_has_put_to_neutral_shows_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    shows(monkeypatch, "nonlinear_damping")
    search = searched(questioned=False)
    search.at.parameters.update(d2_x=0.0, d2_y=0.0)
    assert list(unasked(search)) == ["nonlinear_damping"]


@pytest.mark.parametrize(
    ("neutral", "lost", "stays"),
    [(False, False, False), (False, True, True), (True, False, False), (True, True, False)],
)
def test_an_effect_without_which_the_motion_is_lost_is_not_taken_out(
    monkeypatch: pytest.MonkeyPatch, *, neutral: bool, lost: bool, stays: bool
) -> None:
    simulator: Any = SimpleNamespace(clock=SimpleNamespace(check=lambda: None))
    search = searched(questioned=False, simulator=simulator)
    monkeypatch.setattr(Search, "without_effect", lambda search, at, entry: at)
    failing = SimpleNamespace(
        dropped=SimpleNamespace(candidate=search.accepted[0].candidate), reason="", unseen=not neutral
    )
    monkeypatch.setattr("discrepancy.name.question._failing", lambda search: [failing])
    monkeypatch.setattr("discrepancy.name.question._bends", lambda search, without, failing: False)
    monkeypatch.setattr("discrepancy.name.question.leaves", lambda fitter, at, before: lost)
    found = ask(search)
    assert found.questioned is stays
    assert [a.id for a in found.accepted] == ["nonlinear_damping", "cubic_stiffness"][not stays :]


def test_who_was_asked_or_stands_with_a_partner_is_not_asked_here() -> None:
    assert unasked(searched(questioned=True)) == {}
    assert unasked(searched(questioned=False, partner="nonlinear_damping")) == {}


@pytest.mark.parametrize("lag", [1e-6, 0.0])
def test_a_lag_beside_a_delay_stands_though_a_linear_model_does_not_miss_it(lag: float) -> None:
    delay = {"actuator_delay": 4e-6}
    data = made({**delay, "amplifier_time_constant": lag})
    with Simulator(MODEL, jobs=1) as simulator:
        fitter = Fitter(simulator, data.fit)
        free = [Free(name, 1e-9, 0.0) for name in (*delay, "amplifier_time_constant")]
        begun = fitter.begin({**TRUE, **delay, "amplifier_time_constant": 1e-6})
        at = fitter.fit(fitter.evaluated(replace(begun, free=(*begun.free, *free))))
        still = replace(at, free=at.free[:-1], parameters={**at.parameters, "amplifier_time_constant": 0.0})
        without = fitter.fit(fitter.evaluated(still))
        [found] = told(fitter, at, [({"amplifier_time_constant"}, {"amplifier_time_constant": 0.0})])
        search = blank_search(at=at, fitter=fitter)
        size = {"amplifier_time_constant": (at.parameters["amplifier_time_constant"], 1e-9)}
        failing: Any = SimpleNamespace(dropped=SimpleNamespace(sizes=size), seen=found.seen)
        assert found.unseen < search.criteria.unseen
        assert _bends(search, without, failing) is (lag > 0)


@pytest.mark.parametrize("error", [np.linalg.LinAlgError, ZeroDivisionError, OverflowError])
def test_a_step_whose_numbers_run_out_leaves_the_search_and_is_told(error: type[Exception]) -> None:
    def broken(_: Search) -> Search:
        raise error

    clock = SimpleNamespace(check=lambda: None)
    before = blank_search(simulator=SimpleNamespace(clock=clock))
    after = attempt(before, "names held against data", broken)
    assert after.failed == ("names held against data",)
    assert replace(after, failed=()) == before
