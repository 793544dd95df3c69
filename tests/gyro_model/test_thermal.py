"""Temperatures that lag, and a lag that moves with temperature, against formulas; in what order laws act."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from gyro_runner import Runner

from gyro_model.device import Device
from gyro_model.dynamics import Dynamics
from gyro_model.effects.thermal_lag import EFFECT as THERMAL_LAG
from gyro_model.errors import InputError
from gyro_model.model import EFFECTS_FOLDER, load_model

Residual = Callable[[str, float, float], None]
EPS = np.finfo(float).eps

TEMPERATURES = ("temperature_structure", "temperature_circuit")
T = np.arange(401) * 5e-6
K = np.arange(401)
FIRST, SECOND = 80, 240
STEPPED = np.where(K < FIRST, 300.0, np.where(K < SECOND, 350.0, 260.0))
MOVING = {"x_start": 1e-6, "y_start": -0.7e-6}


def settling(lag: float) -> np.ndarray:
    """Solution of lag·T' = temperature - T over the pieces of STEPPED."""
    if lag == 0.0:
        # The value of the step that has just ended.
        return STEPPED[np.maximum(K - 1, 0)]
    first = 350.0 + (300.0 - 350.0) * np.exp(-np.maximum(T - T[FIRST], 0.0) / lag)
    at_second = 350.0 + (300.0 - 350.0) * np.exp(-(T[SECOND] - T[FIRST]) / lag)
    second = 260.0 + (at_second - 260.0) * np.exp(-np.maximum(T - T[SECOND], 0.0) / lag)
    return np.where(K <= FIRST, 300.0, np.where(K <= SECOND, first, second))


@pytest.mark.parametrize(
    ("structure", "circuit"), [(3e-4, 0.0), (0.0, 1e-7), (60.0, 2e-6), (1e-300, 5e-3), (0.02, 0.02)]
)
def test_temperatures_follow_exponentially(plant: Runner, structure: float, circuit: float, residual: Residual) -> None:
    own = {"structure_lag": structure, "circuit_lag": circuit}
    out = plant.run(own, T, {"temperature": STEPPED}, TEMPERATURES)
    for name, lag in zip(TEMPERATURES, own.values(), strict=True):
        # Half a unit in the last place of 350 K at each of 2000 internal steps: as a random walk, √2000/2 = 22.
        # Times of up to 2 ms are good to 2 ms · EPS, times the slope of at most 350 K/lag.
        limit = 25 * EPS + (2e-3 * EPS / lag if lag > 1e-9 else 0.0)
        residual(name, np.max(np.abs(out[name] - settling(lag))) / 350.0, limit)


def test_temperature_of_the_first_step_is_that_of_the_start(plant: Runner) -> None:
    # Initialised at 298.15 K; the importer gives 350 K with its first step.
    slave = plant._started({"structure_lag": 1.0, "circuit_lag": 2.0}, {})
    reference = {name: plant.variables[name].valueReference for name in ("temperature", *TEMPERATURES)}
    try:
        slave.setFloat64([reference["temperature"]], [350.0])
        assert plant._step(slave)(0.0, 5e-6) == 0
        assert slave.getFloat64([reference[name] for name in TEMPERATURES]) == [350.0, 350.0]
    finally:
        slave.freeInstance()


def test_lagging_temperatures_do_not_depend_on_communication_steps(plant: Runner) -> None:
    own = {**MOVING, "structure_lag": 3e-4, "circuit_lag": 1e-4, "tck": 1e-3, "tcp": 1e-8, "thermal_force": 1e4}
    fine, inputs = np.arange(1001) * 1e-6, np.where(np.arange(1001) < 500, 300.0, 340.0)
    names = ("v_x", "v_y", "x", "y_dot", *TEMPERATURES)
    short = plant.run(own, fine, {"temperature": inputs}, names)
    long = plant.run(own, fine[::20], {"temperature": inputs[::20]}, names)
    for name in names:
        assert np.array_equal(short[name][::20], long[name]), name


@pytest.mark.parametrize("tau", [0.0, 3e-6])
def test_lag_moves_with_temperature(plant: Runner, tau: float) -> None:
    # 0.25 K above at 2 µs/K, exact in binary: the same as an amplifier slower by 0.5 µs.
    at = {"temperature": np.full(len(T), 298.15 + 0.25)}
    warm = plant.run({**MOVING, "amplifier_time_constant": tau, "tcp": 2e-6}, T, at)
    slower = plant.run({**MOVING, "amplifier_time_constant": tau + 5e-7}, T, at)
    # 298.15 + 0.25 - 298.15 is 0.25 to 6e-14: a relative 2e-13 of the lag, which is ωτ = 0.08 of a volt.
    assert np.max(np.abs(warm["v_x"] - slower["v_x"])) <= 1e-13


