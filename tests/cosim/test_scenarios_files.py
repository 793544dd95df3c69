"""Scenario files: each kind of course by example, and what is refused in one line."""

from math import pi
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cosim.rate_profile import read_profile
from cosim.scenarios import INPUT_NAMES, Scenario, files, load_scenario, scenario
from cosim.scenarios.files import KINDS
from gyro_model.errors import InputError
from gyro_model.quantities import INPUTS

HEAD = 'format = 1\nname = "mine"\ndescription = "made here"\nduration = 2.0\n'
PERIOD = 1e-3


def load(folder: Path, text: str, head: str = HEAD) -> Scenario:
    path = folder / "mine.toml"
    path.write_text(head + text, encoding="utf-8")
    return load_scenario(str(path))


def held(chosen: Scenario, name: str, count: int = 2000) -> np.ndarray:
    return chosen.inputs(0, count, PERIOD)[:, INPUT_NAMES.index(name)]


def test_inputs_are_all_but_the_forces() -> None:
    assert {"u_x", "u_y", *INPUT_NAMES} == {q.name for q in INPUTS}


def test_every_kind_in_one_file(tmp_path: Path) -> None:
    t = np.linspace(0, 5, 501)
    pl.DataFrame({"t": t, "a (g)": 0.1 * t}).write_parquet(tmp_path / "shaker.parquet")
    chosen = load(
        tmp_path,
        """
        angle_unit = "B"
        v_bias = 12.0
        [parameters]
        x_start = 2e-6
        [[omega_z]]
        kind = "steps"
        times = [0, 1.0]
        values = [0, 90]
        unit = "deg/s"
        [[omega_z]]
        kind = "square"
        amplitude = 1
        frequency = 1.0
        from = 1.0
        [temperature]
        kind = "ramps"
        times = [0.0, 1.0]
        values = [25.0, 35.0]
        unit = "degC"
        [a_x]
        kind = "column"
        file = "shaker.parquet"
        column = "a (g)"
        start = 1.0
        between = "lines"
        [a_y]
        kind = "sine"
        amplitude = 1.0
        frequency = 5.0
        unit = "g"
        """,
    )
    assert (chosen.name, chosen.duration, chosen.angle_unit) == ("mine", 2.0, "B")
    assert chosen.parameters == {"x_start": 2e-6}
    middle = (np.arange(2000) + 0.5) * PERIOD
    rate = np.where(middle < 1, 0, pi / 2) + np.where(middle < 1, 0, np.where(middle < 1.5, 1.0, -1.0))
    np.testing.assert_allclose(held(chosen, "omega_z"), rate, rtol=1e-14)
    np.testing.assert_allclose(held(chosen, "temperature"), 298.15 + np.minimum(10 * middle, 10), rtol=1e-14)
    np.testing.assert_allclose(held(chosen, "a_x"), 9.80665 * 0.1 * (1 + middle), rtol=1e-12)
    # Mean over a hold against its middle: (pi f T)^2/6 = 4e-5.
    np.testing.assert_allclose(held(chosen, "a_y"), 9.80665 * np.sin(10 * pi * middle), atol=5e-4)
    assert (held(chosen, "v_bias") == 12.0).all()
    np.testing.assert_allclose(chosen.edges_until(2.0), [1.0, 1.5])


@pytest.mark.parametrize(("between", "expected"), [("steps", 2.0), ("lines", 2.5), ("curve", 2.5)])
def test_what_runs_between_the_rows_of_a_record(tmp_path: Path, between: str, expected: float) -> None:
    (tmp_path / "v.csv").write_text("clock,V\n" + "\n".join(f"{100 + k},{1 + k}" for k in range(6)))
    text = f'[v_bias]\nkind = "column"\nfile = "v.csv"\ncolumn = "V"\nunit = "V"\nbetween = "{between}"\n'
    assert load(tmp_path, text).inputs(1, 1, 1.0)[0, 4] == pytest.approx(expected)


def test_a_column_of_a_rate_is_the_rate_profile(tmp_path: Path) -> None:
    t = np.arange(200) * 0.01
    table = tmp_path / "rate.csv"
    pl.DataFrame({"t": t, "w": np.sin(7 * t)}).write_csv(table)
    text = '[omega_z]\nkind = "column"\nfile = "rate.csv"\ncolumn = "w"\nunit = "deg/s"\nstart = 0.5\n'
    by_profile = scenario("motion", read_profile(table, "w", "deg/s"), 0.5)
    np.testing.assert_array_equal(
        load(tmp_path, text, HEAD.replace("2.0", "1.0")).omega_z(0, 1000, PERIOD), by_profile.omega_z(0, 1000, PERIOD)
    )


