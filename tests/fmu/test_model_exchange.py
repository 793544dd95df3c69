"""Model exchange: the FMU's equations under other people's integrators, against its own co-simulation."""

import ctypes as ct
import random
from collections.abc import Mapping, Sequence

import fmpy
import numpy as np
import pytest
from fmu_importer import ERROR, NOISY, OK, Exchange, Fmu, Instance
from scipy.integrate import solve_ivp

from tests.soak import FORMS, TICK, random_device, random_inputs

PERIOD = 2e-5
START = {"x_start": 1e-6, "y_start": -4e-7, "sample_period": PERIOD}
OUTPUTS = ("v_x", "v_y", "x", "y", "x_dot", "y_dot", "temperature_structure", "temperature_circuit")
# What acts, beside the reference device, and which inputs change at the samples 20 and 37.
DEVICES: dict[str, dict[str, float]] = {
    "plain": {},
    "curved": {"k3_x": 8e12, "d2_x": 8e5, "softening": 1e-3, "actuator_a2": 1e4, "pickoff_inverse_gap": 2e5},
    "noise": {"thermal_force": 1e3, "sense_noise": 1e-4, "flicker_noise": 1e-3, "sampling_jitter": 1e-8, "seed": 5},
    "lags": {"amplifier_time_constant": 3e-6, "structure_lag": 3e-4, "circuit_lag": 1e-4, "tck": 1e-3, "tcp": 1e-8},
    "event": {"damping_step_factor": 25.0, "damping_step_time": 7.123e-4, "charging_voltage": 2.0, "softening": 1e-3},
    "delay": {"actuator_delay": 47.3e-6, "feedthrough": 1e3},
    "turning": {"frame_rotation": 1.0, "angular_gain": 0.8},
    "mode": {"parasitic_coupling": 8.0, "parasitic_frequency": 4100.0},
    "begun mode": {"parasitic_coupling": 8.0, "parasitic_start": 2e-6, "parasitic_dot_start": -0.02},
    "play": {"play": 7e-7},
    "memories": {
        "thermal_hysteresis": 0.1,
        "structure_lag": 3e-4,
        "circuit_lag": 1e-4,
        "relaxation": 1e-4,
        "relaxation_time": 4e-4,
    },
    "walk": {"bias_walk": 1.0, "turn_on": 0.1, "seed": 3},
    "busy": {**NOISY, "damping_step_time": 7.123e-4},
}
SAMPLES = 60
NEAR = 2 * TICK  # what a time of some seconds may be off by, and no sample is from another instant


def inputs(k: int) -> dict[str, float]:
    """Held from sample ``k`` on."""
    if k < 20:
        return {"u_x": 1e-6, "u_y": 0.0, "omega_z": 0.0, "temperature": 300.0, "a_x": 0.0, "v_bias": 3.0}
    return {
        "u_x": -2e-6,
        "u_y": 1e-6,
        "omega_z": 50.0 if k < 37 else -20.0,
        "temperature": 330.0,
        "a_x": 9.0,
        "v_bias": 5.0,
    }


def co_simulated(fmu: Fmu, device: Mapping[str, float]) -> np.ndarray:
    with Instance(fmu) as gyro:
        gyro.start(**{**START, **device, **inputs(0)})
        rows = [gyro.get(*OUTPUTS)]
        for k in range(SAMPLES):
            gyro.set(**inputs(k))
            assert gyro.step(k * PERIOD, PERIOD) == OK, gyro.log
            rows.append(gyro.get(*OUTPUTS))
    return np.array(rows)


def exchanged(fmu: Fmu, device: Mapping[str, float]) -> np.ndarray:
    """The same by scipy's DOP853, the importer's part played as the standard says."""
    times = [k * PERIOD for k in range(1, SAMPLES + 1)]
    with Exchange(fmu) as gyro:
        gyro.start(**{**START, **device, **inputs(0)})
        return integrated(gyro, 0.0, times, [inputs(k) for k in range(1, SAMPLES + 1)], OUTPUTS)


