"""What the package goes through: values, and what is refused in one line."""

from pathlib import Path

import numpy as np
import pytest

from cosim.rate import courses
from cosim.rate.courses import ZERO_CELSIUS, constant_temperature, rate_step, temperature_ramp, temperature_table
from cosim.rate.from_scenario import courses_of
from cosim.rate.run import RateRun
from cosim.scenarios import load_scenario
from gyro_model.device import load_device
from gyro_model.errors import InputError

DEVICE = load_device("rate-mode")


def test_rate_step_rests_and_turns_by_quarters() -> None:
    held = rate_step(1.5, 8.0).held(0, 9, 1.0)
    np.testing.assert_array_equal(held, [0, 0, 1.5, 1.5, 0, 0, -1.5, -1.5, 0])


def test_ramp_runs_in_kelvin_a_minute_and_stays() -> None:
    course = temperature_ramp(253.15, 263.15, 2.0)
    assert course.length == pytest.approx(300.0)
    np.testing.assert_allclose(course.values(np.array([0.0, 150.0, 400.0])), [253.15, 258.15, 263.15])


@pytest.mark.parametrize(("column", "shift"), [("temperature_deg_c", 0.0), ("temperature", ZERO_CELSIUS)])
def test_table_in_either_unit(tmp_path: Path, column: str, shift: float) -> None:
    path = tmp_path / "profile.csv"
    path.write_text(f"t,{column}\n0,{20 + shift}\n100,{30 + shift}\n", encoding="utf-8")
    course = temperature_table(path)
    assert course.length == 100
    np.testing.assert_allclose(course.values(np.array([50.0])), 25 + ZERO_CELSIUS)


@pytest.mark.parametrize(
    "text",
    [
        "t [min];Chamber [°C];Humidity\n0,0;20,5;40\n2,0;21,5;41\n",
        "t_ms,T_degC\n0,20.5\n120000,21.5\n",
        "T (K)\tt\n293.65\t0\n294.65\t120\n",
    ],
)
def test_units_stand_in_the_headings(tmp_path: Path, text: str) -> None:
    path = tmp_path / "chamber.txt"
    path.write_text(text, encoding="utf-8")
    course = temperature_table(path)
    assert course.length == pytest.approx(120.0)
    np.testing.assert_allclose(course.values(np.array([60.0])), 21 + ZERO_CELSIUS)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("t,temperature_deg_c\n0,20\n5,21\n5,22\n", "does not increase at row 3"),
        ("t,temperature_deg_c\n0,20\n9,21\n5,22\n", "does not increase at row 3"),
        ("t,temperature_degc\n0,20\n5,21\n", "no temperature; did you mean 'temperature_deg_c'"),
        ("t,temperature,board [K]\n0,290,291\n5,291,292\n", "more than one temperature .temperature, board"),
        ("temperature [K],t [s]\n290,0\n291,5\n", "no column of times"),
        ("t\n0\n5\n", "give t .* and one of"),
        ("t,temperature_deg_c\n0,20\n", "1 rows; give two or more"),
        ("t,temperature_deg_c\n0,20\n5,warm\n", "'warm' in row 2, not a finite number"),
        ("t,temperature_deg_c\n3,20\n5,21\n", "begins at t = 3 s"),
        ("t,temperature\n0,20\n5,21\n", r"name the unit in the heading, such as temperature .degC."),
        ("t,temperature_deg_c\n0,298\n5,299\n", r"name the unit in the heading, such as temperature .K."),
        ("", "no table with a header line"),
    ],
)
def test_wrong_tables_are_refused(tmp_path: Path, text: str, says: str) -> None:
    path = tmp_path / "profile.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=says) as refused:
        temperature_table(path)
    assert "\n" not in str(refused.value)


def test_missing_table_says_what_else_to_give(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such file; give a table or START,STOP,RAMP"):
        temperature_table(tmp_path / "none.csv")


@pytest.mark.parametrize(
    "make",
    [
        lambda: rate_step(0.0, 8.0),
        lambda: rate_step(1.0, -8.0),
        lambda: rate_step(np.nan, 8.0),
        lambda: temperature_ramp(300.0, 300.0, 1.0),
        lambda: temperature_ramp(300.0, 310.0, 0.0),
        lambda: temperature_ramp(25.0, 310.0, 1.0),
        lambda: constant_temperature(-300.0),
        lambda: constant_temperature(np.inf),
    ],
)
def test_wrong_courses_are_refused(make) -> None:
    with pytest.raises(InputError, match="give"):
        make()


def run(**changes: object) -> RateRun:
    values = {"device": DEVICE, "rate": courses.constant(0.0, "rest"), "temperature": constant_temperature(25)}
    return RateRun(**{**values, "closed": False, "duration": 60.0, **changes})  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"rate": rate_step(6.0, 20.0)}, "343.8 deg/s at t = 5 s is beyond the full scale of 300 deg/s"),
        ({"rate": rate_step(1.0, 1.0)}, "--rate-period of 4.4 s or more"),
        (
            {"temperature": temperature_ramp(253.15, 333.15, 7000.0), "output_rate": 10.0},
            "within one row of the record",
        ),
        ({"duration": 0.0}, "duration 0 s"),
        ({"duration": np.nan}, "duration nan s"),
        ({"sample_rate": 3e4}, "8 times the drive frequency"),
        ({"output_rate": 0.1}, "output rate 0.1 Hz"),
        ({"device": load_device("whole_angle")}, "settles in .* give --plant envelope"),
        ({"rate": courses.Course(lambda t: 0 * t, 5.0, "measured")}, "lasts 5 s; shorten"),
    ],
)
def test_runs_that_can_not_be_are_refused(changes: dict[str, object], says: str) -> None:
    with pytest.raises(InputError, match=says) as refused:
        run(**changes)
    assert "\n" not in str(refused.value)


def test_a_fast_ramp_is_fine_with_more_rows() -> None:
    # 117 °C/s: 12 °C in a row of 10 Hz, 0.7 °C in one of 160 Hz.
    run(temperature=temperature_ramp(253.15, 333.15, 7000.0), output_rate=160.0)


def test_where_a_scenario_lets_the_mass_begin_does_not_keep_it_from_rate_mode() -> None:
    assert set(courses_of(load_scenario("staircase"))) == {"omega_z"}
    with pytest.raises(InputError, match="scenario varying sets damping_step_factor, damping_step_time: rate mode"):
        courses_of(load_scenario("varying"))
