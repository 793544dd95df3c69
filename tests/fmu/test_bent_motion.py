"""Motion that forces bend and laws change, held against what it must equal: hysteresis by values against hysteresis by
series, devices whose bent force is another one's in a limit, long steps against short ones."""

from collections.abc import Callable

import numpy as np
import pytest
from fmu_importer import OK, Fmu, Instance
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

Residual = Callable[[str, float, float], None]

STEP, COUNT = 5e-6, 160
STATES = ("x", "y", "x_dot", "y_dot")
START = {"x_start": 1e-6, "y_start": -4e-7, "y_dot_start": 6e-3}

# Both ways are right to 1e-8 rad a second of phase: 8e-12 of the motion in 160 steps of 5 µs, 3e-11 in those of 20 µs.
SAME = 3e-11

HYSTERESIS = {
    "nearly linear": {"hysteresis_x": 2e-6, "hysteresis_y": 1e-6, "hysteresis_length": 2e-6},
    "n = 2": {"hysteresis_x": 1e-6, "hysteresis_y": 2e-6, "hysteresis_length": 5e-7, "hysteresis_n": 2.0},
    "sharp": {"hysteresis_x": 1e-6, "hysteresis_y": 1e-6, "hysteresis_length": 3e-7, "hysteresis_n": 12.0},
    "of one axis": {"hysteresis_y": 2e-6, "hysteresis_length": 4e-7, "hysteresis_n": 1.7},
    "no bend towards zero": {
        "hysteresis_x": 1e-6, "hysteresis_y": 2e-6, "hysteresis_length": 5e-7, "hysteresis_beta": 0.5,
        "hysteresis_gamma": 0.5, "hysteresis_n": 1.4,
    },
    "stiffening": {
        "hysteresis_x": 1e-6, "hysteresis_length": 5e-7, "hysteresis_beta": 0.3, "hysteresis_gamma": -0.2,
        "hysteresis_n": 1.4,
    },
    "hardly a motion": {
        "hysteresis_x": 1e-6, "hysteresis_length": 1e-7, "hysteresis_n": 1.5, "x_start": 0.0, "y_start": 0.0,
        "y_dot_start": 0.0,
    },
    "steps that turn the motion far": {"hysteresis_x": 2e-6, "hysteresis_length": 6e-7, "internal_step": 1e-5},
    "steps too long for values": {"hysteresis_x": 2e-6, "hysteresis_length": 6e-7, "internal_step": 2e-5},
}  # fmt: skip


def motion(fmu: Fmu, push: float = 5e-6, **values: float) -> NDArray[np.float64]:
    """The states after each step [SI], shape (steps, 4), under a random force of the size ``push`` [N]."""
    rng = np.random.default_rng(43)
    step = values.get("internal_step", STEP)
    rows = []
    with Instance(fmu) as gyro:
        gyro.start(**{**START, "sample_period": step, **values})
        for k in range(COUNT):
            gyro.set(u_x=push * rng.standard_normal(), u_y=push * rng.standard_normal(), omega_z=3.0)
            assert gyro.step(k * step, step) == OK, gyro.log
            rows.append(gyro.get(*STATES))
    return np.array(rows)


def difference(found: NDArray[np.float64], wanted: NDArray[np.float64]) -> float:
    """The largest, over the size of each state."""
    return float(np.max(np.abs(found - wanted) / np.max(np.abs(wanted), axis=0)))


# What makes a step take series: a spring of 1 N/m³, 1e-14 of the device's own at a micron, and a lag, which no state
# knows of.
BY_SERIES = {"k3_x": 1.0, "amplifier_time_constant": 1e-6}


@pytest.mark.parametrize("name", BY_SERIES)
@pytest.mark.parametrize("case", HYSTERESIS)
def test_hysteresis_by_values_is_hysteresis_by_series(
    case: str, name: str, fmus: dict[int, Fmu], residual: Residual
) -> None:
    device = HYSTERESIS[case]
    found, wanted = motion(fmus[3], **device), motion(fmus[3], **device, **{name: BY_SERIES[name]})
    residual(case, difference(found, wanted), SAME)


@pytest.mark.parametrize("others", [{}, {"k3_x": 1.0}], ids=["by values", "by series"])
@pytest.mark.parametrize("n", [1.0, 1.5, 2.0])
def test_hysteresis_that_nothing_bends_is_a_spring(
    n: float, others: dict[str, float], fmus: dict[int, Fmu], residual: Residual
) -> None:
    # L z' = x', so that z = (x - x_0)/L: a spring of h/L with its rest where the motion began.
    h, length, k = 1e-6, 5e-7, 63.955
    shape = {"hysteresis_length": length, "hysteresis_beta": 0.0, "hysteresis_gamma": 0.0, "hysteresis_n": n}
    found = motion(fmus[3], hysteresis_x=h, **shape, **others)
    wanted = motion(fmus[3], kxx=k + h / length, force_x=h * START["x_start"] / length)
    residual("states", difference(found, wanted), SAME)


# Forces that bend the motion in places alone; in between a table moves it.
PLACES = {
    "friction": {"friction_x": 2e-6, "friction_y": 1e-6, "friction_speed": 1e-5},
    "friction with an excess at rest": {
        "friction_x": 2e-6, "friction_speed": 1e-5, "stribeck": 0.5, "stribeck_speed": 1e-3,
    },
    "friction over all speeds": {"friction_x": 2e-6, "friction_speed": 0.3},
    "stops": {"stop_stiffness": 500.0, "stop_gap": 3e-7, "stop_damping": 1e-5},
    "stops that are never met": {"stop_stiffness": 500.0, "stop_gap": 1e-3},
    "friction and stops": {"friction_x": 2e-6, "friction_speed": 1e-5, "stop_stiffness": 500.0, "stop_gap": 4e-7},
}  # fmt: skip
MODE = {"parasitic_coupling": 5.0, "parasitic_frequency": 4200.0, "parasitic_q": 30.0, "parasitic_start": 1e-8}