def integrated(
    gyro: Exchange, time: float, times: Sequence[float], changes: Sequence[Mapping[str, float]], outputs: Sequence[str]
) -> np.ndarray:
    """``outputs`` of an instance just started, at ``time`` and at each of ``times`` [s], where ``changes`` are set."""
    _, event = gyro.update()
    rows, k = [gyro.get(*outputs)], 0
    states = np.array(gyro.array("GetContinuousStates"))
    nominals = np.array(gyro.array("GetNominalsOfContinuousStates"))

    def rate(t: float, s: np.ndarray) -> list[float]:
        gyro.move(t, s)
        return gyro.rates()

    while k < len(times):
        assert gyro.call("EnterContinuousTimeMode") == OK, gyro.log
        # The importer's time of a sample may be a rounding off.
        due = abs(event - times[k]) < NEAR
        end = event if due else min(event, times[k])
        found = solve_ivp(rate, (time, end), states, method="DOP853", rtol=1e-12, atol=1e-14 * nominals)
        time = end
        gyro.move(time, found.y[:, -1])
        assert gyro.call("EnterEventMode") == OK, gyro.log
        changing = abs(time - times[k]) < NEAR
        if changing:
            # A sample is taken before what changes at its instant.
            gyro.set(**changes[k])
            k += 1
        jumped, event = gyro.update()
        if changing:
            rows.append(gyro.get(*outputs))
        states = np.array(gyro.array("GetContinuousStates"))
        if not jumped:
            assert np.array_equal(states, found.y[:, -1])
    return np.array(rows)


@pytest.mark.parametrize("name", DEVICES)
def test_equals_co_simulation(fmu: Fmu, name: str) -> None:
    got, wanted = exchanged(fmu, DEVICES[name]), co_simulated(fmu, DEVICES[name])
    # x' and y' jump where the frame's turning does: there co-simulation shows them before, model exchange after.
    columns = [i for i, output in enumerate(OUTPUTS) if not (name in ("turning", "busy") and output.endswith("_dot"))]
    # Temperatures that follow at once change with their input: after the event here, after the step there.
    if "structure_lag" not in DEVICES[name]:
        columns = [i for i in columns if not OUTPUTS[i].startswith("temperature")]
    scale = np.max(np.abs(wanted), axis=0)
    # 1e-12 a step on both sides; the co-simulation's lag is a quintic's, 6e-11 (test_traces), and beside DOP853 with a
    # short lag stiff.
    limit = 1e-9 if {"amplifier_time_constant", "tcp"} & set(DEVICES[name]) else 5e-11
    assert np.max((np.abs(got - wanted) / scale)[:, columns]) <= limit


@pytest.mark.parametrize("seed", range(12))
def test_random_lives_equal_co_simulation(fmu: Fmu, seed: int) -> None:
    """Devices of the soak; inputs that change at instants of their own."""
    rng = random.Random(f"{seed} {fmu.version}")
    device, start = random_device(FORMS["full"], rng), rng.choice((0.0, 1.25))
    changes, ticks = [random_inputs(FORMS["full"], rng)], [0]
    for _ in range(12):
        ticks.append(ticks[-1] + max(1, round(5e6 * rng.choice((0.3, 1.0, 3.7, 20.0)) * rng.random())))
        changes.append(random_inputs(FORMS["full"], rng))
    times, outputs = [start + tick * TICK for tick in ticks], OUTPUTS[:4]
    with Instance(fmu) as gyro:
        gyro.start(start, **{**device, **changes[0]})
        wanted = [gyro.get(*outputs)]
        for k in range(1, len(times)):
            assert gyro.step(times[k - 1], (ticks[k] - ticks[k - 1]) * TICK) == OK, gyro.log
            wanted.append(gyro.get(*outputs))
            gyro.set(**changes[k])
    with Exchange(fmu) as gyro:
        gyro.start(start, **{**device, **changes[0]})
        got = integrated(gyro, start, times[1:], changes[1:], outputs)
    scale = np.maximum(np.max(np.abs(wanted), axis=0), (1e-3, 1e-3, 1e-9, 1e-9))
    # Of 2,000 such lives the worst was 1.4e-9, beside a short lag, which is stiff for DOP853; the median 6e-14.
    assert np.max(np.abs(got - np.array(wanted)) / scale) <= 5e-9


