"""What is said of names that there was no time to put to the test."""

from types import SimpleNamespace

import pytest

from discrepancy.name.question import ask, unasked
from gyro_model.model import load_model


def accepted(effect_id: str) -> SimpleNamespace:
    effect = load_model().effect(effect_id)
    names = {q.name for q in effect.sizes}
    return SimpleNamespace(id=effect_id, share=0.1, candidate=SimpleNamespace(effect=effect), names=names)


def searched(*, questioned: bool, partners: frozenset[str] = frozenset()) -> SimpleNamespace:
    """A search that found d2_x = 2 +- 1.5, d2_y = 1 +- 1 and k3_x = 8 +- 1, k3_y = 0 +- 1."""
    values = {"d2_x": 2.0, "d2_y": 1.0, "k3_x": 8.0, "k3_y": 0.0}
    spread = {"d2_x": 1.5, "d2_y": 1.0, "k3_x": 1.0, "k3_y": 1.0}
    return SimpleNamespace(
        questioned=questioned,
        partners=partners,
        at=SimpleNamespace(parameters=values),
        fitter=SimpleNamespace(deviations=lambda at: spread),
        accepted=[accepted("nonlinear_damping"), accepted("cubic_stiffness")],
    )


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
    search = searched(questioned=False)
    search.accepted.append(accepted("comb_fringe"))
    search.at.parameters["comb_fringe"] = -1.6e-7
    search.fitter = SimpleNamespace(
        deviations=lambda at: {"d2_x": 1.5, "d2_y": 1.0, "k3_x": 1.0, "comb_fringe": 3.5e-6}
    )
    assert list(unasked(search)) == ["comb_fringe"]


@pytest.mark.parametrize(
    ("neutral", "lost", "stays"),
    [(False, False, False), (False, True, True), (True, False, False), (True, True, False)],
)
def test_an_effect_without_which_the_motion_is_lost_is_not_taken_out(
    monkeypatch: pytest.MonkeyPatch, *, neutral: bool, lost: bool, stays: bool
) -> None:
    search = searched(questioned=False)
    search.fitter = SimpleNamespace(fit=lambda at: at)
    search.simulator = SimpleNamespace(clock=SimpleNamespace(check=lambda: None))
    search.without_effect = lambda at, entry: at
    search.progress, search.dropped, search.copies = print, [], {}
    failing = SimpleNamespace(candidate=search.accepted[0].candidate, reason="weak")
    monkeypatch.setattr("discrepancy.name.question._failing", lambda search: [(failing, neutral)])
    monkeypatch.setattr("discrepancy.name.question.leaves", lambda fitter, at, before: lost)
    assert ask(search) is not stays
    assert search.questioned is stays
    assert [a.id for a in search.accepted] == ["nonlinear_damping", "cubic_stiffness"][not stays :]


def test_who_was_asked_or_stands_with_a_partner_is_not_asked_here() -> None:
    assert unasked(searched(questioned=True)) == {}
    assert unasked(searched(questioned=False, partners=frozenset({"nonlinear_damping"}))) == {}
