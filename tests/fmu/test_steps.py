"""Time is an integer count of internal steps: which steps are taken, which refused, and splitting changes nothing."""

import pytest
from fmu_importer import ERROR, NOISY, OK, OUTPUTS, Fmu, Instance

NAN = float("nan")


def test_one_long_step_equals_a_hundred_short_ones(fmu: Fmu) -> None:
    with Instance(fmu) as coarse, Instance(fmu) as fine:
        for gyro in (coarse, fine):
            gyro.start(**NOISY)
        for k in range(5):
            for gyro in (coarse, fine):
                gyro.set(u_x=2e-6 * k, omega_z=0.5)
            assert coarse.step(k * 1e-4, 1e-4) == OK
            for i in range(100):
                assert fine.step((100 * k + i) * 1e-6, 1e-6) == OK
            assert coarse.get(*OUTPUTS) == fine.get(*OUTPUTS)


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
    "backwards": (3e-5, -1e-5, "no positive multiple"),
    "nothing": (3e-5, 0.0, "no positive multiple"),
    "stale": (2e-5, 1e-5, "not the present time 3e-05 s"),
    "ahead": (4e-5, 1e-5, "not the present time 3e-05 s"),
    "one internal step stale": (2.9e-5, 1e-5, "not the present time 3e-05 s"),
    "between ticks": (3.05e-5, 1e-5, "not the present time 3e-05 s"),
    "off grid": (3e-5, 1.5e-6, "nearest are 1e-06 s and 2e-06 s"),
    "less than a tick": (3e-5, 1e-7, "nearest is 1e-06 s"),
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


def test_step_of_one_internal_step_moves(gyro: Instance) -> None:
    gyro.start(x_start=1e-6)
    before = gyro.get("x")
    assert gyro.step(0.0, 1e-6) == OK
    assert gyro.get("x") != before


@pytest.mark.parametrize("relative", [-9e-7, 9e-7])
def test_step_within_a_millionth_of_a_multiple_is_that_multiple(fmu: Fmu, relative: float) -> None:
    with Instance(fmu) as plain, Instance(fmu) as gyro:
        plain.start(**NOISY)
        gyro.start(**NOISY)
        assert gyro.step(0.0, 1e-6 * (1 + relative)) == OK
        assert plain.step(0.0, 1e-6) == OK
        assert gyro.get(*OUTPUTS) == plain.get(*OUTPUTS)


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


@pytest.mark.parametrize("short, status", [(0.4e-6, OK), (0.6e-6, ERROR)])
def test_stop_time_between_internal_steps_is_the_nearest(gyro: Instance, short: float, status: int) -> None:
    gyro.start(stop=1e-4 - short)
    assert gyro.step(0.0, 1e-4) == status


def test_stop_time_is_reached_by_added_up_time(gyro: Instance) -> None:
    gyro.start(stop=1e-2)
    time = 0.0
    for _ in range(10_000):
        assert gyro.step(time, 1e-6) == OK, gyro.log
        time += 1e-6
    assert time != 1e-2
