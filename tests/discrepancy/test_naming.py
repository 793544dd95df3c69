"""The diagnosis end to end: the example sets, and sets that the FMU makes with a known effect hidden in it."""

import shutil
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pytest
from hidden_sets import MODEL, QUINTIC, RATE, SHORT, made, names, quintic

from discrepancy.data.dataset import Dataset, load_dataset
from discrepancy.diagnose import diagnose
from discrepancy.discover.term_search import TermSearch
from discrepancy.fit import openings
from discrepancy.fit.fitted import Fitted
from discrepancy.fit.refit import Fitter
from discrepancy.fit.simulate import Simulator
from discrepancy.name import exchange
from discrepancy.name.begin import begin
from discrepancy.name.checkpoint import digest, load, save
from discrepancy.name.columns import is_gauge, nameable
from discrepancy.name.extend import accept
from discrepancy.name.further import Wider
from discrepancy.name.look import look
from discrepancy.name.search import Given
from discrepancy.terms.effect_file import UNITS, Term
from discrepancy.terms.library import forms
from gyro_model import symbols
from gyro_model.model import EFFECTS_FOLDER, load_model, read_model

pytestmark = pytest.mark.minutes(15)

EXAMPLES = Path(__file__).parents[2].parent / "shared" / "examples"


def test_null() -> None:
    found = diagnose(made({}), MODEL)
    assert found.verdict == "nothing missing"
    assert not found.effects
    # White noise alone: both are estimates of the same level, from thousands of samples each: 1 % a deviation.
    assert found.misfit["final"] < 1.05 * found.misfit["noise_floor"]
    assert all(size > 0 for sizes in found.detectable.values() for size in sizes.values())


@pytest.mark.parametrize(
    ("effect", "hidden"),
    [
        ("cubic_stiffness", {"k3_x": 2e9, "k3_y": 2e9}),
        ("quadratic_stiffness", {"k2_x": 5e4, "k2_y": 5e4}),
        ("nonlinear_damping", {"d2_x": 1e5, "d2_y": 1e5}),
        ("actuator_misalignment", {"actuator_misalignment": 1e-3}),
        ("pickoff_nonlinearity", {"pickoff_inverse_gap": 2e4}),
        ("drive_feedthrough", {"feedthrough": 8.0}),
        ("angular_gain", {"angular_gain": 0.6}),
        ("amplifier_offset", {"offset_x": 1e-3, "offset_y": -1e-3}),
        ("damping_step", {"damping_step_factor": 1.5, "damping_step_time": 0.02}),
    ],
)
def test_one_effect_of_each_stage(effect: str, hidden: dict[str, float]) -> None:
    found = diagnose(made(hidden), MODEL)
    assert names(found) == {effect}
    values = found.effects[0].parameters
    for name, true in hidden.items():
        # Four deviations instead of the two of the interval: some twenty numbers are tested here.
        width = values[name].high - values[name].low
        assert abs(values[name].value - true) <= width
    assert found.misfit["final"] < 1.1 * found.misfit["noise_floor"]


def test_two_effects() -> None:
    found = diagnose(made({"k3_x": 2e9, "k3_y": 2e9, "feedthrough": 8.0}), MODEL)
    assert names(found) == {"cubic_stiffness", "drive_feedthrough"}


@pytest.mark.parametrize("more", [{}, {"feedthrough": 8.0}], ids=["all that there is", "another is there"])
def test_as_many_effects_as_are_allowed_are_a_doubt_where_more_is_left(more: dict[str, float]) -> None:
    found = diagnose(made({"k3_x": 2e9, "k3_y": 2e9, **more}), MODEL, max_effects=1)
    assert any("--max-effects allows no more" in doubt for doubt in found.doubts) is bool(more)


@pytest.mark.parametrize(
    "hidden",
    [
        {"actuator_delay": 4.6e-6, "amplifier_time_constant": 1.12e-6, "feedthrough": -6.3},
        {"actuator_delay": 3.92e-6, "k2_x": -9.6e4, "k2_y": -1.36e5, "offset_x": 4.4e-3, "offset_y": 4.2e-3},
    ],
    ids=["a lag beside a delay", "an offset beside forces that are even"],
)
def test_effects_that_others_take_the_place_of_to_first_order(hidden: dict[str, float], tmp_path: Path) -> None:
    found = diagnose(made(hidden), MODEL, further=TermSearch(tmp_path))
    assert found.verdict == "missing effects"
    assert {name for effect in found.effects for name in effect.parameters} == set(hidden)
    for name, value in hidden.items():
        [interval] = [effect.parameters[name] for effect in found.effects if name in effect.parameters]
        # Four deviations, where the interval has two.
        assert abs(interval.value - value) < interval.high - interval.low, name


