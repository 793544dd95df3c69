"""The table reader: three kinds of file, columns in SI, and what is refused in one line."""

import gzip
from datetime import datetime, timedelta
from math import pi
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.io import savemat

from gyro_model.errors import InputError
from gyro_model.tables import Table, read_table
from gyro_model.tables.table import stated_unit
from gyro_model.units import MEASURED, conversion, dimension

FRAME = pl.DataFrame({"t": [0.0, 0.5, 1.0], "rate (deg/s)": [0.0, 180.0, -90.0], "T": [25.0, 26.0, 27.0]})


def table(**columns: list[object]) -> Table:
    return Table("lab.csv", pl.DataFrame(columns))


@pytest.mark.parametrize("name", ["lab.csv", "lab.csv.gz", "lab.parquet", "LAB.CSV", "lab.txt"])
def test_every_kind_of_file_gives_the_same_columns(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    text = FRAME.write_csv().encode()
    if name.endswith(".parquet"):
        FRAME.write_parquet(path)
    else:
        path.write_bytes(gzip.compress(text) if name.endswith(".gz") else text)
    read = read_table(path)
    assert read.headings == FRAME.columns
    assert len(read) == 3
    np.testing.assert_array_equal(read.times(), [0, 0.5, 1])
    np.testing.assert_allclose(read.quantity("rate (deg/s)", "rad/s"), [0, pi, -pi / 2], rtol=1e-15)
    np.testing.assert_array_equal(read.quantity("T", "K", "degC"), [298.15, 299.15, 300.15])


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("none.csv", None, "does not exist"),
        ("plain.csv.gz", b"t,rate\n", "can't be read"),
        ("cut.csv.gz", gzip.compress(b"t,rate\n0,1\n", mtime=0)[:-9], "can't be read"),
        ("empty.csv", b"", "no table with a header line"),
        ("text.parquet", b"t,rate\n", "no table with a header line"),
        ("noise.csv", np.random.default_rng(1).bytes(100_000), "no table with a header line"),
    ],
)
def test_no_table_is_said_in_one_line(tmp_path: Path, name: str, content: bytes | None, message: str) -> None:
    path = tmp_path / name
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(InputError, match=message) as caught:
        read_table(path)
    # Nor does what is no text write to the terminal.
    assert str(caught.value).isprintable()


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ([1.0, None], "is None in row 2, not a finite number"),
        ([1.0, float("nan")], "is nan in row 2"),
        ([float("inf"), 1.0], "is inf in row 1"),
        (["1", "x"], "is 'x' in row 2"),
        ([True, False], "of type Boolean: give plain numbers"),
    ],
)
def test_cells_that_are_no_numbers(values: list[object], message: str) -> None:
    with pytest.raises(InputError, match=message):
        table(rate=values).numbers("rate")


def test_a_mistyped_heading_is_named() -> None:
    with pytest.raises(InputError, match=r"lab.csv has no column 'rte'; did you mean 'rate'\? \(columns: t, rate\)"):
        table(t=[0], rate=[1]).numbers("rte")


def test_units_are_never_guessed() -> None:
    with pytest.raises(InputError, match="'rate' names no unit: give one of deg/s, rad/s"):
        table(rate=[1.0]).quantity("rate", "rad/s")
    with pytest.raises(InputError, match=r"'rate \[deg/s\]' is in deg/s by its heading, not in rad/s"):
        table(**{"rate [deg/s]": [1.0]}).quantity("rate [deg/s]", "rad/s", "rad/s")
    with pytest.raises(InputError, match=r"unit 'deg/ss' is not known: use .*; did you mean 'deg/s'\?"):
        table(rate=[1.0]).quantity("rate", "rad/s", "deg/ss")
    # Another spelling of the same unit contradicts nothing.
    np.testing.assert_allclose(table(**{"w (°/s)": [180.0]}).quantity("w (°/s)", "rad/s", "dps"), [pi])


