"""GyroscopeClocked: a triggered output clock ticks at each sample; all else is Gyroscope, bit for bit."""

import ctypes as ct
from collections.abc import Iterator
from typing import Any

import fmpy
import pytest
from fmpy.fmi3 import FMU3Slave
from fmpy.validation import validate_fmu
from fmu_importer import ERROR, NOISY, OK, OUTPUTS, Fmu, Instance, update

from gyro_model.experiments import verify

PERIOD = 2e-5
START = {**NOISY, "sample_period": PERIOD}


@pytest.fixture(scope="module")
def clocked(loaded: dict[str, dict[int, Fmu]]) -> Fmu:
    assert list(loaded["GyroscopeClocked"]) == [3]
    return loaded["GyroscopeClocked"][3]


@pytest.fixture
def gyro(clocked: Fmu) -> Iterator[Instance]:
    with Instance(clocked, events=True, early=True) as instance:
        yield instance


def active(gyro: Instance) -> bool:
    reference = ct.c_uint32(gyro.fmu.variables["sample_clock"].valueReference)
    value = ct.c_bool(False)
    assert gyro.call("GetClock", ct.byref(reference), ct.c_size_t(1), ct.byref(value)) == OK, gyro.log
    return value.value


def step_to_event(gyro: Instance, time: float, length: float) -> tuple[bool, float]:
    """Whether an event is due at the end, and where that is."""
    event, terminate, early, last = ct.c_bool(), ct.c_bool(), ct.c_bool(), ct.c_double()
    results = map(ct.byref, (event, terminate, early, last))
    assert gyro.call("DoStep", ct.c_double(time), ct.c_double(length), 1, *results) == OK, gyro.log
    return event.value, last.value


def test_the_description_says_so(clocked: Fmu) -> None:
    assert validate_fmu(str(clocked.path)) == []
    clock = clocked.variables["sample_clock"]
    assert (clock.type, clock.causality, clock.intervalVariability) == ("Clock", "output", "triggered")
    assert {v.name for v in clocked.description.modelVariables if v.clocks} == {"v_x", "v_y"}
    assert all(v.clocks == [clock] for v in clocked.variables.values() if v.clocks)
    assert clocked.description.coSimulation.hasEventMode
    assert clocked.description.modelExchange is None


def test_it_ticks_at_samples_and_only_there(gyro: Instance, loaded: dict[str, dict[int, Fmu]]) -> None:
    gyro.start(**START)
    assert active(gyro), "the start is a sample"
    update(gyro)
    assert not active(gyro)
    assert gyro.call("EnterStepMode") == OK
    ticks, trace, time = [], [], 0.0
    for k in range(60):
        event, time = step_to_event(gyro, time, 0.7e-5 if k % 3 else 3.1e-5)
        assert not active(gyro)
        assert gyro.call("EnterEventMode") == OK
        assert active(gyro) == event
        if event:
            ticks.append(time)
            # What is clocked is new before the update, as the clock is active.
            trace.append(gyro.get("v_x", "v_y"))
        update(gyro)
        assert not active(gyro)
        assert not event or gyro.get("v_x", "v_y") == trace[-1]
        gyro.set(u_x=1e-6 * (k % 7)) if event else None
        assert gyro.call("EnterStepMode") == OK
    assert ticks == pytest.approx([(k + 1) * PERIOD for k in range(len(ticks))], abs=1e-15)
    assert len(ticks) == 20
    # The samples are those of Gyroscope under the same forces, bit for bit.
    with Instance(loaded["Gyroscope"][3], events=True, early=True) as plain:
        plain.start(**START)
        update(plain)
        assert plain.call("EnterStepMode") == OK
        time, found = 0.0, []
        for k in range(60):
            event, time = step_to_event(plain, time, 0.7e-5 if k % 3 else 3.1e-5)
            assert plain.call("EnterEventMode") == OK
            update(plain)
            if event:
                found.append(plain.get("v_x", "v_y"))
                plain.set(u_x=1e-6 * (k % 7))
            assert plain.call("EnterStepMode") == OK
        assert found == trace