@pytest.mark.parametrize("name", ["plain", "curved", "lags", "noise"])
def test_fmpy_simulates_it_with_cvode(fmu: Fmu, name: str) -> None:
    common = {"start_values": {**START, **DEVICES[name]}, "output": ["v_x", "v_y", "x", "y"], "stop_time": 2e-3}
    common["output_interval"] = PERIOD
    path = str(fmu.path)
    got = fmpy.simulate_fmu(path, fmi_type="ModelExchange", relative_tolerance=1e-9, record_events=False, **common)
    wanted = fmpy.simulate_fmu(path, fmi_type="CoSimulation", **common)
    assert got["time"] == pytest.approx(wanted["time"])
    for column in ("v_x", "v_y", "x", "y"):
        # CVode at 1e-9 of states whose nominal value is that of the motion, over 6 cycles in steps of a fiftieth.
        assert np.max(np.abs(got[column] - wanted[column])) <= 1e-5 * np.max(np.abs(wanted[column])), column


@pytest.mark.parametrize(
    ("effect", "device", "gliding", "free"),
    [
        ("actuator_delay", {"actuator_delay": 1e-6}, ("u_x", "u_y"), ("omega_z", "temperature")),
        ("frame_rotation", {"frame_rotation": 1.0}, ("omega_z",), ("u_x", "a_x")),
    ],
)
def test_what_may_not_glide(
    fmu: Fmu, effect: str, device: dict[str, float], gliding: tuple[str], free: tuple[str]
) -> None:
    with Exchange(fmu) as gyro:
        gyro.start(**START, **device)
        gyro.update()
        assert gyro.call("EnterContinuousTimeMode") == OK
        for name in gliding:
            assert gyro.try_set(name, gyro.get(name)[0]) == OK, "an equal value is no change"
            assert gyro.try_set(name, 1e-7) == ERROR
            assert name in gyro.message and f"effect {effect}" in gyro.message
        for name in free:
            assert gyro.try_set(name, 300.0 if name == "temperature" else 1e-7) == OK
        assert gyro.call("EnterEventMode") == OK
        for name in gliding:
            gyro.set(**{name: 1e-7})
        gyro.update()


def test_an_input_that_glides_does_so_in_the_rates(fmu: Fmu) -> None:
    with Exchange(fmu) as gyro:
        gyro.start(**START)
        gyro.update()
        assert gyro.call("EnterContinuousTimeMode") == OK
        before = gyro.rates()
        gyro.set(u_x=1.8e-7)
        after = gyro.rates()
        assert after[gyro.states.index("x_dot")] - before[gyro.states.index("x_dot")] == pytest.approx(1.0, rel=1e-9)
        assert gyro.get("der(x_dot)") == [after[gyro.states.index("x_dot")]]


# The last two are beyond what an int64 counts in picoseconds.
@pytest.mark.parametrize("beyond", [2.5 * PERIOD, 1.7e9, 1e177])
def test_a_time_event_must_not_be_passed(fmu: Fmu, beyond: float) -> None:
    with Exchange(fmu) as gyro:
        gyro.start(**START)
        _, event = gyro.update()
        assert event == PERIOD
        assert gyro.call("EnterContinuousTimeMode") == OK
        gyro.move(beyond, gyro.array("GetContinuousStates"))
        assert gyro.call("EnterEventMode") == ERROR
        assert "stop at the time of each event" in gyro.message
        gyro.move(event, gyro.array("GetContinuousStates"))
        assert gyro.call("EnterEventMode") == OK


