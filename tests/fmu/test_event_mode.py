"""Co-simulation with events, FMI 3: a sample is an event, and v_x, v_y change there only."""

import ctypes as ct
from collections.abc import Iterator

import pytest
from fmu_importer import ERROR, NOISY, OK, OUTPUTS, Fmu, Instance, update

PERIOD = 2e-5
START = {**NOISY, "sample_period": PERIOD}


@pytest.fixture
def fmi3(fmus: dict[int, Fmu]) -> Fmu:
    return fmus[3]


@pytest.fixture
def gyro(fmi3: Fmu) -> Iterator[Instance]:
    with Instance(fmi3, events=True, early=True) as instance:
        yield instance


def step(gyro: Instance, time: float, length: float) -> tuple[bool, bool, float]:
    """Whether an event is due, whether the step ended early, and where."""
    flags, last = [ct.c_bool() for _ in range(3)], ct.c_double()
    arguments = (ct.c_double(time), ct.c_double(length), 1, *map(ct.byref, flags), ct.byref(last))
    assert gyro.call("DoStep", *arguments) == OK, gyro.log
    return flags[0].value, flags[2].value, last.value


def leave_events(gyro: Instance) -> float:
    _, event = update(gyro)
    assert gyro.call("EnterStepMode") == OK
    return event


def force(k: int) -> dict[str, float]:
    return {"u_x": 1e-6 * (k % 7), "omega_z": 0.1 * (k % 3)}


def test_a_step_ends_at_every_sample(gyro: Instance, fmi3: Fmu) -> None:
    gyro.start(**START)
    assert leave_events(gyro) == PERIOD
    time, trace, length = 0.0, [], 3.3e-5
    for k in range(1, 30):
        before = gyro.get("v_x", "v_y")
        time_wanted = k * PERIOD
        while time < time_wanted - 1e-12:
            end = time + length
            event, early, time = step(gyro, time, length)
            assert gyro.get("v_x", "v_y") == before, "samples change in event mode"
            assert event == (abs(time - time_wanted) < 1e-12) and early == (time < end - 1e-12)
        assert gyro.call("EnterEventMode") == OK
        assert update(gyro)[1] == pytest.approx((k + 1) * PERIOD, abs=1e-15)
        trace.append(gyro.get(*OUTPUTS))
        gyro.set(**force(k))
        assert gyro.call("EnterStepMode") == OK
        length = 3.3e-5 if k % 2 else 0.7e-5
    with Instance(fmi3) as plain:
        plain.start(**START)
        wanted = []
        for k in range(1, 30):
            assert plain.step((k - 1) * PERIOD, PERIOD) == OK
            wanted.append(plain.get(*OUTPUTS))
            plain.set(**force(k))
    assert trace == wanted


@pytest.mark.parametrize("start", [0.0, 1.7e9])
def test_an_early_end_is_before_the_end_in_the_numbers_that_an_importer_sees(fmi3: Fmu, start: float) -> None:
    # Unix times are 238 ns apart: samples lie between two of them, some so near to the end that both are one number.
    steps = [5e-6, 1.4e-6, 3.4e-7, 1e-5 / 3]
    with Instance(fmi3, events=True, early=True) as gyro:
        gyro.start(start, **{**START, "sample_period": 1.7e-6})
        leave_events(gyro)
        time, samples = start, 0
        for k in range(400):
            end = time + steps[k % 4]
            while time < end - 1e-12:  # a tick; importers add up with roundings far below
                event, early, last = step(gyro, time, end - time)
                assert time <= last and early == (last < end - 1e-12)
                assert gyro.get("time") == [pytest.approx(last, rel=0, abs=1e-12)], "the FMU is where it says"
                time, samples = last, samples + event
                if event:
                    assert gyro.call("EnterEventMode") == OK
                    leave_events(gyro)
    # All of 1 ms and more, but for what half a spacing of the numbers hides at the end.
    assert samples == int((time - start + 1.2e-7) / 1.7e-6) or samples == int((time - start - 1.2e-7) / 1.7e-6)


def test_without_early_return_events_wait_for_the_end_of_the_step(fmi3: Fmu) -> None:
    with Instance(fmi3, events=True) as gyro, Instance(fmi3) as plain:
        gyro.start(**START)
        plain.start(**START)
        leave_events(gyro)
        assert step(gyro, 0.0, 3.5 * PERIOD) == (True, False, pytest.approx(3.5 * PERIOD))
        assert gyro.call("EnterEventMode") == OK
        assert leave_events(gyro) == pytest.approx(4 * PERIOD, abs=1e-15)
        assert plain.step(0.0, 3.5 * PERIOD) == OK
        assert gyro.get(*OUTPUTS) == plain.get(*OUTPUTS)
        assert step(gyro, 3.5 * PERIOD, 0.2 * PERIOD) == (False, False, pytest.approx(3.7 * PERIOD))


def test_a_state_is_saved_between_step_and_event(gyro: Instance) -> None:
    gyro.start(**START)
    leave_events(gyro)
    assert step(gyro, 0.0, 1.0)[0]
    saved = gyro.save()
    old = gyro.get("v_x", "v_y")

    def go_on() -> list[float]:
        assert gyro.call("EnterEventMode") == OK
        leave_events(gyro)
        new = gyro.get("v_x", "v_y")
        assert step(gyro, PERIOD, 1.0) == (True, True, 2 * PERIOD)
        return new

    first = go_on()
    assert first != old
    assert gyro.restore(saved) == OK
    assert gyro.get("v_x", "v_y") == old
    assert go_on() == first
    gyro.free_saved(saved)


def test_modes_are_kept_apart(gyro: Instance, fmi3: Fmu) -> None:
    gyro.start(**START)
    assert gyro.step(0.0, PERIOD) == ERROR
    assert "event mode" in gyro.message
    leave_events(gyro)
    assert gyro.call("EnterStepMode") == ERROR
    flags, time = [ct.c_bool() for _ in range(5)], ct.c_double()
    assert gyro.call("UpdateDiscreteStates", *map(ct.byref, (*flags, time))) == ERROR
    assert gyro.call("EnterContinuousTimeMode") == ERROR
    with Instance(fmi3) as plain:
        plain.start()
        assert plain.call("EnterEventMode") == ERROR
        assert "eventModeUsed" in plain.message
