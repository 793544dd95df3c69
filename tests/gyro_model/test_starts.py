"""States of effects that begin in motion: a parasitic mode against scipy, the reference, other forms, the contract."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from gyro_runner import Runner
from scipy.integrate import solve_ivp

from gyro_model.anatomy import Force, State
from gyro_model.build import build
from gyro_model.contract import check_effect
from gyro_model.copies import copied
from gyro_model.device import Device
from gyro_model.envelope import envelope_model
from gyro_model.errors import InputError
from gyro_model.model import Model, load_model
from gyro_model.quantities import Quantity, shape, start
from gyro_model.reference import sensitivities, simulate

Residual = Callable[[str, float, float], None]

MODEL = load_model()
MODE = MODEL.effect("parasitic_mode")
assert isinstance(MODE, Force)
M, KX, KY, D = 1.8e-7, 63.955, 95.92, 1.8e-6
COUPLING, FREQUENCY, Q = 5.0, 4100.0, 300.0
PLANT = {"m": M, "kxx": KX, "kyy": KY, "kxy": 0.0, "dxx": D, "dyy": D, "dxy": 0.0}
MOVING = {"x_start": 1e-6, "x_dot_start": -5e-3, "y_start": 4e-7, "y_dot_start": 3e-3}
COUPLED = {"parasitic_coupling": COUPLING, "parasitic_frequency": FREQUENCY, "parasitic_q": Q}
BEGUN = {"parasitic_start": 3e-6, "parasitic_dot_start": 0.02}
ALL = PLANT | MOVING | COUPLED | BEGUN
STATES = ("x", "x_dot", "y", "y_dot")


def test_two_modes_begun_in_motion(plant: Runner, residual: Residual) -> None:
    t, w = np.arange(2001) * 5e-6, 2 * np.pi * FREQUENCY
    matrix = [
        [0, 1, 0, 0],
        [-KX / M, -D / M, -COUPLING / M, 0],
        [0, 0, 0, 1],
        [-COUPLING / M, 0, -(w**2), -w / Q],
    ]
    begin = [MOVING["x_start"], MOVING["x_dot_start"], BEGUN["parasitic_start"], BEGUN["parasitic_dot_start"]]
    found = solve_ivp(
        lambda _, s: np.dot(matrix, s), (0, t[-1]), begin, method="DOP853", t_eval=t, rtol=1e-13, atol=1e-24
    )
    x = plant.run(ALL, t)["x"]
    # DOP853 at 1e-13 a step, of which there are a thousand, their errors adding up at random: 3e-12.
    residual("x", np.max(np.abs(x - found.y[0])) / np.max(np.abs(found.y[0])), 1e-11)


def test_reference_begins_where_the_fmu_does(plant: Runner, residual: Residual) -> None:
    t = np.arange(400) * 5e-6
    fmu, reference = plant.run(ALL, t), simulate(Device("begun", ALL), t, {})
    assert reference["parasitic"][0] == BEGUN["parasitic_start"]
    assert reference["parasitic_dot"][0] == BEGUN["parasitic_dot_start"]
    for name in STATES:
        # DOP853 at 1e-13 a sample, 400 of them, their errors adding up at random: 2e-12.
        residual(name, np.max(np.abs(fmu[name] - reference[name])) / np.max(np.abs(reference[name])), 5e-12)


@pytest.mark.parametrize("name", ["x_start", "parasitic_start", "parasitic_dot_start"])
def test_sensitivity_to_a_start_begins_at_one(name: str) -> None:
    # Linear: the derivative by a start is a motion by itself, the difference of two runs.
    t, device = np.arange(200) * 5e-6, Device("begun", ALL)
    derivative = sensitivities(device, (name,), t, {})[:, 0, 0]
    more = simulate(Device("more", ALL | {name: 2 * ALL[name]}), t, {})["x"] - simulate(device, t, {})["x"]
    # Each of three runs at 1e-13 a sample.
    assert np.max(np.abs(derivative * ALL[name] - more)) < 1e-10 * np.max(np.abs(more))


def test_starts_of_an_effect_that_is_off_change_no_bit(plant: Runner) -> None:
    t = np.arange(300) * 5e-6
    without, beside = plant.run(PLANT | MOVING, t), plant.run(PLANT | MOVING | BEGUN, t)
    for name, values in beside.items():
        assert np.array_equal(values, without[name]), name


def test_both_standards_offer_fixed_starts(runners: dict[int, Runner]) -> None:
    for runner in runners.values():
        for name in BEGUN:
            variable = runner.variables[name]
            assert (variable.causality, variable.variability, float(variable.start)) == ("parameter", "fixed", 0.0)
    assert not MODEL.tunable & set(BEGUN)


@pytest.mark.parametrize(("suffix", "turned"), [("_2", False), ("_y", True), ("_y_2", True)])
def test_a_copy_has_starts_of_its_own(suffix: str, turned: bool) -> None:
    copy = copied(MODE, suffix, turned=turned)
    assert [q.name for q in copy.starts] == [name + suffix for name in BEGUN]
    assert tuple(state.start for state in copy.states) == copy.starts
    check_effect(replace(copy, doc=MODE.doc), Model((*MODEL.effects, copy)))


def test_a_turned_copy_begins_on_the_other_axis(plant: Runner, tmp_path: Path) -> None:
    model = Model((*MODEL.effects, copied(MODE, "_y", turned=True)))
    t = np.arange(300) * 5e-6
    own = {f"{name}_y": value for name, value in (COUPLED | BEGUN).items()}
    turned = {"kxx": KY, "kyy": KX} | {
        f"{b}{rest}": MOVING[f"{a}{rest}"] for a, b in ("xy", "yx") for rest in ("_start", "_dot_start")
    }
    found = Runner(build(model).fmi3, tmp_path).run(PLANT | turned | own, t)
    wanted = plant.run(ALL, t)
    # The same sums in another order.
    assert np.allclose(found["y"], wanted["x"], rtol=0, atol=1e-12 * np.max(np.abs(wanted["x"])))


def test_the_envelope_form_offers_no_start() -> None:
    form = envelope_model()
    assert not set(BEGUN) & form.by_name.keys()
    with pytest.raises(InputError, match="'parasitic_start' is unknown"):
        form.parameter("parasitic_start")


def with_starts(first: Quantity | None, second: Quantity | None, *own: Quantity) -> Force:
    """The parasitic mode with other starts of its states, and parameters of them."""
    position, speed = MODE.states
    states: tuple[State, ...] = (replace(position, start=first), replace(speed, start=second))
    others = (q for q in MODE.parameters if q.role != "start")
    return replace(MODE, states=states, parameters=(*others, *own))


PLACE, SPEED = MODE.starts
LATE, SHAPE = replace(PLACE, start=1e-6), shape("at", "m", 0.0, "at", search=None)
READ = replace(MODE, force=(-MODE.sizes[0].symbol * PLACE.symbol, 0), energy=None)


@pytest.mark.parametrize(
    ("effect", "reason"),
    [
        (with_starts(PLACE, SPEED, PLACE), "parasitic_dot_start, is not among its parameters"),
        (with_starts(PLACE, None, PLACE, SPEED), "parasitic_dot_start is a start: give it to one state"),
        (with_starts(SPEED, None, SPEED), "is in m/s: give it in m, as the state is"),
        (with_starts(LATE, None, LATE), "is 1e-06 by default: let it be 0"),
        (with_starts(SHAPE, None, SHAPE), "is a shape: make it by"),
        (READ, "parasitic_start is a start, and a term uses it"),
    ],
)
def test_the_contract_says_what_a_start_is(effect: Force, reason: str) -> None:
    model = Model(tuple(effect if e.id == effect.id else e for e in MODEL.effects))
    with pytest.raises(InputError, match=reason):
        check_effect(effect, model)


def test_what_a_start_is() -> None:
    own = start("own", "m", "one", nominal=1e-6, display="µm")
    assert (own.role, own.start, own.search, own.typical) == ("start", 0.0, None, 1e-6)
    assert not set(MODE.starts) & set(MODE.sizes)
