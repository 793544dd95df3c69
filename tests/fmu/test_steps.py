"""Time is counted in picoseconds and the integration has a grid of its own: which steps are taken, which refused, and
that no bit depends on how an importer divides time."""

from collections.abc import Iterator
from itertools import pairwise

import fmpy
import numpy as np
import pytest
from fmu_importer import ERROR, NOISY, OK, OUTPUTS, Fmu, Instance

NAN = float("nan")


def followed(gyro: Instance, times: list[float], watched: set[float]) -> list[list[float]]:
    """Steps to each of ``times`` [s], which begin at 0; force and rate change at every 100 µs that is among them. The
    outputs at ``watched``."""
    rows = []
    for begin, end in pairwise(times):
        if begin in watched:
            k = round(begin / 1e-4)
            gyro.set(u_x=2e-6 * (k + 1), omega_z=0.5 - k % 2, temperature=300.0 + k)
        assert gyro.step(begin, end - begin) == OK, gyro.log
        if end in watched:
            rows.append(gyro.get(*OUTPUTS))
    return rows


# Steps a 100 µs: on the grid, finer than it, not commensurable with it, of all lengths.
DIVISIONS = {"100 of 1 µs": 100, "300 of 1/3 µs": 300, "20 of 5 µs": 20, "7": 7, "1": 1}


@pytest.mark.parametrize("parts", [*DIVISIONS.values(), -1], ids=[*DIVISIONS, "at random"])
@pytest.mark.parametrize("internal_step", [5e-6, 1e-6, 3.7e-6])
def test_no_bit_depends_on_the_steps(fmu: Fmu, parts: int, internal_step: float) -> None:
    marks = [1e-4 * k for k in range(6)]
    rng = np.random.default_rng(3)
    times = []
    for begin, end in pairwise(marks):
        share = np.arange(parts) / parts if parts > 0 else np.sort(np.append(rng.uniform(0, 1, 60), 0.0))
        times += [begin, *(begin + (end - begin) * s for s in share.tolist()[1:])]
    with Instance(fmu) as gyro, Instance(fmu) as other:
        for instance in (gyro, other):
            instance.start(**NOISY, internal_step=internal_step)
        assert followed(gyro, [*times, marks[-1]], set(marks)) == followed(other, marks, set(marks))


def test_a_change_off_the_grid_is_a_change_where_it_is(fmu: Fmu) -> None:
    # 33.4 µs is on no grid: the force of two steps there equals that of a delay by which it comes there.
    with Instance(fmu) as gyro, Instance(fmu) as late:
        for instance in (gyro, late):
            instance.start(x_start=1e-6, actuator_delay=0.0 if instance is gyro else 13.4e-6)
        assert gyro.step(0.0, 33.4e-6) == OK and late.step(0.0, 20e-6) == OK
        for instance, begin in ((gyro, 33.4e-6), (late, 20e-6)):
            instance.set(u_x=3e-6)
            assert instance.step(begin, 1e-4 - begin) == OK
        assert gyro.get(*OUTPUTS) == late.get(*OUTPUTS)


def test_an_equal_value_is_no_change(fmu: Fmu) -> None:
    with Instance(fmu) as gyro, Instance(fmu) as other:
        for instance in (gyro, other):
            instance.start(**NOISY)
            instance.set(u_x=1e-6, omega_z=3.0)
        for k in range(100):
            gyro.set(u_x=1e-6, omega_z=3.0, temperature=298.15)
            assert gyro.step(k * 1.7e-6, 1.7e-6) == OK
        assert other.step(0.0, 1.7e-4) == OK
        assert gyro.get(*OUTPUTS) == other.get(*OUTPUTS)


@pytest.mark.parametrize("rate", [44_100.0, 48_000.0, 8192.0, 200_000.0, 3e6])
def test_samples_of_any_rate_are_met(fmu: Fmu, rate: float) -> None:
    # Steps of a period that is no whole number of ticks, as product, as sum and as difference of times.
    rows = []
    for way in ("product", "sum", "difference"):
        with Instance(fmu) as gyro:
            gyro.start(x_start=1e-6, sample_period=1.0 / rate, sense_noise=1e-3)
            time, trace = 0.0, []
            for k in range(3000):
                begin = k / rate if way != "sum" else time
                step = (k + 1) / rate - k / rate if way == "difference" else 1.0 / rate
                assert gyro.step(begin, step) == OK, gyro.log
                time += step
                trace.append(gyro.get("v_x"))
            rows.append(trace)
    assert rows[0] == rows[1] == rows[2]
    assert len({v for [v] in rows[0]}) == 3000, "each step brings one sample"