def test_a_record_may_end_where_its_course_does(tmp_path: Path) -> None:
    (tmp_path / "v.csv").write_text("t,V\n0,1\n1,1\n")
    column = '[v_bias]\nkind = "column"\nfile = "v.csv"\ncolumn = "V"\nunit = "V"\nbetween = "lines"\n'
    chosen = load(tmp_path, column + "from = 0.5\nuntil = 1.5\n")
    np.testing.assert_array_equal(chosen.inputs(0, 4, 0.5)[:, 4], [0, 1, 1, 0])
    with pytest.raises(InputError, match=r"record v.csv:V is too short: it lasts 1 s and the run needs 2 s"):
        load(tmp_path, column).inputs(0, 4, 0.5)


def test_a_file_given_to_scenario_needs_no_profile(tmp_path: Path) -> None:
    load(tmp_path, "omega_z = 1.0\n")
    assert scenario(str(tmp_path / "mine.toml")).omega_z(0, 1, PERIOD) == [1.0]


OMEGA = "[omega_z]\n"
WRONG = {
    "key": ("[omega]\nkind = 'sine'", r"key 'omega' is unknown; did you mean 'omega_z'\?"),
    "force": ("[u_x]\nkind = 'sine'", "key 'u_x' is unknown"),
    "kind": (OMEGA + "kind = 'sinus'", r"omega_z: kind = 'sinus': give .*; did you mean 'sine'\?"),
    "no kind": (OMEGA + "value = 1", "omega_z: kind is missing: give constant, steps"),
    "course key": (
        OMEGA + "kind = 'sine'\namplitude = 1\nfrequncy = 2",
        r"omega_z: key 'frequncy' is unknown to kind 'sine'; did you mean 'frequency'\?",
    ),
    "needed": (OMEGA + "kind = 'sine'\namplitude = 1", "frequency is missing: kind 'sine' needs amplitude, frequency"),
    "number": (OMEGA + "kind = 'constant'\nvalue = '1'", "value = '1': give a number"),
    "truth": (OMEGA + "kind = 'constant'\nvalue = true", "value = True: give a number"),
    "nan": (OMEGA + "kind = 'constant'\nvalue = nan", "value = nan: give a number"),
    "list": (OMEGA + "kind = 'steps'\ntimes = 0\nvalues = [1]", "times = 0: give a list of numbers"),
    "first time": (
        OMEGA + "kind = 'steps'\ntimes = [1, 2]\nvalues = [1, 2]",
        "times begins at 1 s: let it begin at 0 s, as the course does",
    ),
    "unit": (OMEGA + "kind = 'constant'\nvalue = 1\nunit = 'rad/sek'", r"unit 'rad/sek' is not known.*'rad/sec'\?"),
    "unit of a wave": (
        "[temperature]\nkind = 'sine'\namplitude = 1\nfrequency = 1\nunit = 'degC'",
        "unit = 'degC': a wave swings about zero; give its amplitude in K",
    ),
    "two Celsius": (
        "[[temperature]]\nkind = 'constant'\nvalue = 5\nunit = 'degC'\n" * 2,
        "temperature, course 2: the sum of two temperatures in degrees Celsius is none",
    ),
    "Celsius as K": ("temperature = 25.0", "temperature reaches 25 K"),
    "window": (OMEGA + "kind = 'constant'\nvalue = 1\nfrom = 1\nuntil = 1", "until = 1.0: give a time after 1 s"),
    "no table": ("omega_z = 'fast'", r"omega_z = 'fast': give a number, a table \[omega_z\]"),
    "no column": (OMEGA + "kind = 'column'\nfile = 'r.csv'\ncolumn = 'rte'\nunit = 'deg/s'", "did you mean 'rate'"),
    "no unit": (OMEGA + "kind = 'column'\nfile = 'r.csv'\ncolumn = 'rate'", "column 'rate' names no unit: give one of"),
    "no file": (OMEGA + "kind = 'column'\nfile = 'none.csv'\ncolumn = 'rate'\nunit = 'K'", "none.csv does not exist"),
    "start": (
        OMEGA + "kind = 'column'\nfile = 'r.csv'\ncolumn = 'rate'\nunit = 'deg/s'\nstart = 9",
        "start 9 s lies outside the record r.csv:rate, which lasts 3 s",
    ),
    "between": (
        OMEGA + "kind = 'column'\nfile = 'r.csv'\ncolumn = 'rate'\nunit = 'deg/s'\nbetween = 'line'",
        r"between = 'line': give curve or lines or steps; did you mean 'lines'\?",
    ),
    "hole": (
        OMEGA + "kind = 'column'\nfile = 'hole.csv'\ncolumn = 'rate'\nunit = 'deg/s'",
        r"hole.csv: 98 s without a reading after row 3 \(t = 2 s\)",
    ),
    "parameter": ("[parameters]\nx_start = 'a'", "parameter x_start = 'a': give a number, SI"),
    "parameters": ("parameters = 3", r"parameters = 3: make it a table \[parameters\]"),
    "angle unit": ("angle_unit = 'D'", "angle_unit = 'D': give A, B, C"),
    "not TOML": ("omega_z = ", "not TOML"),
}


