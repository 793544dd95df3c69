"""Intervals that count what was left out of an effect."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from hidden_sets import MODEL, made

from discrepancy.fit.fitted import Free
from discrepancy.fit.simulate import Simulator
from discrepancy.name.accepted import Accepted
from discrepancy.name.begin import begin
from discrepancy.name.columns import fading, left_out, without_part
from discrepancy.name.look import look
from discrepancy.name.search import Given, Search
from discrepancy.tell.intervals import WIDTH, intervals
from discrepancy.tell.left_out import _amounts, _Beside
from discrepancy.tell.mixture import Mixture

HIDDEN = {"friction_x": 3e-8, "friction_y": 3e-8, "friction_speed": 2e-3, "stribeck": 0.6, "stribeck_speed": 6e-3}
"""A friction whose Stribeck part shows too little to earn two parameters."""


@pytest.fixture(scope="module")
def plain() -> Iterator[Search]:
    """A search that has dry friction without its Stribeck part in its model."""
    with Simulator(MODEL, jobs=1) as simulator:
        search = begin(Given(made(HIDDEN, samples=4000)), simulator)
        search = look(search, lambda effect: effect.id == "dry_friction")
        candidate, scored = max(search.scored, key=lambda entry: entry[1].gain)
        part = fading(candidate)
        assert part is not None
        candidate = without_part(candidate, part)
        search = search.fitted(search.with_effect(*search.view, candidate, scored))
        yield replace(search, accepted=(Accepted(candidate, 0.1, {}),))


def test_what_makes_up_for_a_part_that_was_left_out_has_an_interval_that_holds_the_truth(plain: Search) -> None:
    part = left_out(plain.accepted[0].candidate.effect, {free.name for free in plain.at.free})
    assert part is not None
    assert part.size.name == "stribeck"
    told, deviations = intervals(plain)[1], plain.fitter.deviations(plain.at)
    for name in ("friction_x", "friction_y"):
        value = told[name].value
        # By the fit alone, which takes the friction near rest for that at speed, it is too large for the truth.
        assert value - WIDTH * deviations[name] > HIDDEN[name]
        assert 0.0 < told[name].low < HIDDEN[name] < told[name].high
        assert told[name].high == pytest.approx(value + WIDTH * deviations[name], rel=0.2)
    assert told["friction_speed"].low < HIDDEN["friction_speed"] < told["friction_speed"].high


def test_what_there_is_no_time_for_is_said(plain: Search, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("discrepancy.name.search.BEYOND", -1e9)
    after, told = intervals(plain)
    assert after.undone == (*plain.undone, "dry_friction beside what was not fitted")
    deviations = plain.fitter.deviations(plain.at)
    for name in ("m", "friction_x"):
        now = plain.at.parameters[name]
        assert told[name].high == pytest.approx(now + WIDTH * deviations[name])


def test_what_no_part_was_left_out_of_has_the_interval_of_the_fit(plain: Search) -> None:
    told, deviations = intervals(plain)[1], plain.fitter.deviations(plain.at)
    for name in ("m", "kxx", "dxy"):
        now = plain.at.parameters[name]
        assert (told[name].low, told[name].high) == pytest.approx(
            (now - WIDTH * deviations[name], now + WIDTH * deviations[name])
        )


def test_a_part_that_is_fitted_is_not_left_out(plain: Search) -> None:
    fitted = replace(plain, at=replace(plain.at, free=(*plain.at.free, Free("stribeck", 1e-3))))
    assert left_out(plain.accepted[0].candidate.effect, {free.name for free in fitted.at.free}) is None


def test_a_mixture_lies_between_its_parts() -> None:
    # SI values are small: a quantile is found to a share of the deviations, whatever their unit.
    for unit in (1.0, 1e-12):
        both = Mixture(np.array([0.5, 0.5]), unit * np.array([-3.0, 3.0]), unit * np.array([1.0, 1.0]))
        assert both.quantile(0.5) == pytest.approx(0.0, abs=1e-4 * unit)
        # 95 % of the lower half: one in twenty of a normal distribution, 1.645 below its mean.
        assert both.quantile(0.025) == pytest.approx(-4.645 * unit, rel=1e-3)


def test_beside_a_part_others_move_as_their_covariance_says() -> None:
    covariance = np.array([[4.0, -1.0], [-1.0, 0.5]])
    fit = _Beside(["f", "s"], np.array([-2.0, 1.0]), np.array([-2.0, 1.0]), covariance, 5.0)
    # By hand: f falls by 1 / 0.5 with each unit of s; none of s gives 5 - 1 / 0.5 of chi-square.
    assert fit.changes(np.array([0.0, 1.0]))[:, 0] == pytest.approx([0.0, -2.0])
    assert fit.likelihood(np.array([0.0, 1.0])) == pytest.approx([1.5, 2.5])
    assert fit.deviations[0] == pytest.approx(2**0.5)
    # Of a part as large as f, an amount a is s f / 3 of f = 3 - 2 a: a = 1 - 2 a / 3.
    assert _amounts(fit, {"f": 3.0}, np.array([1.0])) == pytest.approx(0.6)


def test_a_part_that_changes_nothing_widens_no_interval() -> None:
    fit = _Beside(["f", "s"], np.zeros(2), np.zeros(2), np.diag([1.0, 0.0]), 0.0)
    assert not fit.shows