@pytest.fixture(params=[1.0 / 300.0, 1.23456789e-3])
def stop(request: pytest.FixtureRequest) -> Iterator[float]:
    """Stop times that are on no grid [s]."""
    yield request.param


def test_any_stop_time_and_output_interval(fmu: Fmu, stop: float) -> None:
    own = {"start_values": {"x_start": 1e-6}, "output": ["x"], "stop_time": stop}
    for interval in (5e-6, 1e-3 / 3):
        result = fmpy.simulate_fmu(str(fmu.path), **own, output_interval=interval)
        # fmpy ends at the last interval or a part of one.
        assert stop - interval < result["time"][-1] <= stop * (1 + 1e-15)


def test_noise_depends_on_the_seed(fmu: Fmu) -> None:
    traces = []
    for seed in (1, 1, 2):
        with Instance(fmu) as gyro:
            gyro.start(**(NOISY | {"seed": seed}))
            traces.append(gyro.run(0, 10))
    assert traces[0] == traces[1] != traces[2]


# What comes after three steps of 10 us; the text is part of the message.
REFUSED = {
    "not a time": (NAN, 1e-5, "finite"),
    "not a step": (3e-5, NAN, "finite"),
    "endless": (3e-5, float("inf"), "finite"),
    "backwards": (3e-5, -1e-5, "step -1e-05 s: give a positive number"),
    "nothing": (3e-5, 0.0, "step 0 s: give a positive number"),
    "stale": (2e-5, 1e-5, "not the present time 3e-05 s"),
    "ahead": (4e-5, 1e-5, "not the present time 3e-05 s"),
    "two ticks stale": (3e-5 - 2e-12, 1e-5, "not the present time 3e-05 s"),
    "more than is counted": (3e-5, 1e9, "ends later than 9000000 s"),
}


@pytest.mark.parametrize("time, step, text", REFUSED.values(), ids=REFUSED)
def test_refused_step_changes_nothing_and_says_why(fmu: Fmu, time: float, step: float, text: str) -> None:
    with Instance(fmu) as plain, Instance(fmu) as gyro:
        plain.start(**NOISY)
        gyro.start(**NOISY)
        before = plain.run(0, 3)
        assert gyro.run(0, 3) == before
        assert gyro.step(time, step) == ERROR
        assert "DoStep: " in gyro.message and text in gyro.message
        assert gyro.get(*OUTPUTS) == before[-1]
        assert gyro.run(3, 30) == plain.run(3, 30)


@pytest.mark.parametrize("step", [1e-6, 1e-7, 1e-9])
def test_a_step_below_the_internal_one_moves(gyro: Instance, step: float) -> None:
    gyro.start(x_start=1e-6)
    before = gyro.get("x_dot")
    assert gyro.step(0.0, step) == OK
    assert gyro.get("x_dot") != before


def test_steps_below_a_tick_add_up(fmu: Fmu) -> None:
    with Instance(fmu) as gyro, Instance(fmu) as other:
        for instance in (gyro, other):
            instance.start(x_dot_start=1e-3)
        for k in range(1000):
            assert gyro.step(k * 0.1e-12, 0.1e-12) == OK
        assert other.step(0.0, 1e-10) == OK
        assert gyro.get(*OUTPUTS) == other.get(*OUTPUTS)


@pytest.mark.parametrize("step", [1e-5, 5e-6, 1e-6 / 3 * 30])
def test_time_added_up_by_the_importer_is_accepted(gyro: Instance, step: float) -> None:
    gyro.start(x_start=1e-6)
    time, n = 0.0, 200_000
    for _ in range(n):
        assert gyro.step(time, step) == OK, gyro.log
        time += step
    # The case is worth something only if the sum has gone astray.
    assert time != n * step
    assert gyro.step(n * step, step) == OK, "the product is as good a time as the sum"


def test_start_time_other_than_zero(fmu: Fmu) -> None:
    quiet = {name: value for name, value in NOISY.items() if not name.startswith("damping_step")}
    with Instance(fmu) as early, Instance(fmu) as late:
        early.start(**quiet)
        late.start(start=1.25, **quiet)
        assert late.step(0.0, 1e-5) == ERROR
        for k in range(20):
            assert early.step(k * 1e-5, 1e-5) == OK
            assert late.step(1.25 + k * 1e-5, 1e-5) == OK, late.log
            # Nothing but the damping step knows the date, so that the two runs share every bit.
            assert late.get(*OUTPUTS) == early.get(*OUTPUTS)


