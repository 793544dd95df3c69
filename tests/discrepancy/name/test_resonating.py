"""Structures of more modes than the model has, of which no part is the FMU's."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from blank_search import blank_search
from structures import Structure, chain, drive

from discrepancy.clock import OutOfTime
from discrepancy.criteria import Criteria
from discrepancy.data.absorbers import Absorber, Carried
from discrepancy.data.dataset import Dataset
from discrepancy.data.linear_start import linear_start
from discrepancy.data.record import make_record
from discrepancy.diagnose import diagnose
from discrepancy.fit.continuation import ASTRAY
from discrepancy.fit.refit import Fitter
from discrepancy.fit.simulate import Simulator
from discrepancy.name import resonating
from discrepancy.name.begin import FIRST
from discrepancy.name.columns import Library
from discrepancy.name.resonators import STEEPER, Beside, begun_with
from discrepancy.name.resonators import resonators as told_resonators
from discrepancy.tell.answer import Diagnosis, Value
from gyro_model.model import load_model


def answer(
    structure: Structure, *, begin: int = 0, released: bool = False, sense_gain_x: float = 1.0,
    accelerations: bool = False, dxx: float = 6.5, **more: Any,
) -> Diagnosis:  # fmt: skip
    fit = structure.record("a", "fit", 1, 1e-3, accelerations=accelerations)
    held_out = structure.record("b", "held-out", 2, 1e-3, begin, released=released, accelerations=accelerations)
    held_out = replace(held_out, reference=fit.reference)
    sense_gain_x *= fit.reference**fit.order
    # Values of a fit of one mode, as the record's own response gives them where nobody believes any.
    nominal = {"m": 0.68, "kxx": 4.26e4, "dxx": dxx, "sense_gain_x": sense_gain_x}
    dataset = Dataset(Path("here"), nominal, (fit, held_out), estimated=("m", "kxx", "dxx"))
    return diagnose(dataset, load_model(), **more)


def resonators(found: Diagnosis) -> list[Value]:
    """The frequencies of the two that are named, and nothing else, lowest first."""
    assert found.verdict == "missing effects"
    assert {effect.id for effect in found.effects} == {"parasitic_mode", "parasitic_mode_2"}
    own = {name: value for effect in found.effects for name, value in effect.parameters.items()}
    return sorted((own["parasitic_frequency"], own["parasitic_frequency_2"]), key=lambda f: f.value)


def test_a_chain_of_masses_is_a_mass_with_parasitic_modes() -> None:
    structure = chain()
    found = answer(structure)
    for told, true in zip(resonators(found), structure.frequencies(held=[0]), strict=True):
        # Twice the 95 % interval: one of 16,000 leaves it by chance.
        assert abs(told.value - true) < told.high - told.low
        assert told.high - told.low < 1e-3 * true
    for name, true in (("m", 1.0), ("kxx", 7e4), ("dxx", 5.0)):
        assert abs(found.device[name].value / true - 1) < 1e-3
    assert all(effect.probability > 0.9 for effect in found.effects)


@pytest.mark.parametrize(("driven", "sensed", "sign"), [(0, 2, 1.0), (1, 0, -1.0)])
def test_so_it_is_where_the_sensor_is_elsewhere_than_the_force(driven: int, sensed: int, sign: float) -> None:
    found = answer(chain(driven, sensed), sense_gain_x=sign)
    assert found.verdict == "missing effects"
    assert {effect.id for effect in found.effects} == {"parasitic_mode", "parasitic_mode_2"}
    assert all(effect.probability > 0.9 for effect in found.effects)
    assert not found.doubts
    own = {name: value for effect in found.effects for name, value in effect.parameters.items()}
    for name in ("parasitic_drive", "parasitic_drive_2"):
        # No fit moves it: it has no interval, and is told all the same.
        assert own[name].low == own[name].value == own[name].high == found.parameters[name] != 0
    # Noise of 1e-3, whose rms over 6000 samples is known to 1 %.
    assert found.misfit["final"] < 1.05e-3


def test_accelerometers_tell_it_as_well() -> None:
    structure = chain()
    found = answer(structure, accelerations=True)
    for told, true in zip(resonators(found), structure.frequencies(held=[0]), strict=True):
        assert abs(told.value - true) < told.high - told.low
    assert found.device["m"].value == pytest.approx(1.0, rel=1e-3)
    # Noise of 1e-3, whose rms over 6000 samples is known to 1 %.
    assert found.misfit["final"] < 1.1e-3


@pytest.mark.parametrize(("sensed", "accelerations"), [(0, False), (0, True), (2, False)])
def test_a_drive_that_nothing_holds_carries_resonators_as_well(sensed: int, accelerations: bool) -> None:
    structure = drive(sensed=sensed)
    fit, held_out = (structure.record(name, role, seed, 1e-3, accelerations=accelerations)
                     for name, role, seed in (("a", "fit", 1), ("b", "held-out", 2)))  # fmt: skip
    held_out = replace(held_out, reference=fit.reference)
    nominal = linear_start([fit], (fit.reference**fit.order,))
    assert nominal is not None
    found = diagnose(Dataset(Path("here"), nominal, (fit, held_out), estimated=("m", "kxx", "dxx")), load_model())
    told = resonators(found)
    if not sensed:
        # Where force and sensor are one mass, these are what the others do while it is held.
        for value, true in zip(told, structure.frequencies(held=[0]), strict=True):
            assert abs(value.value - true) < value.high - value.low
        assert found.device["m"].value == pytest.approx(1.0, rel=2e-3)
    # Noise of 1e-3, whose rms over 6000 samples is known to 1 %.
    assert found.misfit["final"] < 1.1e-3


def test_a_run_may_begin_in_mid_motion() -> None:
    found = answer(chain(), begin=1500)
    assert {effect.id for effect in found.effects} == {"parasitic_mode", "parasitic_mode_2"}
    # Six states of the start are told by its first 50 samples, which adds less than the noise itself.
    assert found.misfit["final"] < 1.5e-3


def test_a_free_decay_from_there_tells_how_the_modes_began() -> None:
    found = answer(chain(), begin=1500, released=True)
    assert found.verdict == "missing effects"
    assert {effect.id for effect in found.effects} == {"parasitic_mode", "parasitic_mode_2"}
    # With the modes at rest 0.44 of it is left, 46 times the noise.
    assert found.misfit["final"] < 1.5 * found.misfit["noise_floor"]


def test_what_there_was_time_for_stands(monkeypatch: pytest.MonkeyPatch) -> None:
    """One of two fits, with joints and without."""
    fitted, own = [], resonating.fitted_from

    def once(whole: Any, begun: Any) -> Any:
        if fitted:
            raise OutOfTime
        fitted.append(whole.off(begun))
        return own(whole, begun)

    monkeypatch.setattr(resonating, "fitted_from", once)
    # A damping of fifty times the true one, as a fit of one mode may end at, is not taken for that of the mass.
    found = answer(chain(), dxx=250.0)
    assert fitted[0] < ASTRAY
    assert len(resonators(found)) == 2


def test_a_fit_of_all_shapes_with_which_no_whole_run_ends_gives_way_to_the_one_before(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    tried: list[Any] = []
    own = Beside.taken

    def refused(self: Beside, search: Any, best: Any) -> Any:
        tried.append(best)
        return None if len(tried) == 1 else own(self, search, best)

    monkeypatch.setattr(resonating, "with_all_shapes", lambda _, best: best._replace())
    monkeypatch.setattr(Beside, "taken", refused)
    assert len(resonators(answer(chain()))) == 2
    assert tried[0] is not tried[1]


def test_without_the_time_for_it_the_model_stays_as_it_was() -> None:
    lines: list[str] = []
    found = answer(chain(), criteria=Criteria(time_limit=1), progress=lines.append)
    assert f"out of time: {FIRST}" in lines
    assert found.verdict == "unexplained"
    assert any(FIRST in doubt for doubt in found.doubts)


def test_no_load_is_damped_as_the_tone_of_a_loop_would_be() -> None:
    rng = np.random.default_rng(1)
    record = make_record(
        "1", np.arange(800) / 100, rng.standard_normal(800), rng.standard_normal(800), sample_rate=100.0
    )
    device = {"m": 1.0, "kxx": 6e3, "dxx": 1.0, "sense_gain_x": 1.0}
    one = np.array([3e3])

    def told(*joints: float) -> Carried:
        absorbers = tuple(Absorber(10.0 + k, 50.0, one, np.array([joint]), 0.0) for k, joint in enumerate(joints))
        return Carried(1.0, np.array([[6e3]]), np.array([[1.0]]), absorbers, np.zeros(1), np.zeros(1))

    with Simulator(load_model(), jobs=1) as simulator:
        whole = Fitter(simulator, (record,))
        search = blank_search(
            whole=whole,
            at=whole.begin(device),
            library=Library(whole),
            simulator=simulator,
            nominal=device,
            terms=(),
            given=SimpleNamespace(copies={}),
        )
        [own] = told_resonators(search, told(0.99))
        assert own.joint == 0.99
        # Damped along its spring by a hundred times all of its damping, the other way.
        assert told_resonators(search, told(-120.0)) == []
        [own] = told_resonators(search, told(-120.0, 0.3))
        assert own.joint == 0.3


def test_a_friction_beside_loads_is_higher_near_rest_where_that_is_told_and_not_much_steeper_than_its_grid() -> None:
    rng = np.random.default_rng(1)
    record = make_record(
        "1", np.arange(800) / 100, rng.standard_normal(800), rng.standard_normal(800), sample_rate=100.0
    )
    device = {"m": 1.0, "kxx": 6e3, "dxx": 1.0, "sense_gain_x": 1.0}
    one = np.array([[1.0]])
    with Simulator(load_model(), jobs=1) as simulator:
        whole = Fitter(simulator, (record,))
        at = whole.begin(device)
        search = blank_search(
            whole=whole, at=at, library=Library(whole), simulator=simulator, nominal=device, terms=(),
            given=SimpleNamespace(copies={}),
        )  # fmt: skip
        for excess in (None, (0.6, 0.02)):
            told = Carried(1.0, 6e3 * one, one, (), np.array([0.1]), np.zeros(1), excess)
            begun = begun_with(search, whole, told, [], at, jointed=False)
            own, [friction] = begun.at.parameters, begun.taken
            assert own["friction_x"] == 0.1
            assert (own["stribeck"], own["stribeck_speed"])[: 2 * bool(excess)] == (excess or ())
            assert own["stribeck"] == (excess or (0.0,))[0]
            [speed] = [free for free in friction.free(whole.period) if free.name == "friction_speed"]
            assert speed.low == pytest.approx(own["friction_speed"] / STEEPER)