def test_a_saved_state_goes_on(fmu: Fmu) -> None:
    def go_on(gyro: Exchange, event: float) -> list[list[float]]:
        rows = []
        for _ in range(5):
            # An integrator of the simplest kind shows every bit.
            states, rates = gyro.array("GetContinuousStates"), gyro.rates()
            assert gyro.call("EnterContinuousTimeMode") == OK
            step = event - gyro.get("time")[0]
            gyro.move(event, [s + step * r for s, r in zip(states, rates, strict=True)])
            assert gyro.call("EnterEventMode") == OK
            gyro.set(u_x=gyro.get("u_x")[0] + 1e-7)
            _, event = gyro.update()
            rows.append([*gyro.get(*OUTPUTS), event])
        return rows

    with Exchange(fmu) as gyro, Exchange(fmu) as other, Instance(fmu) as plain:
        gyro.start(**{**NOISY, **START})
        _, event = gyro.update()
        event = go_on(gyro, event)[-1][-1]
        saved = gyro.save()
        data = gyro.serialize(saved)
        first = go_on(gyro, event)
        assert gyro.restore(saved) == OK
        assert go_on(gyro, event) == first
        other.start()
        status, handle = other.deserialize(data)
        assert status == OK and other.restore(handle) == OK, other.log
        assert go_on(other, event) == first
        plain.start()
        assert plain.restore(handle) == ERROR
        assert "another purpose" in plain.message
        gyro.free_saved(saved)
        other.free_saved(handle)


def test_calls_of_the_other_kind_are_refused(fmu: Fmu) -> None:
    with Exchange(fmu) as gyro, Instance(fmu) as plain:
        gyro.start(**START)
        plain.start(**START)
        assert gyro.step(0.0, PERIOD) == ERROR
        assert "event mode" in gyro.message
        for name, arguments in (
            ("SetTime", (ct.c_double(0.0),)),
            ("GetContinuousStates", ((ct.c_double * 10)(), ct.c_size_t(10))),
            ("EnterContinuousTimeMode", ()),
            ("EnterEventMode", ()),
        ):
            assert plain.call(name, *arguments) == ERROR
            assert plain.message.startswith(f"fmi{fmu.version}{name}: ")
        assert plain.step(0.0, PERIOD) == OK
        wrong = (ct.c_double * 3)()
        assert gyro.call("GetContinuousStates", wrong, ct.c_size_t(3)) == ERROR
        assert f"{len(gyro.states)} continuous states" in gyro.message
        gyro.update()
        assert gyro.call("EnterContinuousTimeMode") == OK
        bad = (ct.c_double * 10)(*[float("nan")] * 10)
        assert gyro.call("SetContinuousStates", bad, ct.c_size_t(10)) == ERROR
        assert gyro.call("SetTime", ct.c_double(float("inf"))) == ERROR


def test_a_state_saved_between_events_brings_its_time(fmu: Fmu) -> None:
    with Exchange(fmu) as gyro:
        # A mass on its own circle in a frame that turns: its rates depend on the time alone.
        gyro.start(**{**START, **DEVICES["turning"], **inputs(30)})
        gyro.update()
        assert gyro.call("EnterContinuousTimeMode") == OK
        gyro.move(0.7 * PERIOD, gyro.array("GetContinuousStates"))
        saved, rates = gyro.save(), gyro.rates()
        gyro.move(0.1 * PERIOD, [0.0] * len(gyro.states))
        assert gyro.restore(saved) == OK
        assert gyro.get("time") == [0.7 * PERIOD]
        assert gyro.rates() == rates
        gyro.free_saved(saved)


def test_an_event_beyond_the_sample_after_next_is_refused_in_event_mode_too(fmus: dict[int, Fmu]) -> None:
    with Exchange(fmus[2]) as gyro:
        gyro.start(**START)
        gyro.update()
        assert gyro.call("SetTime", ct.c_double(10.0 * PERIOD)) == OK
        assert gyro.call("NewDiscreteStates", ct.byref(ct.create_string_buffer(64))) == ERROR
        assert "beyond the sample" in gyro.message
        assert gyro.call("SetTime", ct.c_double(0.0)) == OK
        assert gyro.update()[1] == PERIOD