@pytest.mark.parametrize("case", WRONG)
def test_what_is_wrong_is_named_in_one_line(case: str, tmp_path: Path) -> None:
    text, message = WRONG[case]
    (tmp_path / "r.csv").write_text("t,rate\n0,1\n1,2\n2,3\n3,4\n")
    (tmp_path / "hole.csv").write_text("t,rate\n0,1\n1,2\n2,3\n100,4\n101,4\n")
    with pytest.raises(InputError, match=message) as caught:
        load(tmp_path, text)
    assert str(caught.value).startswith(f"scenario file {tmp_path / 'mine.toml'}: ")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("head", "message"),
    [
        (HEAD.replace("format = 1", "format = 2"), "format = 2: this program reads format = 1"),
        (HEAD.replace("name", "nme"), r"key 'nme' is unknown; did you mean 'name'\?"),
        (HEAD.replace('name = "mine"\n', ""), 'name is missing: add name = "..."'),
        (HEAD.replace("2.0", "0"), "duration = 0.0: give a positive time in s"),
        (HEAD.replace("duration = 2.0\n", ""), "duration = None: give a time in s"),
    ],
)
def test_a_wrong_head_is_named(head: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=message):
        load(tmp_path, "", head)


CELLS = st.one_of(
    st.none(), st.booleans(), st.integers(), st.integers(10**400, 10**401), st.floats(), st.text(max_size=3),
    st.lists(st.one_of(st.floats(-2, 2), st.integers(0, 3), st.text(max_size=1)), max_size=3),
)  # fmt: skip
COURSE_KEYS = ("unit", "from", "until", "value", "times", "values", "amplitude", "frequency", "phase", "file", "column",
               "time", "start", "between")  # fmt: skip
TABLES = st.builds(
    lambda kind, rest: {"kind": kind} | rest,
    st.sampled_from(sorted(KINDS)),
    st.dictionaries(st.sampled_from(COURSE_KEYS), CELLS, max_size=5),
)
FILES = st.dictionaries(
    st.sampled_from(["name", "description", "duration", "angle_unit", "parameters", *INPUT_NAMES]),
    st.one_of(CELLS, TABLES, st.lists(TABLES, max_size=2)),
)


@settings(max_examples=400)
@given(FILES, st.booleans())
def test_whatever_stands_in_a_file_is_a_scenario_or_an_input_error(data: dict[str, object], whole: bool) -> None:
    head = {"format": 1, "name": "n", "description": "d", "duration": 1.0} if whole else {"format": 1}
    try:
        chosen = files._scenario(data | head, Path("nowhere"))
        chosen.inputs(0, 10, 1e-3)
        chosen.edges_until(1.0)
    except InputError as error:
        assert "\n" not in str(error)


def test_no_such_scenario_says_what_there_is() -> None:
    with pytest.raises(InputError, match=r"'spni' is not known; did you mean 'spin'\? \(scenarios: constant, .*, or a"):
        load_scenario("spni")


def test_every_kind_is_documented() -> None:
    text = (Path(__file__).parents[2] / "docs" / "scenarios.md").read_text(encoding="utf-8")
    assert [kind for kind in KINDS if f'kind = "{kind}"' not in text] == []


def test_the_documented_example_loads(tmp_path: Path) -> None:
    text = (Path(__file__).parents[2] / "docs" / "scenarios.md").read_text(encoding="utf-8")
    lines = text.splitlines()
    example = "\n".join(line[4:] for line in lines if line.startswith("    ") and "gyrotwin" not in line)
    (tmp_path / "drive.csv").write_text("t,Gyro Z (deg/s)\n" + "\n".join(f"{k},{k % 7}" for k in range(40)))
    chosen = load(tmp_path, example, head="")
    assert set(chosen.courses) == set(INPUT_NAMES)
    chosen.inputs(0, round(chosen.duration * 1000), PERIOD)
