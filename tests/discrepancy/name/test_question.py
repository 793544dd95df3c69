"""What is said of names that there was no time to put to the test."""

from types import SimpleNamespace

import pytest

from discrepancy.name.question import unasked
from gyro_model.model import load_model


def accepted(effect_id: str) -> SimpleNamespace:
    effect = load_model().effect(effect_id)
    return SimpleNamespace(id=effect_id, share=0.1, candidate=SimpleNamespace(effect=effect))


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


def test_who_was_asked_or_stands_with_a_partner_is_not_asked_here() -> None:
    assert unasked(searched(questioned=True)) == {}
    assert unasked(searched(questioned=False, partners=frozenset({"nonlinear_damping"}))) == {}