def test_no_lag_where_it_would_be_negative(plant: Runner) -> None:
    # 10 K below at 1 µs/K.
    at = {"temperature": np.full(len(T), 288.15)}
    cold = plant.run({**MOVING, "amplifier_time_constant": 4e-6, "tcp": 1e-6}, T, at)
    ideal = plant.run(MOVING, T, at)
    for name in cold:
        assert np.array_equal(cold[name], ideal[name]), name


def test_voltage_across_the_end_of_the_lag(plant: Runner, residual: Residual) -> None:
    # τ = 4 µs, none, 4 µs: while there is none the voltage is ideal, from then on it lags from there.
    warm = np.where((T > 5e-4) & (T < 1.2e-3), 288.15, 298.15)
    own = {**MOVING, "amplifier_time_constant": 4e-6, "tcp": 1e-6}
    v, ideal = plant.run(own, T, {"temperature": warm}), plant.run(MOVING, T)
    none = (T > 5.1e-4) & (T <= 1.2e-3)
    assert np.array_equal(v["v_x"][none], ideal["v_x"][none])
    late = T > 1.3e-3
    always = plant.run({**MOVING, "amplifier_time_constant": 4e-6}, T)
    # 100 µs after it began anew, e^-25 of the difference of ωτ = 0.1 V is left, beside the rounding of 0.5 V.
    residual("voltage", np.max(np.abs(v["v_x"] - always["v_x"])[late]), 0.1 * np.exp(-25) + EPS)


def test_device_with_the_law_alone_lags() -> None:
    device = Device("d", {"tcp": 1e-8})
    acting = {e.id for e in device.model.effects if device.acts(e) and not e.nominal}
    assert acting == {"thermal_phase", "amplifier_bandwidth"}


HEATING = '''"""Self-heating of the structure (a test)."""

from gyro_model.anatomy import Law, Limit
from gyro_model.quantities import size
from gyro_model.symbols import kxx, temperature_structure

RISE = size("rise", "K", "self-heating")

EFFECT = Law(
    id="warming",
    parameters=(RISE,),
    changes={temperature_structure: temperature_structure + RISE.symbol},
    signature="warmer",
    host_experiment="any",
    limits=(Limit(why="1 K", at={"rise": 1.0}, gives={"temperature_structure": 299.15}),),
)
'''


def heating(folder: Path, rise: str) -> Path:
    """A folder with a law that adds ``rise`` to the temperature of the structure."""
    (folder / "warming.py").write_text(HEATING.replace("RISE.symbol", rise), encoding="utf-8")
    return folder


def test_a_law_comes_after_those_that_change_what_it_reads(tmp_path: Path) -> None:
    model = load_model(heating(tmp_path, "RISE.symbol"))
    order = [law.id for law in model.laws]
    # By name it would come last.
    assert order.index("warming") < min(order.index(name) for name in ("thermal_damping", "thermal_stiffness"))
    dynamics = Dynamics(("warming", "thermal_stiffness"), model)
    assert {"rise", "temperature"} <= {symbol.name for symbol in dynamics.rates[1].free_symbols}


def test_laws_in_a_circle_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"thermal_stiffness, warming: each law reads .* break the circle"):
        load_model(heating(tmp_path, "RISE.symbol * kxx"))


def test_a_law_on_the_delay_is_refused(tmp_path: Path) -> None:
    law = HEATING.replace("import size\n", "import size\nfrom gyro_model.effects.actuator_delay import DELAY\n")
    law = law.replace("{temperature_structure: temperature_structure", "{DELAY.symbol: DELAY.symbol")
    (tmp_path / "warming.py").write_text(law, encoding="utf-8")
    with pytest.raises(InputError, match="a law can't change actuator_delay, for which past forces are kept"):
        load_model(tmp_path)


def test_a_quantity_lags_once(tmp_path: Path) -> None:
    text = (EFFECTS_FOLDER / f"{THERMAL_LAG.id}.py").read_text(encoding="utf-8")
    text = text.replace("thermal_lag", "slow").replace('"structure_lag"', '"lag_1"').replace('"circuit_lag"', '"lag_2"')
    (tmp_path / "slow.py").write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match="lag of 'temperature_structure' is defined twice"):
        load_model(tmp_path)