def test_resonance_that_the_coupling_pulls_far() -> None:
    # c²/(m w²)/k = 20²/(1.8e-7 (2 pi 4983)²)/64 = 0.035: three hundred half-widths of the modes.
    hidden = {"parasitic_coupling": 20.0, "parasitic_frequency": 4983.0, "parasitic_q": 510.0}
    found = diagnose(made(hidden), MODEL)
    assert names(found) == {"parasitic_mode"}
    assert found.misfit["final"] < 1.1 * found.misfit["noise_floor"]
    [finding] = found.effects
    for name, value in hidden.items():
        # Four deviations, where the interval has two: a true value leaves it once in twenty.
        interval = finding.parameters[name]
        assert abs(interval.value - value) < interval.high - interval.low


def test_step_between_the_points_of_the_first_grid() -> None:
    hidden = {"damping_step_factor": 1.05, "damping_step_time": 0.0043, "k3_x": 2e8, "k3_y": 2e8}
    assert names(diagnose(made(hidden, samples=16_000), MODEL)) == {"damping_step", "cubic_stiffness"}


@pytest.mark.parametrize("tried", [10**9, 1000], ids=["whole runs", "beginnings first"])
def test_small_delay_and_small_lag_are_not_told_apart(tried: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(openings, "TRIED", tried)
    [found] = diagnose(made({"actuator_delay": 5e-9}), MODEL).effects
    # A filter of the voltage with as small a delay is a third one, of the record.
    assert {found.id, *found.either} - {"voltage_filter"} == {"actuator_delay", "amplifier_bandwidth"}


def test_rivals_that_are_lost_in_the_beginning_are_not_refitted(monkeypatch: pytest.MonkeyPatch) -> None:
    # To first order a resonance is much that it is not. In its place others are tried on a beginning of any run.
    monkeypatch.setattr(exchange, "QUARTER", 1)
    data = made({"parasitic_coupling": 5.4, "parasitic_frequency": 4957.0, "parasitic_q": 2585.0})

    def rivals_refitted(tried: int) -> int:
        monkeypatch.setattr(openings, "TRIED", tried)
        steps: list[str] = []
        assert names(diagnose(data, MODEL, progress=steps.append)) == {"parasitic_mode"}
        return sum("in place of" in step for step in steps)

    assert rivals_refitted(1000) == 0 < rivals_refitted(10**9)


@dataclass
class Once:
    """A further search that answers ``wider``, by default that all is wrong, the first time, and nothing then."""

    folder: Path
    wider: Wider | None = None
    calls: list[list[str]] = field(default_factory=list)

    def __call__(self, fitter: Fitter, at: Fitted, named: Sequence[str], room: int, least: float) -> Wider | None:
        self.calls.append(list(named))
        return self.wider or Wider(wrong=tuple(named)) if len(self.calls) == 1 else None


def fifth(number: int = 1) -> Term:
    """The same as a term of the library."""
    form = next(form for form in forms(2) if form.parts[0][0] == symbols.x**5)
    return Term(replace(form, id=f"discovered_{number}"), dict.fromkeys(UNITS, 1e-6))


def quintic_set(folder: Path) -> Dataset:
    """A set of a device with x⁵ and y⁵."""
    (folder / "lab").mkdir()
    quintic(folder / "lab")
    return made(QUINTIC, model=read_model(folder / "lab"), samples=SHORT)


def test_effect_that_a_further_search_adds_takes_the_place_of_a_wrong_name(tmp_path: Path) -> None:
    further = Once(tmp_path, Wider((fifth(),)))
    found = diagnose(quintic_set(tmp_path), MODEL, further=further)
    assert names(found) == {"discovered_1"}
    assert found.misfit["final"] < 1.1 * found.misfit["noise_floor"]
    assert len(further.calls) == 2


def test_where_a_name_is_given_up_an_effect_of_the_model_gets_its_turn(tmp_path: Path) -> None:
    cubic = (EFFECTS_FOLDER / "cubic_stiffness.py").read_text(encoding="utf-8")
    twin = cubic.replace("cubic_stiffness", "hardening").replace("k3_", "h3_")
    (tmp_path / "hardening.py").write_text(twin, encoding="utf-8")
    data, further = made({"k3_x": 2e9, "k3_y": 2e9}, samples=SHORT), Once(tmp_path)
    [found] = diagnose(data, load_model(tmp_path), further=further).effects
    [wrong], after = further.calls
    assert {found.id, wrong} == {"cubic_stiffness", "hardening"}
    assert wrong not in found.either
    assert after == [found.id]


def test_what_a_further_search_cannot_tell_from_its_term_is_its_either(tmp_path: Path) -> None:
    further = Once(tmp_path, Wider((fifth(1), fifth(2))))
    [found] = diagnose(quintic_set(tmp_path), MODEL, further=further).effects
    assert (found.id, found.either) == ("discovered_1", ("discovered_2",))
    assert found.next_experiment


def test_interrupted_after_a_further_search_resumes_with_the_same_answer(tmp_path: Path) -> None:
    file, (first, second) = tmp_path / "search.json", (tmp_path / name for name in ("first", "second"))
    wider = Wider((fifth(),))
    data = quintic_set(tmp_path)

    def keep(line: str) -> None:
        if line.startswith("held-out"):
            shutil.copy(file, tmp_path / "as it was")

    whole = diagnose(data, MODEL, progress=keep, checkpoint=file, further=Once(first, wider))
    shutil.move(tmp_path / "as it was", file)
    lines: list[str] = []
    # The files come from the checkpoint; of the two searches for terms, the second is left.
    again = Once(second, wider, [[]])
    resumed = diagnose(data, MODEL, progress=lines.append, checkpoint=file, further=again)
    assert lines[0].startswith("resumed with") and lines[0].endswith("discovered_1")
    assert [path.name for path in second.iterdir()] == ["discovered_1.py"]
    assert again.calls == [[], ["discovered_1"]]
    assert resumed.report() == whole.report()


def test_interrupted_search_resumes_with_the_same_answer(tmp_path: Path) -> None:
    data, file = made({"feedthrough": 8.0}, samples=SHORT), tmp_path / "search.json"
    whole = diagnose(data, MODEL, checkpoint=file)
    assert not file.exists()

    def interrupt(line: str) -> None:
        if line.startswith("held-out"):
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        diagnose(data, MODEL, progress=interrupt, checkpoint=file)
    lines: list[str] = []
    resumed = diagnose(data, MODEL, progress=lines.append, checkpoint=file)
    assert lines[0] == "resumed with drive_feedthrough"
    assert resumed.report() == whole.report()
    assert not file.exists()


def test_checkpoint_of_another_search_is_not_used(tmp_path: Path) -> None:
    file = tmp_path / "search.json"
    data = made({}, samples=SHORT)
    save(file, digest(made({}, seed=2, samples=SHORT), MODEL, {}), {})
    assert load(file, digest(data, MODEL, {}), data, MODEL) is None


@pytest.mark.skipif(not EXAMPLES.is_dir(), reason="the example sets are not part of a checkout")
@pytest.mark.parametrize("name", ["null", "duffing", "two"])
def test_example(name: str) -> None:
    answer = tomllib.loads((EXAMPLES / "ANSWERS.toml").read_text())[name]
    found = diagnose(load_dataset(EXAMPLES / name), MODEL)
    assert names(found) == set(answer["effects"])
    for key, value in ((k, v) for finding in found.effects for k, v in finding.parameters.items()):
        true = answer.get(key)
        if true is not None:
            assert value.low <= true <= value.high


def test_what_scales_both_voltages_alike_is_never_a_name() -> None:
    assert {e.id for e in MODEL.effects if is_gauge(e)} == {"parasitic_capacitance"}
    assert "parasitic_capacitance" not in {e.id for e in nameable(MODEL)}


def test_mains_are_taken_out_though_a_filter_for_flicker_leaves_little_of_them() -> None:
    data, rng = made({}, samples=14_000), np.random.default_rng(5)
    t = np.arange(14_000) / RATE
    humming = [replace(r, v=r.v + 1e-4 * np.sin(2 * np.pi * 50 * t[:, None] + rng.uniform(0, 6.28, 2)))
               for r in data.records]  # fmt: skip
    with Simulator(MODEL) as simulator:
        begun = begin(Given(replace(data, records=tuple(humming))), simulator)
    [(blemish, found)] = begun.blemishes
    assert blemish.id == "mains"
    # Noise of 2e-5 V over 14,000 samples leaves an amplitude to 2.4e-7 V, what the fit takes of it aside.
    assert found.levels["mains"].value == pytest.approx(1e-4, rel=0.02)


def accepted_first(hidden: dict[str, float]) -> tuple[str, dict[str, float]]:
    """What a search of data with ``hidden`` accepts first, and the parameters that it then has."""
    with Simulator(MODEL) as simulator:
        begun = accept(look(begin(Given(made(hidden)), simulator)), patient=False)
    return begun.accepted[0].id, dict(begun.at.parameters)


def test_a_force_that_saturates_deeply_is_found() -> None:
    peak = max(float(np.abs(r.u).max()) for r in made({}).fit)
    name, at = accepted_first({"force_saturation": 1 / (0.55 * peak)})
    assert name == "force_saturation"
    # The noise leaves 1e-4 of a limit that half of the peaks reach.
    assert at["force_saturation"] == pytest.approx(1 / (0.55 * peak), rel=1e-3)


@pytest.mark.parametrize("order", [2.0, 4.0])
def test_a_filter_of_the_force_is_found_with_its_order(order: float) -> None:
    # A delay, a lag and filters of other orders are alike to first order, and the first are fitted before it. One of
    # first order is no other than the amplifier's lag, which is then named.
    name, at = accepted_first({"force_filter": 4e-6, "force_filter_order": order})
    assert (name, at.get("force_filter_order")) == ("force_filter", order)
    assert at["force_filter"] == pytest.approx(4e-6, rel=1e-3)