def test_time_has_the_unit_of_its_heading_and_increases() -> None:
    np.testing.assert_allclose(table(**{"time [ms]": [0, 500]}).times(), [0, 0.5])
    np.testing.assert_allclose(table(n=[1, 2], clock=[3, 4]).times("clock"), [3, 4])
    with pytest.raises(InputError, match=r"time 't' does not increase at row 3 \(1 then 1 s\)"):
        table(t=[0, 1, 1]).times()
    np.testing.assert_allclose(table(**{"t [minutes]": [0, 2]}).times(), [0, 120])
    with pytest.raises(InputError, match=r"time 't \[days\]' is in 'days', which is no unit of time: use one of .*min"):
        table(**{"t [days]": [0, 2]}).times()


@pytest.mark.parametrize(
    ("heading", "si", "unit"),
    [
        ("Gyroscope Z (deg/s)", "rad/s", "deg/s"),
        ("rate_rad/s", "rad/s", "rad/s"),
        ("gyro [mrad/s]", "rad/s", "mrad/s"),
        ("gyro krad/s", "rad/s", None),
        ("slope [deg/s2]", "rad/s", None),
        ("a [m/s^2]", "m/s2", "m/s^2"),
        ("temperature (°C)", "K", "°C"),
        ("T_degC", "K", "degC"),
        ("t_ms", "s", "ms"),
        ("T_C", "K", None),
        ("C", "K", None),
        ("rate (raw)", "rad/s", None),
        ("rate (V)", "rad/s", None),
    ],
)
def test_stated_units(heading: str, si: str, unit: str | None) -> None:
    assert stated_unit(heading, si) == unit


@pytest.mark.parametrize(
    ("value", "unit", "si", "expected"),
    [
        (360.0, "deg/s", "rad/s", 2 * pi),
        (3600.0, "deg/h", "rad/s", pi / 180),
        (-273.15, "degC", "K", 0.0),
        (1.0, "g", "m/s2", 9.80665),
        (5.0, "mV", "V", 5e-3),
        (2.0, "min", "s", 120.0),
        (3.0, "kN", "N", 3000.0),
        (7.0, "kg", "kg", 7.0),
    ],
)
def test_conversions_by_hand(value: float, unit: str, si: str, expected: float) -> None:
    factor, offset = conversion(unit, si)
    # One rounding of the factor and one of the product.
    assert factor * value + offset == pytest.approx(expected, rel=4e-16, abs=1e-30)


@given(st.sampled_from(sorted(MEASURED)))
def test_an_si_unit_is_itself_and_has_a_dimension(si: str) -> None:
    assert conversion(si, si) == (1.0, 0.0)
    dimension(si)


@pytest.mark.parametrize("text", ["die;x [mm]\na-1;0,5\na-2;1,5\n", "die,x [mm]\na-1,0.5\na-2,1.5\n"])
def test_of_two_separators_that_read_as_many_numbers_the_one_with_headings(tmp_path: Path, text: str) -> None:
    path = tmp_path / "devices.csv"
    path.write_text(text)
    read = read_table(path)
    assert read.headings == ["die", "x [mm]"]
    np.testing.assert_array_equal(read.numbers("x [mm]"), [0.5, 1.5])


def test_a_preamble_may_hold_numbers_and_channels_one_name(tmp_path: Path) -> None:
    text = "Stamp,a,Stamp,a\nInterval,0.5,Interval,0.5\nChannel,Force,Channel,Force\nUnit,V,Unit,V\n0,1,0,2\n1,3,1,4\n"
    (tmp_path / "scope.csv").write_text(text)
    frame = read_table(tmp_path / "scope.csv").frame
    assert frame.columns == ["Channel [Unit]", "Force [V]", "Channel [Unit] (2)", "Force [V] (2)"]
    assert frame["Force [V] (2)"].to_list() == [2, 4]


def test_lines_of_steps_and_starts_above_a_long_table_are_preamble(tmp_path: Path) -> None:
    # As LabVIEW writes a measurement file: two lines with as many numbers as the table, and then its headings.
    steps = ["X_Dimension\tTime\tTime\t", "X0\t0.0\t0.0\t", "Delta_X\t0.1\t0.1\t"]
    rows = [f"{0.1 * k:.1f}\t{k % 3}\t{k % 5}\t" for k in range(60)]
    lines = ["LabVIEW Measurement\t", "Channels\t2\t\t", *steps, "*X_Value\tForce\tMotion\tComment", *rows]
    path = tmp_path / "measured.lvm"
    path.write_text("\r\n".join(lines), encoding="utf-8")
    read = read_table(path)
    assert read.headings[:3] == ["X_Value", "Force", "Motion"]
    assert len(read) == 60


