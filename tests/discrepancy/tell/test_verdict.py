"""What a name is worth: its probability by rivals, by what is left and by what it brought."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from blank_search import blank_search

from discrepancy.clock import OutOfTime
from discrepancy.criteria import Criteria
from discrepancy.data.dataset import Dataset
from discrepancy.name.more_modes import copies
from discrepancy.name.search import Given
from discrepancy.tell import verdict
from discrepancy.tell.answer import Finding, Stage
from discrepancy.tell.assemble import _scaled, _stages
from discrepancy.tell.verdict import Remainder, imitating, improbable, probability, shown, worse_without
from gyro_model.model import load_model

CLEAN = Remainder(share=0.0, ratio=1.0, above=False, significant=False)


def search(asked: bool = True, short: float = 0.0, **behind: float) -> Any:
    """Two effects in a model, the rivals of each so far ``behind``; short: variances that a further step would gain."""
    names = [SimpleNamespace(id=name, behind=behind, asked=asked) for name in ("large", "small")]
    return SimpleNamespace(accepted=names, partners=set(), criteria=Criteria(), at=SimpleNamespace(left=short))


def stages(*misfits: float) -> tuple[Stage, ...]:
    return tuple(Stage(n, {}, {"": m}, {}) for n, m in zip(("refit", "large", "small"), misfits, strict=True))


def of(name: str, found: Any, rest: Remainder, *misfits: float) -> float:
    return probability(found, Finding(name, (), {}), rest, stages(*misfits))


def test_rivals_take_by_their_likelihood() -> None:
    sure = 1 - Criteria().prior_none
    assert of("large", search(), CLEAN, 1.0, 0.1, 0.01) == pytest.approx(sure)
    # A rival that fits as well has half; one that was not tried may.
    assert of("large", search(rival=0.0), CLEAN, 1.0, 0.1, 0.01) == pytest.approx(sure / 2)
    assert of("large", search(asked=False), CLEAN, 1.0, 0.1, 0.01) == pytest.approx(sure / 2)
    # Unseen data, or a better term, speak against it.
    doubted = probability(search(), Finding("large", (), {}), CLEAN, stages(1.0, 0.1, 0.01), True)
    assert doubted == pytest.approx(0.2 * sure) and doubted < Criteria().improbable


def test_a_model_that_leaves_all_bounds_has_brought_nothing() -> None:
    rest = Remainder(share=1.0, ratio=np.inf, above=True, significant=True)
    assert of("large", search(), rest, 1.0, np.nan, np.nan) == 0.0
    # A rival whose refit has left them is none.
    assert of("large", search(rival=np.nan), CLEAN, 1.0, 0.1, 0.01) == pytest.approx(1 - Criteria().prior_none)


def test_what_is_left_takes_nothing_from_a_mode_that_the_response_shows() -> None:
    rest = Remainder(share=0.4, ratio=9.0, above=True, significant=True)
    sure = 1 - Criteria().prior_none
    args = search(asked=False), Finding("large", (), {}), rest, stages(1.0, 0.1, 0.09)
    assert probability(*args) < sure / 4
    assert probability(*args, shown=True) == pytest.approx(sure)


def test_where_most_is_left_a_mode_that_the_response_shows_is_one_of_many() -> None:
    rest = Remainder(share=0.57, ratio=50.0, above=True, significant=True)
    args = search(), Finding("large", (), {}), rest, stages(1.0, 0.8, 0.75)
    assert probability(*args, shown=True) == probability(*args) < 0.5


@pytest.mark.parametrize(("short", "share"), [(50.0, 1.0), (350.0, 0.5), (np.inf, 1.0)])
def test_a_fit_far_from_its_minimum_is_half_sure(short: float, share: float) -> None:
    rest = Remainder(share=0.002, ratio=1.9, above=True, significant=False)
    found = of("large", search(short=short), rest, 1.0, 0.1, 0.01)
    assert found == pytest.approx(share * of("large", search(), rest, 1.0, 0.1, 0.01))


def test_a_mode_that_takes_nothing_away_where_all_is_left_is_no_name() -> None:
    rest = Remainder(share=0.999, ratio=54.0, above=True, significant=True)
    args = search(asked=False), Finding("large", (), {}), rest, stages(0.999, 0.9985, 0.9985)
    assert probability(*args, shown=True) < Criteria().believed


@pytest.mark.parametrize(
    ("modes", "ids"),
    # A shaft that moves as a whole may stand among further modes, with none before them.
    [((1, 1), set()), ((0, 2), set()), ((1, 2), {"parasitic_mode", "parasitic_mode_2"}),
     ((0, 3), {"parasitic_mode", "parasitic_mode_2"})],
)  # fmt: skip
def test_resonators_are_shown_where_there_are_as_many_modes_beside_that_of_the_mass(
    modes: tuple[int, int], ids: set[str]
) -> None:
    more = copies(load_model(), 1, 2)
    effects = [
        load_model().effect("parasitic_mode"),
        more["parasitic_mode_2"].effect,
        load_model().effect("cubic_stiffness"),
    ]
    names = [SimpleNamespace(id=e.id, candidate=SimpleNamespace(effect=e)) for e in effects]
    given = SimpleNamespace(modes=[[None] * n for n in modes])
    own: Any = SimpleNamespace(accepted=names, given=given, whole=SimpleNamespace(axes=1))
    assert shown(own) == ids


def test_of_what_stays_above_noise_the_one_that_brought_little_is_in_doubt() -> None:
    rest = Remainder(share=0.0001, ratio=4.0, above=True, significant=False)
    sure = 1 - Criteria().prior_none
    # Noise 0.003: 0.012² - 0.003² of 0.02² - 0.003² are left of what "small" found, next to nothing of 1.
    assert of("small", search(), rest, 1.0, 0.02, 0.012) == pytest.approx(sure * (1 - 1.35e-4 / 3.91e-4))
    assert of("large", search(), rest, 1.0, 0.02, 0.012) == pytest.approx(sure, abs=1e-3)
    assert of("small", search(), CLEAN, 1.0, 0.02, 0.012) == pytest.approx(sure)


def test_a_name_that_came_in_the_place_of_another_counts_what_all_brought() -> None:
    rest = Remainder(share=0.9, ratio=2.0, above=False, significant=True)
    found = of("small", search(), rest, 1.0, 0.99, 0.98)
    replaced = search()
    replaced.accepted = [SimpleNamespace(id="other", behind={}, asked=True)]
    other = probability(
        replaced, Finding("other", (), {}), rest, (Stage("nominal", {}, {"": 9.0}, {}), *stages(1.0, 0.99, 0.98))
    )
    # Of the square that is not noise, 1 - 0.49², 1 - 0.98² are gone.
    sure = 1 - Criteria().prior_none
    assert other == pytest.approx(sure * 0.1 * (1 - 0.98**2) / (1 - 0.49**2))
    assert found < other


def judged(monkeypatch: pytest.MonkeyPatch, without: float, *misfits: float, **criteria: float) -> dict[str, str]:
    """What is said of "large" and "small" where held-out runs have these ``misfits`` at each stage, and one of
    ``without`` as soon as either is taken out again."""
    monkeypatch.setattr("discrepancy.tell.verdict._without", lambda search, entry: {})
    monkeypatch.setattr("discrepancy.tell.verdict._with_starts_found", lambda search, parameters: without)
    # Of a mass that a spring holds.
    monkeypatch.setattr("discrepancy.tell.verdict.unsprung", lambda whole, at: False)
    names: Any = [SimpleNamespace(id=name, of_record=False) for name in ("large", "small")]
    given = Given(cast("Dataset", None), criteria=Criteria.of(criteria))
    simulator = SimpleNamespace(clock=SimpleNamespace(check=lambda: None))
    gaps = {"refit": misfits[0], "final": misfits[-1]}
    found = blank_search(given=given, simulator=simulator, accepted=tuple(names))
    _, worse = worse_without(found, [Finding(n.id, (), {}) for n in names], stages(*misfits), gaps)
    return worse


def test_an_effect_that_makes_held_out_runs_worse_is_in_doubt_however_little_it_is(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    assert judged(monkeypatch, 0.3, 1.0, 0.5, 0.2) == {}
    # The second stage is 0.4 % worse than the first, and than without that effect.
    worse = judged(monkeypatch, 0.5, 1.0, 0.5, 0.502)
    assert list(worse) == ["small"]
    assert "misfit 0.5 without, 0.502 with" in worse["small"]
    assert judged(monkeypatch, 0.5, 1.0, 0.5, 0.502, worse=1.02) == {}


def test_effects_of_which_none_makes_held_out_runs_worse_may_do_so_together(monkeypatch: pytest.MonkeyPatch) -> None:
    worse = judged(monkeypatch, 2.0, 1.0, 1.1, 1.05)
    assert set(worse) == {"large", "small"}
    assert len(set(worse.values())) == 1
    assert "large, small" in worse["small"]


def test_a_name_that_its_own_probability_calls_improbable_is_in_doubt() -> None:
    def said(probability: float, either: tuple[str, ...], **behind: float) -> list[str]:
        return improbable(search(True, **behind), [Finding("large", either, {}, probability=probability)])

    assert said(0.99, ()) == []
    # Three that fit alike have a quarter each of what is sure together: that is what ``either`` says.
    assert said(0.25, ("a", "b", "c"), a=0.0, b=0.0, c=0.0) == []
    [line] = said(0.08, ("a",), a=0.0)
    assert line.startswith("large or a is hardly what is missing")
    assert "0.16" in line
    [line] = improbable(search(False), [Finding("large", (), {}, probability=0.25)])
    assert line.startswith("large was not held against all others")
    # A rival that is no ``either`` takes from the name and gives it nothing.
    assert len(said(0.25, (), a=0.0)) == 1


def test_what_leaves_most_and_is_improbable_is_not_named() -> None:
    # As of a motor whose flexible link no effect is: a feedthrough takes a sixth of what is left.
    left = Remainder(share=0.83, ratio=37.0, above=True, significant=True)
    found = search(asked=True)
    chance = {name: of(name, found, left, 0.66, 0.61, 0.60) for name in ("large", "small")}
    findings = [Finding(name, (), {}, probability=value) for name, value in chance.items()]
    assert imitating(findings, left, (), Criteria()) == tuple(findings)
    # Where nothing is left a name stands, however many rivals fit as well; so does what has taken most.
    assert imitating(findings, CLEAN, (), Criteria()) == ()
    # Nor is one named that no more than held-out runs speak against.
    assert imitating(findings, CLEAN, ["small"], Criteria()) == (findings[1],)
    most = Remainder(share=0.1, ratio=5.0, above=True, significant=True)
    sure = Finding("large", (), {}, probability=of("large", search(), most, 0.66, 0.2, 0.2))
    assert imitating([sure], most, (), Criteria()) == ()


def test_only_values_that_a_laboratory_states_say_that_the_force_is_off() -> None:
    nominal = {"m": 1.0, "kxx": 2.0}
    for estimated, said in (((), True), (("m", "kxx"), False)):
        dataset = SimpleNamespace(nominal=nominal, estimated=estimated)
        at = SimpleNamespace(parameters={"m": 1.1, "kxx": 2.2})
        found: Any = SimpleNamespace(dataset=dataset, at=at)
        assert any("force_scale were -9.09%" in doubt for doubt in _scaled(found)) == said


def stopped_search(monkeypatch: pytest.MonkeyPatch, undone: list[str]) -> Any:
    """A search that had no time for what is ``undone``, under noise of which half has a memory."""
    monkeypatch.setattr(verdict, "_memory", lambda *_: 1.0)
    monkeypatch.setattr(verdict, "_at_most", lambda _: np.inf)
    monkeypatch.setattr(verdict, "repeated_noise", lambda _: None)
    run = SimpleNamespace(v=np.ones((4, 2)), valid=np.ones(4, bool))
    stopped = search()
    stopped.dataset = SimpleNamespace(held_out=(run,), records=())
    stopped.fitter = stopped.whole = SimpleNamespace(signal=1.0)
    stopped.undone, stopped.failed = undone, ()
    return stopped


@pytest.mark.parametrize(("undone", "believed"), [([], True), (["another term in the place of a name"], False)])
def test_a_stopped_search_does_not_stand_by_names_beside_what_it_leaves(
    monkeypatch: pytest.MonkeyPatch, undone: list[str], believed: bool
) -> None:
    """Noise with a memory may be 1.4 times as much; of a search that ended, not of one that has not tried all."""
    stopped = stopped_search(monkeypatch, undone)
    found = stages(2.4, 2.2, 2.0)
    rest = verdict.remainder(stopped, found, {"noise_floor": 1.0, "final": 2.0, "refit": 2.4}, {})
    assert rest.share == pytest.approx(2.0 / 2.4**2) and not rest.above
    assert rest.significant != believed
    name = probability(stopped, Finding("large", (), {}), rest, found)
    assert (name > 0.9) == believed and (name <= 0.5) != believed


def test_what_a_stopped_search_leaves_within_what_is_known_of_the_noise_is_noise(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    stopped = stopped_search(monkeypatch, ["effects behind a noise of the motion"])
    # Noise of 2 with its memory, known to a quarter of the half that it may be more.
    for final, left in ((1.05 * 2**0.5, False), (1.2 * 2**0.5, True)):
        gaps = {"noise_floor": 1.0, "final": final, "refit": final}
        rest = verdict.remainder(stopped, stages(2.4, final, final), gaps, {})
        assert rest.share > Criteria().left
        assert rest.significant == left


def test_a_comparison_for_which_there_is_no_time_leaves_the_name(monkeypatch: pytest.MonkeyPatch) -> None:
    def late(*_: object) -> float:
        raise OutOfTime

    monkeypatch.setattr(verdict, "_with_starts_found", late)
    monkeypatch.setattr(verdict, "_without", lambda *_: {})
    simulator = SimpleNamespace(clock=SimpleNamespace(check=lambda: None))
    stopped = blank_search(simulator=simulator, accepted=tuple(search().accepted))
    found = tuple(Finding(name, (), {}) for name in ("large", "small"))
    stopped, worse = worse_without(stopped, found, stages(1.0, 1.1, 1.2), {"final": 0.9, "refit": 1.0})
    assert worse == {}
    assert stopped.undone == ("held-out runs without large", "held-out runs without small")


def test_a_stage_of_a_name_stands_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("discrepancy.tell.assemble.start_fitted", lambda simulator, run, parameters: ([], {}))
    monkeypatch.setattr("discrepancy.tell.assemble.misfits", lambda runs, residuals: {"": 0.0})
    came = [("nominal", 0.0), ("refit", 1.0), ("large", 2.0), ("gone", 3.0), ("large", 4.0), ("small", 5.0)]
    found = SimpleNamespace(
        **vars(search()),
        stages=[(name, {"m": value}) for name, value in came],
        simulator=None,
        dataset=SimpleNamespace(held_out=[]),
    )
    told = [(stage.name, stage.parameters["m"]) for stage in _stages(found, {"m": 9.0}, [])]
    assert told == [("nominal", 0.0), ("refit", 1.0), ("large", 4.0), ("small", 9.0)]
