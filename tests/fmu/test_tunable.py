"""Parameters that are set while the FMU runs: a fault is there from that instant on, and no other."""

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import pytest
from fmu_importer import ERROR, NOISY, OK, OUTPUTS, Fmu, Instance

from gyro_model.device import Device
from gyro_model.model import load_model
from gyro_model.reference import simulate

MODEL = load_model()
TUNABLE = sorted(MODEL.tunable)
NOISE = {q.name for e in MODEL.effects if e.drawn or e.drawn_at_start for q in e.parameters}
PERIOD, SWITCH, LAST = 2e-5, 40, 90
"""Of samples and steps [s]; the step at which a parameter is set, the last one."""
# What lets most effects be seen: a motion, a rate, warmth, a bias voltage, an acceleration.
START = {"x_start": 1e-6, "y_start": -4e-7, "sample_period": PERIOD}
HELD = {"omega_z": 30.0, "temperature": 330.0, "a_x": 5.0, "a_y": -3.0, "v_bias": 5.0}


def size_of(name: str) -> float:
    """A value of ``name`` that switches its effect on."""
    quantity = MODEL.by_name[name]
    return 0.5 * quantity.typical if quantity.start == quantity.typical else quantity.typical


def force(k: int) -> dict[str, float]:
    return {"u_x": 1e-6 * (k % 7), "u_y": -2e-7 * (k % 5)}


@contextmanager
def started(fmu: Fmu, **values: float) -> Iterator[Instance]:
    with Instance(fmu) as gyro:
        gyro.start(**{**START, **HELD, **force(0), **values})
        yield gyro


def run(gyro: Instance, first: int, last: int, parts: int = 1) -> list[list[float]]:
    trace = []
    for k in range(first, last):
        gyro.set(**force(k))
        for i in range(parts):
            assert gyro.step((k + i / parts) * PERIOD, PERIOD / parts) == OK, gyro.log
        trace.append(gyro.get(*OUTPUTS))
    return trace


def test_all_sizes_but_the_delay_are_tunable(fmu: Fmu) -> None:
    found = {name for name, variable in fmu.variables.items() if variable.variability == "tunable"}
    assert found == {q.name for q in MODEL.quantities if q.role == "size"} - {"actuator_delay"}
    assert len(found) >= 41


@pytest.mark.parametrize("name", sorted(set(TUNABLE) - NOISE))
def test_from_that_instant_on_the_device_is_another(fmus: dict[int, Fmu], name: str) -> None:
    t = np.arange(LAST + 1) * PERIOD
    inputs = {key: np.array([force(k)[key] for k in range(LAST + 1)]) for key in force(0)}
    inputs |= {key: np.full(len(t), value) for key, value in HELD.items()}
    before = simulate(Device("before", START), t[: SWITCH + 1], {k: v[: SWITCH + 1] for k, v in inputs.items()})
    states = {f"{state}_start": before[state][-1] for state in ("x", "x_dot", "y", "y_dot")}
    after = simulate(
        Device("after", {**START, **states, name: size_of(name)}),
        t[SWITCH:],
        {k: v[SWITCH:] for k, v in inputs.items()},
    )
    with started(fmus[3]) as gyro:
        run(gyro, 0, SWITCH)
        gyro.set(**{name: size_of(name)})
        got = np.array(run(gyro, SWITCH, LAST)).T
    # DOP853 at 1e-12 a step and the FMU's own. A lag takes the motion as a quintic, 6e-11 (test_traces), and makes the
    # reference stiff where it is short: 2e-10 at some samples with the 0.3 us of tcp.
    limit = 5e-10 if name in ("amplifier_time_constant", "tcp") else 2e-11
    for column, output in zip(got, OUTPUTS, strict=True):
        wanted = after[output][1:]
        assert np.max(np.abs(column - wanted)) <= limit * np.max(np.abs(wanted)), output


@pytest.mark.parametrize("name", TUNABLE)
def test_no_bit_depends_on_steps_saving_or_setting_an_equal_value(fmus: dict[int, Fmu], name: str) -> None:
    traces = []
    for version, parts, saving in ((3, 1, False), (2, 3, False), (3, 7, True)):
        with started(fmus[version], seed=3) as gyro:
            run(gyro, 0, SWITCH, parts)
            # Half a sample period on, between two points of all grids.
            assert gyro.step(SWITCH * PERIOD, 0.37 * PERIOD) == OK
            gyro.set(**{name: size_of(name)})
            if saving:
                gyro = restored(gyro, fmus[version])
            assert gyro.step((SWITCH + 0.37) * PERIOD, 0.63 * PERIOD) == OK
            trace = run(gyro, SWITCH + 1, SWITCH + 10, parts)
            gyro.set(**{name: size_of(name)})
            trace += run(gyro, SWITCH + 10, LAST, parts)
            if saving:
                gyro.__exit__()
        traces.append(trace)
    assert traces[0] == traces[1] == traces[2]


def restored(gyro: Instance, fmu: Fmu) -> Instance:
    """Another instance that goes on from the bytes of this one."""
    saved = gyro.save()
    other = Instance(fmu)
    other.start()
    status, handle = other.deserialize(gyro.serialize(saved))
    assert status == OK and other.restore(handle) == OK, other.log
    gyro.free_saved(saved)
    other.free_saved(handle)
    return other