def test_a_remark_near_the_begin_of_a_table_does_not_cut_it(tmp_path: Path) -> None:
    rows = [f"{k}\t{k % 3}" for k in range(60)]
    path = tmp_path / "remarked.txt"
    path.write_text("\n".join(["t\tu", *rows[:20], "paused\there", *rows[20:]]), encoding="utf-8")
    read = read_table(path)
    assert read.headings == ["t", "u"]
    assert len(read) == 61


def test_vectors_within_structs_of_matlab_are_columns_by_path(tmp_path: Path) -> None:
    wave = np.arange(9.0)
    savemat(
        tmp_path / "beam.mat", {"steel": {"out": {"acc": np.stack((wave, -wave)), "time": wave, "note": "by hand"}}}
    )
    assert read_table(tmp_path / "beam.mat").headings == ["steel.out.acc 1", "steel.out.acc 2", "steel.out.time"]


def test_what_is_no_array_within_a_struct_is_left_out(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As of an object of MATLAB's, whose fields scipy gives as bytes."""
    from scipy import io

    wave = np.arange(9.0)
    made = np.array((b"MCOS", wave), [("kind", object), ("wave", object)])
    monkeypatch.setattr(io, "loadmat", lambda *_, **__: {"own": made.reshape(1, 1)})
    (tmp_path / "own.mat").write_bytes(bytes(600))
    assert read_table(tmp_path / "own.mat").headings == ["own.wave"]


STAMPS = {
    "ISO 8601": ("2025-03-04T23:59:59.500Z", "2025-03-05T00:00:00.25Z", "2025-03-05T00:00:01Z"),
    "ISO 8601 with a zone": (
        "2025-03-04T23:59:59.500+01:00",
        "2025-03-05T00:00:00.25+01:00",
        "2025-03-05T00:00:01+01:00",
    ),
    "a blank between": ("2025-03-04 23:59:59.500", "2025-03-05 00:00:00.250", "2025-03-05 00:00:01.000"),
    "German": ("04.03.2025 23:59:59,500", "05.03.2025 00:00:00,250", "05.03.2025 00:00:01,000"),
    "day first": ("4/3/2025 23:59:59.500", "5/3/2025 0:00:00.250", "5/3/2025 0:00:01.000"),
    "month first": ("3/14/2025 23:59:59.500", "3/15/2025 0:00:00.250", "3/15/2025 0:00:01.000"),
    "time of day": ("09:30:00.500", "09:30:01.250", "09:30:02"),
}


@pytest.mark.parametrize("stamps", STAMPS.values(), ids=STAMPS)
def test_stamps_of_date_and_time_are_seconds_since_the_first(tmp_path: Path, stamps: tuple[str, ...]) -> None:
    path = tmp_path / "log.csv"
    path.write_text("".join(f'"{a}";{b}\n' for a, b in (("stamp", "x"), *zip(stamps, (1, 2, 3), strict=True))))
    table = read_table(path)
    assert table.times("stamp") == pytest.approx([0.0, 0.75, 1.5], abs=1e-9)
    assert table.numbers("x").tolist() == [1, 2, 3]


def test_stamps_of_other_files_are_seconds_too(tmp_path: Path) -> None:
    begin, steps = datetime(2025, 3, 4, 23, 59, 59), [timedelta(milliseconds=own) for own in (0, 750, 1500)]
    frame = pl.DataFrame({"date": [begin + own for own in steps], "since": steps})
    for unit in ("ms", "us", "ns"):
        frame.with_columns(pl.col("date").dt.cast_time_unit(unit)).write_parquet(tmp_path / "log.parquet")
        table = read_table(tmp_path / "log.parquet")
        assert table.times("date") == pytest.approx([0.0, 0.75, 1.5], abs=1e-9)
        assert table.numbers("since") == pytest.approx([0.0, 0.75, 1.5], abs=1e-9)


def test_what_is_no_stamp_in_every_row_stays_as_it_is(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text("stamp,x\n2025-03-04 09:30:00,1\nlater,2\n2025-03-04 09:30:02,3\n")
    with pytest.raises(InputError, match="'2025-03-04 09:30:00' in row 1"):
        read_table(path).times("stamp")