@pytest.mark.parametrize("start, stop", [(NAN, None), (float("inf"), None), (1.0, 0.5), (0.0, NAN)])
def test_impossible_times_are_refused(gyro: Instance, start: float, stop: float | None) -> None:
    assert gyro.set_up(start, stop) == ERROR
    assert "Time is " in gyro.message
    gyro.start()


def test_no_step_passes_the_stop_time(gyro: Instance) -> None:
    gyro.start(stop=1e-4)
    gyro.run(0, 9)
    assert gyro.step(9e-5, 2e-5) == ERROR
    assert "stop time 0.0001 s" in gyro.message
    assert gyro.step(9e-5, 1e-5) == OK
    assert gyro.step(1e-4, 1e-6) == ERROR


@pytest.mark.parametrize("beyond, status", [(1e-13, OK), (1e-9, ERROR)])
def test_stop_time_is_met_to_the_rounding_of_times(gyro: Instance, beyond: float, status: int) -> None:
    gyro.start(stop=1e-4 - beyond)
    assert gyro.step(0.0, 1e-4) == status


def test_stop_time_is_reached_by_added_up_time(gyro: Instance) -> None:
    gyro.start(stop=1e-2)
    time = 0.0
    for _ in range(10_000):
        assert gyro.step(time, 1e-6) == OK, gyro.log
        time += 1e-6
    assert time != 1e-2


EPOCH = 1.7e9
"""Unix time of November 2023 [s]: a double there has steps of 238 ns."""


@pytest.mark.parametrize("step", [1.4e-6, 5e-6, 1e-3 / 3])
@pytest.mark.parametrize("way", ["product", "sum"])
def test_a_unix_time_as_start_takes_no_bit(fmu: Fmu, step: float, way: str) -> None:
    with Instance(fmu) as early, Instance(fmu) as late:
        # Nothing but the damping step knows the date, so that the two runs share every bit.
        quiet = {name: value for name, value in NOISY.items() if not name.startswith("damping_step")}
        early.start(**quiet)
        late.start(start=EPOCH, **quiet)
        time = EPOCH
        for k in range(300):
            for instance in (early, late):
                instance.set(u_x=1e-6 * (k % 7))
            assert early.step(k * step, step) == OK
            assert late.step(EPOCH + k * step if way == "product" else time, step) == OK, late.log
            time += step
            assert late.get(*OUTPUTS) == early.get(*OUTPUTS)
        assert late.step(EPOCH, step) == ERROR


def test_times_of_a_recorder_count_as_differences(gyro: Instance) -> None:
    times = EPOCH + np.arange(2000) * 5e-6
    gyro.start(start=EPOCH, x_start=1e-6)
    for begin, step in zip(times, np.diff(times), strict=False):
        assert gyro.step(begin, step) == OK, gyro.log


@pytest.mark.parametrize("internal_step", [5e-6, 1e-3])
def test_divergence_says_which_state_and_when_and_leaves_no_number(gyro: Instance, internal_step: float) -> None:
    # Softening of 1e20 N/m³ at 10 µm: 1e5 N outwards, and without a bound in a finite time.
    gyro.start(x_start=1e-5, k3_x=-1e20, k3_y=-1e20, internal_step=internal_step)
    gyro.set(u_x=1.0)
    assert gyro.step(0.0, 0.3) == ERROR
    first = gyro.message
    assert "DoStep: diverged at " in first and " is not finite" in first
    when = float(first.partition("diverged at ")[2].partition(" s")[0])
    assert 0.0 < when < 0.3
    outputs = [name for name, variable in gyro.fmu.variables.items() if variable.causality == "output"]
    assert all(np.isnan(gyro.get(*outputs)))
    for time in (0.3, when):
        assert gyro.step(time, 1e-5) == ERROR
        assert gyro.message == first, "time does not go on"
    saved = gyro.save()
    assert gyro.restore(saved) == OK
    assert gyro.step(when, 1e-5) == ERROR and gyro.message == first
    gyro.free_saved(saved)
    assert gyro.call("Reset") == OK
    gyro.start(x_start=1e-6)
    assert gyro.step(0.0, 1e-5) == OK


def test_divergence_between_two_instants_of_the_grid_is_said(gyro: Instance) -> None:
    # A thousand times the softening of above: 30 times as fast.
    gyro.start(x_start=1e-5, k3_x=-1e23, k3_y=-1e23)
    assert gyro.step(0.0, 1e-6) == ERROR
    assert "diverged at " in gyro.message
    assert np.isnan(gyro.get("x")).all()
