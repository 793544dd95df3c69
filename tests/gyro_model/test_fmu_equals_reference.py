"""The FMU against the reference simulation (DOP853, no C), for every effect alone and for all together."""

from collections.abc import Callable, Mapping

import numpy as np
import pytest
from gyro_runner import Floats, Runner
from philox_oracle import drawn
from sympy import sympify
from sympy.core.function import Application

from gyro_model.anatomy import Effect, Follow, Force, Lag, Law
from gyro_model.device import Device
from gyro_model.effect_points import IDS, MODEL, active_parameters
from gyro_model.reference import simulate

Residual = Callable[[str, float, float], None]

N, PERIOD, SEED = 161, 5e-6, 21
T = np.arange(N) * PERIOD
START = {"x_start": 1.5e-6, "x_dot_start": 4e-3, "y_start": -0.8e-6, "y_dot_start": -9e-3, "seed": SEED}

# The reference integrates to 1e-12 a sample at most; both round 1e-16 a step. Measured 2e-14 at 5 µs, 8e-13 at 10 µs.
ROUNDING = 1e-12
# Where a force changes within a step, that step is halved until its error is estimated below 1e-12 of the motion: a
# function that saturates or has a corner does so about ten times in the run.
HALVED = 1e-11
# The lag takes the motion as its quintic Hermite polynomial over an internal step: off by (ωh)⁶/46080 at 5 µs, 3.8 kHz.
LAG = 6e-11


def driven() -> dict[str, Floats]:
    """Every input at random: forces of 20 µN, rates of 10 rad/s, and surroundings that differ from their start."""
    rng = np.random.default_rng(SEED)
    sizes = {"u_x": 2e-5, "u_y": 2e-5, "omega_z": 10.0, "temperature": 5.0, "a_x": 20.0, "a_y": 20.0, "v_bias": 2.0}
    return {
        name: size * rng.standard_normal(N) + (310.0 if name == "temperature" else 0.0) for name, size in sizes.items()
    }


def parameters_of(effect: Effect, rng: np.random.Generator) -> dict[str, float]:
    """What switches the effect on; an event falls inside the run, inside an internal step and inside a tick."""
    chosen = active_parameters(effect, rng)
    if isinstance(effect, Law) and effect.event is not None:
        chosen[effect.event.name] = float((rng.integers(200, 600) + rng.uniform(0.2, 0.8)) * 1e-6)
    return chosen


def hosts(effect: Effect) -> list[Effect]:
    """What must act so that an effect shows which changes nothing nominal: the effects that read what it changes."""
    changed = effect.changes if isinstance(effect, Law) else effect.follows if isinstance(effect, Follow) else ()
    readers = [e for e in MODEL.effects if e.symbols & set(changed) and e is not effect]
    return [] if any(e.nominal for e in readers) else readers


def tolerance(effect: Effect) -> float:
    """Relative to the largest amplitude of a channel."""
    lags = any(isinstance(e, Lag) or any(isinstance(w, Lag) for w in woken(e)) for e in (effect, *hosts(effect)))
    bends = isinstance(effect, Force) and any(sympify(expr).has(Application) for expr in effect.terms().values())
    return LAG if lags else HALVED if bends else ROUNDING


def woken(effect: Effect) -> list[Effect]:
    """The effects that act because this one does."""
    return [e for e in MODEL.effects if effect in MODEL.wakers(e)]


def compare(plant: Runner, parameters: Mapping[str, float], limit: float, residual: Residual) -> dict[str, Floats]:
    """Asserts that FMU and reference agree; gives what the FMU said."""
    inputs = driven()
    fmu = plant.run(parameters, T, inputs)
    reference = simulate(Device("test", parameters), T, inputs, drawn(SEED, N))
    for name, values in fmu.items():
        residual(name, np.max(np.abs(values - reference[name])) / np.max(np.abs(reference[name])), limit)
    return fmu


@pytest.fixture(scope="module")
def neutral(plant: Runner) -> dict[str, Floats]:
    return plant.run(START, T, driven())


@pytest.mark.parametrize("effect", MODEL.effects, ids=IDS)
def test_one_effect(effect: Effect, plant: Runner, neutral: dict[str, Floats], residual: Residual) -> None:
    rng = np.random.default_rng(22)
    own = parameters_of(effect, rng)
    host = {name: value for e in hosts(effect) for name, value in parameters_of(e, rng).items()}
    fmu = compare(plant, START | host | own, tolerance(effect), residual)
    if not effect.nominal:
        assert own, "no limit case names a size"
        without = plant.run(START | host, T, driven()) if host else neutral
        assert any(not np.array_equal(fmu[name], without[name]) for name in fmu), "the effect does not act"


def test_all_effects_together(plant: Runner, residual: Residual) -> None:
    rng = np.random.default_rng(23)
    together = {name: value for effect in MODEL.effects for name, value in parameters_of(effect, rng).items()}
    # Rounding to whole steps turns any difference into a jump of a step, and is compared above.
    together["adc_lsb"] = 0.0
    # Stop and friction bend the motion within a step more than a sine does, and the lag's polynomial with it.
    compare(plant, START | together, 2 * LAG, residual)