def test_without_event_mode_it_is_the_full_fmu(clocked: Fmu, loaded: dict[str, dict[int, Fmu]]) -> None:
    with Instance(clocked) as one, Instance(loaded["Gyroscope"][3]) as other:
        for gyro in (one, other):
            gyro.start(**START)
        assert one.run(0, 50) == other.run(0, 50)
        assert not active(one)


def test_it_meets_the_reference_traces(clocked: Fmu) -> None:
    residuals = verify(clocked.path)
    assert len({r.experiment for r in residuals}) == 7
    assert [r for r in residuals if not r.met] == []


def test_a_tick_is_saved_and_restored(gyro: Instance, clocked: Fmu) -> None:
    gyro.start(**START)
    update(gyro)
    assert gyro.call("EnterStepMode") == OK
    assert step_to_event(gyro, 0.0, 1.0) == (True, PERIOD)
    before = gyro.save()
    assert gyro.call("EnterEventMode") == OK
    within = gyro.save()
    sample = gyro.get("v_x")
    update(gyro)
    after = gyro.save()
    with Instance(clocked, events=True, early=True) as other:
        for saved, state, ticks in ((before, "step", True), (within, "event", True), (after, "event", False)):
            status, moved = other.deserialize(gyro.serialize(saved))
            assert status == OK and other.restore(moved) == OK, other.log
            if state == "step":
                assert not active(other)
                assert other.call("EnterEventMode") == OK
            assert active(other) == ticks
            assert other.get("v_x") == sample
            other.free_saved(moved)
    for saved in (before, within, after):
        gyro.free_saved(saved)


def test_other_clocks_and_other_uses_are_refused(gyro: Instance, clocked: Fmu) -> None:
    value = ct.c_bool()
    gyro.start()
    wrong = {0: "not a clock", clocked.variables["sample_clock"].valueReference + 1: "no variable has"}
    for reference, said in wrong.items():
        assert gyro.call("GetClock", ct.byref(ct.c_uint32(reference)), ct.c_size_t(1), ct.byref(value)) == ERROR
        assert said in gyro.message
    clock = ct.byref(ct.c_uint32(clocked.variables["sample_clock"].valueReference))
    assert gyro.call("SetClock", clock, ct.c_size_t(1), ct.byref(value)) == ERROR
    assert gyro.call("GetIntervalDecimal", clock, ct.c_size_t(1), None, None) == ERROR
    assert "interval" in gyro.message
    log: list[tuple[int, str, str]] = []
    assert clocked.instantiate(clocked.log_callback(log), clocked.token, co_simulation=False) is None
    assert "co-simulation only" in log[-1][2]


def test_fmpy_runs_it_with_and_without_event_mode(clocked: Fmu) -> None:
    options: dict[str, Any] = {"stop_time": 1e-3, "output_interval": PERIOD, "start_values": START}
    plain = fmpy.simulate_fmu(str(clocked.path), output=OUTPUTS, **options)
    events = fmpy.simulate_fmu(
        str(clocked.path), output=OUTPUTS, use_event_mode=True, early_return_allowed=True, **options
    )
    # With events there is a row before each and one behind.
    last = {round(row["time"] / PERIOD): row for row in events}
    for name in OUTPUTS:
        assert [last[round(row["time"] / PERIOD)][name] for row in plain] == list(plain[name])


def test_fmpy_reads_the_clock(clocked: Fmu) -> None:
    description = clocked.description
    slave = FMU3Slave(
        guid=clocked.token,
        unzipDirectory=str(clocked.folder),
        modelIdentifier=description.coSimulation.modelIdentifier,
        instanceName="gyro",
    )
    slave.instantiate(eventModeUsed=True, earlyReturnAllowed=True)
    slave.enterInitializationMode()
    slave.exitInitializationMode()
    clock = description.modelVariables[-1].valueReference
    assert slave.getClock([clock]) == [True]
    slave.updateDiscreteStates()
    assert slave.getClock([clock]) == [False]
    slave.terminate()
    slave.freeInstance()