@pytest.mark.parametrize("mode", [{}, MODE], ids=["alone", "beside a mode"])
@pytest.mark.parametrize("case", PLACES)
def test_between_what_bends_it_a_motion_is_that_of_series(
    case: str, mode: dict[str, float], fmus: dict[int, Fmu], residual: Residual
) -> None:
    device = PLACES[case] | mode
    found, wanted = motion(fmus[3], **device), motion(fmus[3], **device, k3_x=1.0)
    residual(case, difference(found, wanted), SAME)


# Steps of 5.0000005 µs are by turns as long and a picosecond longer. A friction of which nothing shows keeps its table
# busy too.
@pytest.mark.parametrize("device", [{}, MODE, {"friction_x": 1e-30}], ids=["steady", "mode", "friction"])
def test_steps_of_no_whole_number_of_picoseconds(
    device: dict[str, float], fmus: dict[int, Fmu], residual: Residual
) -> None:
    found, wanted = (motion(fmus[3], **device, internal_step=5.0000005e-6, k3_x=k3) for k3 in (0.0, 1.0))
    residual("states", difference(found, wanted), SAME)


def test_a_stribeck_speed_that_is_never_left_is_more_friction(fmus: dict[int, Fmu], residual: Residual) -> None:
    # exp(-(v/v_s)²) is 1 - 1e-12 at 0.01 m/s; friction is a thirtieth of the force.
    friction = {"friction_x": 2e-6, "friction_y": 1e-6}
    found = motion(fmus[3], **friction, stribeck=0.5, stribeck_speed=1e4)
    wanted = motion(fmus[3], **{name: 1.5 * value for name, value in friction.items()})
    residual("states", difference(found, wanted), SAME)


def test_a_state_brings_its_hysteresis_with_it(fmus: dict[int, Fmu]) -> None:
    # The curves that values are read from are those of another exponent.
    with Instance(fmus[3]) as sharp, Instance(fmus[3]) as other:
        sharp.start(**START, **HYSTERESIS["sharp"])
        other.start(**START, **HYSTERESIS["of one axis"])
        sharp.run(0, 20)
        other.run(0, 10)
        saved = sharp.save()
        assert other.restore(saved) == OK
        assert other.run(20, 60) == sharp.run(20, 60)
        sharp.free_saved(saved)


# A thirtieth of what laws may bend the stiffness in a step off a line, 1e-9 of it, is left of a parabola. The frequency
# changes by half of that, through the 200 rad of 10 ms.
LAWS = 3e-9


@pytest.mark.parametrize("internal_step", [1e-4, 1e-3])
def test_a_linear_device_that_warms_needs_no_short_steps(
    internal_step: float, fmus: dict[int, Fmu], residual: Residual
) -> None:
    # From the first millisecond on, the stiffness on its way to 4 % less, the damping to 20 % more.
    warming = {"structure_lag": 2.0, "tck": -1e-3, "tck_split": 4e-4, "tcd": 5e-3, "temperature": 300.0}
    rows = []
    for step in (5e-6, internal_step):
        rng = np.random.default_rng(44)
        with Instance(fmus[3]) as gyro:
            gyro.start(**START, **warming, internal_step=step, sample_period=1e-3)
            for k in range(11):
                gyro.set(u_x=5e-6 * rng.standard_normal(), u_y=5e-6 * rng.standard_normal())
                gyro.set(temperature=300.0 if k == 0 else 340.0)
                assert gyro.step(k * 1e-3, 1e-3) == OK, gyro.log
                rows.append(gyro.get(*STATES))
    residual("states", difference(np.array(rows[11:]), np.array(rows[:11])), LAWS)


@pytest.mark.parametrize("speed", [1e-7, 1e-6, 1e-5])
def test_a_friction_that_turns_round_in_less_than_a_thousandth_of_a_step(
    speed: float, fmus: dict[int, Fmu], residual: Residual
) -> None:
    """By DOP853, which goes as finely as it has to; the turn takes 2e-5 to 2e-3 of the step."""
    m, d, k, u, friction, start = 1.8e-7, 6.8e-7, 63.955, 4e-4, 1e-5, -5e-3

    def rate(t: float, s: NDArray[np.float64]) -> list[float]:
        return [s[1], (u - friction * np.tanh(s[1] / speed) - d * s[1] - k * s[0]) / m]

    wanted = solve_ivp(rate, (0.0, STEP), [0.0, start], method="DOP853", rtol=1e-13, atol=1e-18).y[:, -1]
    own = {"m": m, "dxx": d, "kxx": k, "kxy": 0.0, "dxy": 0.0, "friction_x": friction, "friction_speed": speed}
    with Instance(fmus[3]) as gyro:
        gyro.start(**own, x_start=0.0, x_dot_start=start, y_start=0.0, y_dot_start=0.0, sample_period=STEP)
        gyro.set(u_x=u, u_y=0.0, omega_z=0.0)
        assert gyro.step(0.0, STEP) == OK, gyro.log
        found = np.array(gyro.get("x", "x_dot"))
    # It is off by 5e-5 where no part of the step is shorter than a thousandth.
    residual("states", float(np.max(np.abs(found / wanted - 1))), 1e-10)