@pytest.mark.parametrize("name", ["sense_noise", "sampling_jitter", "thermal_force"])
def test_white_noise_switched_on_is_that_of_a_device_that_always_had_it(fmus: dict[int, Fmu], name: str) -> None:
    # What is drawn belongs to the sample; with the force of 1e-9 of a femtonewton the motion is the same.
    value = {"sense_noise": 1e-4, "sampling_jitter": 1e-9, "thermal_force": 1e-9}[name]
    with started(fmus[3], **{name: value}) as always, started(fmus[3]) as late:
        run(always, 0, SWITCH)
        run(late, 0, SWITCH)
        late.set(**{name: value})
        ours, theirs = np.array(run(late, SWITCH, LAST)), np.array(run(always, SWITCH, LAST))
    assert np.max(np.abs(ours - theirs) / np.max(np.abs(theirs), axis=0)) <= (0.0 if name != "thermal_force" else 1e-9)


def test_flicker_noise_that_is_switched_off_goes_on_where_it_was(fmus: dict[int, Fmu]) -> None:
    with started(fmus[3], flicker_noise=1e-3) as gyro, started(fmus[3]) as quiet:
        first = np.array(run(gyro, 0, 30)) - np.array(run(quiet, 0, 30))
        gyro.set(flicker_noise=0.0)
        silent = np.array(run(gyro, 30, 60)) - np.array(run(quiet, 30, 60))
        gyro.set(flicker_noise=1e-3)
        again = np.array(run(gyro, 60, 90)) - np.array(run(quiet, 60, 90))
    assert np.all(first[:, 0] != 0.0) and np.all(silent == 0.0) and np.all(again[:, 0] != 0.0)
    assert not np.any(np.isin(first[:, 0], again[:, 0]))


# Wherever the run begins, and whether the effect acts there.
@pytest.mark.parametrize("own", [{"parasitic_coupling": 5.0}, {}])
def test_a_mode_that_is_switched_on_begins_at_rest(fmus: dict[int, Fmu], own: dict[str, float]) -> None:
    begun = {"parasitic_start": 2e-6, "parasitic_dot_start": 0.02}
    with started(fmus[3], **own, **begun) as gyro, started(fmus[3]) as fresh:
        run(gyro, 0, SWITCH)
        gyro.set(parasitic_coupling=0.0)
        state = dict(zip(OUTPUTS, run(gyro, SWITCH, SWITCH + 1)[-1], strict=True))
        gyro.set(parasitic_coupling=5.0)
        got = run(gyro, SWITCH + 1, LAST)
        assert fresh.call("Reset") == OK
        begins = {f"{name}_start": state[name] for name in ("x", "x_dot", "y", "y_dot")}
        fresh.start(**{**START, **HELD, **force(SWITCH + 1), **begins, "parasitic_coupling": 5.0})
        wanted = []
        for k in range(LAST - SWITCH - 1):
            fresh.set(**force(SWITCH + 1 + k))
            assert fresh.step(k * PERIOD, PERIOD) == OK
            wanted.append(fresh.get(*OUTPUTS))
    assert got == wanted


def test_a_law_that_acts_no_more_leaves_no_mark(fmus: dict[int, Fmu]) -> None:
    with started(fmus[3]) as gyro, started(fmus[3]) as plain:
        gyro.set(tck=1e-3, tcd=1e-2, damping_step_factor=7.0)
        gyro.set(tck=0.0, tcd=0.0, damping_step_factor=1.0)
        assert run(gyro, 0, 10) == run(plain, 0, 10)
        gyro.set(tcd=1e-2)
        run(gyro, 10, 11)
        gyro.set(tcd=0.0)
        run(plain, 10, 11)
        late = run(gyro, 11, LAST)
    # One step of 31 % more damping is 3e-5 of the motion; 80 of them would be 2e-3.
    with started(fmus[3]) as again:
        wanted = np.array(run(again, 0, LAST)[11:])
        assert np.all(np.abs(late - wanted) <= 2e-4 * np.max(np.abs(wanted), axis=0))


def test_a_busy_device_goes_on_as_it_was_saved(fmu: Fmu) -> None:
    with Instance(fmu) as gyro:
        gyro.start(**{**NOISY, **START})
        run(gyro, 0, 10)
        gyro.set(k3_x=1e10, amplifier_time_constant=0.0, thermal_force=0.0)
        saved = gyro.save()
        first = run(gyro, 10, 30)
        assert gyro.restore(saved) == OK
        assert gyro.get("k3_x") == [1e10]
        assert run(gyro, 10, 30) == first
        gyro.free_saved(saved)


def test_what_can_not_be_set_while_it_runs(fmu: Fmu) -> None:
    with started(fmu) as gyro:
        run(gyro, 0, 3)
        for name, value in (
            ("actuator_delay", 1e-6),
            ("damping_step_time", 1.0),
            ("kxx", 60.0),
            ("sample_period", 1e-5),
        ):
            assert gyro.try_set(name, value) == ERROR
            assert "not allowed now" in gyro.message
        assert gyro.try_set("sense_noise", -1.0) == ERROR
        assert "give a value from 0" in gyro.message
        assert gyro.get("sense_noise") == [0.0]
        run(gyro, 3, 5)