# Within a sample period, on the grid, less than a tick beside it, across some periods.
@pytest.mark.parametrize("delay", [3e-7, 3.4e-6, 5e-6, 5e-6 + 4e-13, 17.25e-6, 1.23456e-4])
@pytest.mark.parametrize("tau", [0.0, 2e-6])
def test_delay_is_exact(plant: Runner, residual: Residual, delay: float, tau: float) -> None:
    # The feedthrough makes the lag's input jump with the delayed force.
    own = {"actuator_delay": delay, "amplifier_time_constant": tau, "feedthrough": 1e4}
    compare(plant, START | own, LAG if tau else ROUNDING, residual)


@pytest.mark.parametrize("effect", [e for e in MODEL.effects if not e.nominal], ids=lambda e: e.id)
def test_neutral_size_changes_no_bit(effect: Effect, plant: Runner, neutral: dict[str, Floats]) -> None:
    # Shapes alone switch nothing, and no other effect feels a size at neutral.
    sizes = {q.name: q.start for q in effect.sizes}
    shapes = {q.name: min(max(0.7 * q.start + 1e-4, q.low), q.high) for q in effect.parameters if q.role == "shape"}
    fmu = plant.run(START | sizes | shapes, T, driven())
    for name, values in fmu.items():
        assert np.array_equal(values, neutral[name]), name


# Far below a step, about it, some, many: stiffness and damping settle, bend or move evenly within a step. Beside a
# cubic spring each step is integrated by its stages instead.
@pytest.mark.parametrize("lag", [3e-7, 5e-6, 2e-5, 1e-4, 1e-3, 1.0])
@pytest.mark.parametrize("cubic", [0.0, 1e10])
def test_laws_within_a_step(plant: Runner, residual: Residual, lag: float, cubic: float) -> None:
    own = {"structure_lag": lag, "tck": -3e-4, "tcd": 3e-2, "k3_x": cubic, "ageing": 1e-3, "ageing_time": 1.0}
    compare(plant, START | own, HALVED, residual)


def compare_turning(plant: Runner, effects: dict[str, float], rate: float, residual: Residual) -> None:
    """At a largest ``rate`` [rad/s]."""
    inputs = driven()
    inputs["omega_z"] *= rate / np.max(np.abs(inputs["omega_z"]))
    fmu = plant.run(START | effects, T, inputs)
    reference = simulate(Device("test", START | effects), T, inputs, drawn(SEED, N))
    for name, values in fmu.items():
        residual(name, np.max(np.abs(values - reference[name])) / np.max(np.abs(reference[name])), ROUNDING)


# Within what the tabulated propagator holds for, about its limit, far beyond.
@pytest.mark.parametrize("rate", [1e-3, 1.0, 15.9, 16.1, 300.0])
@pytest.mark.parametrize("effects", [{}, {"frame_rotation": 1.0, "angular_gain": 0.3}])
def test_any_rate(plant: Runner, residual: Residual, rate: float, effects: dict[str, float]) -> None:
    compare_turning(plant, effects, rate, residual)


MODE = {"parasitic_coupling": 5.0, "parasitic_frequency": 4200.0, "parasitic_q": 30.0, "parasitic_start": 1e-8}
STIFF = {"parasitic_coupling": 40.0, "parasitic_frequency": 9e4, "parasitic_q": 30.0, "parasitic_drive": 0.3}


# Likewise of the table with the states of effects; the last mode turns by 2.8 rad a step, which is halved before its
# series.
@pytest.mark.parametrize("rate", [1.0, 15.9, 300.0])
@pytest.mark.parametrize(
    "mode",
    [MODE, MODE | {"parasitic_joint": 1.0, "parasitic_drive": 0.4, "frame_rotation": 1.0, "angular_gain": 0.3}, STIFF],
    ids=["mode", "mode in a joint, turning frame", "stiff"],
)
def test_any_rate_beside_a_mode(plant: Runner, residual: Residual, rate: float, mode: dict[str, float]) -> None:
    compare_turning(plant, mode, rate, residual)


# On a sample, between two, anywhere, less than a tick after and before a sample, before the start, at it.
@pytest.mark.parametrize("time", [4e-4, 4.03e-4, 4.0349e-4, 4e-4 + 4e-13, 4e-4 - 4e-13, -1.0, 0.0])
def test_event_anywhere(plant: Runner, residual: Residual, time: float) -> None:
    compare(plant, START | {"damping_step_factor": 300.0, "damping_step_time": time}, ROUNDING, residual)


def test_other_sample_periods_and_internal_steps(plant: Runner, residual: Residual) -> None:
    own = START | {"internal_step": 2.5e-6, "sample_period": 1e-5, "thermal_force": 1e4, "sense_noise": 1e-3}
    t, inputs = np.arange(81) * 1e-5, {name: values[:81] for name, values in driven().items()}
    fmu, reference = plant.run(own, t, inputs), simulate(Device("test", own), t, inputs, drawn(SEED, 81))
    for name, values in fmu.items():
        residual(name, np.max(np.abs(values - reference[name])) / np.max(np.abs(reference[name])), ROUNDING)
