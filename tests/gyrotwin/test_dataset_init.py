"""`gyrotwin dataset init` as a user types it: a lab's tables in, a data set that loads out, or one line."""

from pathlib import Path

import numpy as np
import polars as pl
import pytest
import typer

from discrepancy.data.dataset import load_dataset
from discrepancy.data.import_table import Request, guess_sources, write_dataset
from gyro_model.device import load_device
from gyro_model.errors import InputError
from gyrotwin.dataset import dataset_app

SILVERBOX = Path(__file__).parents[3] / "shared" / "data" / "silverbox" / "SNLS80mV.csv.gz"
N = 1000
T = np.arange(N) / 1e5
WAVE = np.sin(2 * np.pi * 3000 * T)
LAB = {
    "Time (ms)": 1e3 * T,
    "F_x [uN]": WAVE,
    "F_y [uN]": 2 * WAVE,
    "sense x [mV]": 100 * WAVE,
    "sense y [mV]": 200 * WAVE,
    "rate [deg/s]": np.full(N, 90.0),
    "temp [degC]": np.full(N, 25.0),
    "remark": ["x"] * N,
}


def init(*arguments: str | Path) -> None:
    """The sub-command in this process; raises what it raises."""
    typer.main.get_command(dataset_app).main(["init", *map(str, arguments)], standalone_mode=False)


def lab_table(folder: Path, name: str = "one.csv", **changes: object) -> Path:
    pl.DataFrame({k: v for k, v in (LAB | changes).items() if v is not None}).write_csv(folder / name)
    return folder / name


def test_guesses_columns_and_units_from_headings(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    files = [lab_table(tmp_path, name) for name in ("one.csv", "two.csv")]
    init(*files, "--out", tmp_path / "set", "--nominal", "reference")
    data = load_dataset(tmp_path / "set")
    [record] = data.fit
    assert record.name == "one.parquet"
    assert [held.name for held in data.held_out] == ["two.parquet"]
    assert "held out: two.parquet" in capsys.readouterr().out
    assert data.nominal == load_device("reference").parameters
    assert record.sample_rate == pytest.approx(1e5, rel=1e-6)  # written with six digits
    # One multiplication by a unit's factor rounds twice at most.
    for values, expected in (
        (record.t, T),
        (record.u, 1e-6 * np.stack((WAVE, 2 * WAVE), 1)),
        (record.v, 0.1 * np.stack((WAVE, 2 * WAVE), 1)),
        (record.conditions["omega_z"], np.full(N, np.pi / 2)),
        (record.conditions["temperature"], np.full(N, 298.15)),
    ):
        assert values == pytest.approx(expected, rel=1e-14, abs=1e-30)


@pytest.mark.parametrize(
    ("force", "motion", "senses", "scale"),
    [("F [uN]", "Displacement [um]", "position", 1e-6), ("Kraft (mN)", "Velocity (mm/s)", "velocity", 1e-3)],
)
def test_a_single_axis_is_told_by_its_units(
    force: str, motion: str, senses: str, scale: float, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pl.DataFrame({"Time [s]": T, force: WAVE, motion: WAVE, "remark": ["x"] * N}).write_csv(tmp_path / "one.csv")
    init(tmp_path / "one.csv", "--out", tmp_path / "set")
    said = capsys.readouterr().out
    assert f"u_x = {force!r}" in said and f"v_x = {motion!r}" in said
    text = (tmp_path / "set/dataset.toml").read_text()
    assert ('senses = "velocity"' in text) == (senses == "velocity")
    table = pl.read_parquet(tmp_path / "set/one-fit.parquet")
    # One multiplication by a unit's factor rounds twice at most.
    assert table["v_x"].to_numpy() == pytest.approx(scale * WAVE[: len(table)], rel=1e-14, abs=1e-30)


def test_the_response_says_how_the_force_ran(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rng = np.random.default_rng(1)
    t = np.arange(8000) / 8e3
    w, phase = 2 * np.pi * rng.uniform(500, 1400, 40), rng.uniform(0, 2 * np.pi, 40)
    square = (2 * np.pi * 900.0) ** 2
    tones = np.exp(1j * (w * t[:, None] + phase))
    force = tones.sum(axis=1).real
    moved = (tones / (square - w**2 + 1j * w * 90)).sum(axis=1).real
    moved += 1e-3 * moved.std() * rng.standard_normal(len(t))
    pl.DataFrame({"t": t, "F [N]": force, "x [m]": moved}).write_csv(tmp_path / "one.csv")
    init(tmp_path / "one.csv", "--out", tmp_path / "set")
    assert 'hold = "band-limited"' in capsys.readouterr().out
    assert {record.hold for record in load_dataset(tmp_path / "set").records} == {"band-limited"}
    init(tmp_path / "one.csv", "--out", tmp_path / "other", "--hold", "zero")
    assert {record.hold for record in load_dataset(tmp_path / "other").records} == {"zero"}


def test_of_two_columns_with_a_unit_of_motion_none_is_taken(tmp_path: Path) -> None:
    pl.DataFrame({"t": T, "F [N]": WAVE, "laser 1 [um]": WAVE, "laser 2 [um]": WAVE}).write_csv(tmp_path / "one.csv")
    with pytest.raises(InputError, match="which heading is v_x"):
        init(tmp_path / "one.csv", "--out", tmp_path / "set")


def test_units_tell_a_drive_and_a_turn_rate_beside_two_voltages() -> None:
    headings = ["Time [s]", "Drive [uN]", "Vx [mV]", "Vy [mV]", "Drehrate [deg/s]"]
    request = Request((), Path("out"), maps={"u_y": "none"})
    sources = guess_sources(headings, request)
    assert (sources["u_x"].heading, sources["u_x"].factor) == ("Drive [uN]", 1e-6)
    assert sources["omega_z"].heading == "Drehrate [deg/s]"
    assert sources["omega_z"].factor == pytest.approx(np.pi / 180)
    # Of one axis it is the motion.
    alone = Request((), Path("out"))
    assert guess_sources(["Time [s]", "Torque [Nm]", "Drehrate [deg/s]"], alone)["v_x"].heading == "Drehrate [deg/s]"


def test_all_that_is_not_told_is_asked_at_once(tmp_path: Path) -> None:
    columns = {"t [s]": T, "Shaker force [N]": WAVE, "Vib1 [mm/s]": WAVE, "Vib2 [mm/s]": WAVE}
    pl.DataFrame(columns).write_csv(tmp_path / "two.csv")
    request = Request((tmp_path / "two.csv",), tmp_path / "out", maps={"u_y": "none", "u_x": "2"})
    with pytest.raises(InputError, match=r"which headings are v_x, v_y\? Give --map v_x=HEADING --map v_y=HEADING"):
        write_dataset(request)


def test_the_only_heading_left_is_the_voltage(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pl.DataFrame({"time": T, "force": WAVE, "disp": WAVE}).write_csv(tmp_path / "one.csv")
    init(tmp_path / "one.csv", "--out", tmp_path / "set")
    assert "v_x = 'disp' [V]" in capsys.readouterr().out
    # Neither a table whose time or force is not known nor one with two such headings says which it is.
    for headings in (["when", "force", "disp"], ["time", "push", "disp"], ["time", "force", "disp", "other"]):
        pl.DataFrame({name: T if i == 0 else WAVE for i, name in enumerate(headings)}).write_csv(tmp_path / "two.csv")
        with pytest.raises(InputError, match=r"which headings? (is|are)"):
            init(tmp_path / "two.csv", "--out", tmp_path / "other")


def test_a_single_table_is_cut_for_the_held_out_run(tmp_path: Path) -> None:
    init(lab_table(tmp_path), "--out", tmp_path / "set", "--nominal", "reference")
    data = load_dataset(tmp_path / "set")
    assert [len(record.t) for record in data.records] == [800, 200]
    assert data.held_out[0].name == "one-held-out.parquet"


def test_a_hole_and_empty_rows_cut_a_table(tmp_path: Path) -> None:
    t = 1e3 * np.where(np.arange(N) < 400, T, T + 0.01)
    sense = [None if k == 700 else 100 * WAVE[k] for k in range(N)]
    init(
        lab_table(tmp_path, **{"Time (ms)": t, "sense x [mV]": sense}),
        "--out",
        tmp_path / "set",
        "--nominal",
        "reference",
    )
    data = load_dataset(tmp_path / "set")
    # One sample of v that is missing is masked; what u did over a long hole is not known.
    assert [len(record.t) for record in data.records] == [400, 600]
    assert [record.role for record in data.records] == ["fit", "held-out"]
    assert np.flatnonzero(~data.records[1].valid).tolist() == [300]


def test_a_few_missing_rows_are_masked_and_one_run_stays(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    lost = np.sort(rng.choice(np.arange(1, N - 1), 12, replace=False))
    kept = np.setdiff1d(np.arange(N), lost)
    file = tmp_path / "one.csv"
    pl.DataFrame({k: np.asarray(v)[kept] for k, v in LAB.items()}).write_csv(file)
    init(file, "--out", tmp_path / "set", "--nominal", "reference")
    data = load_dataset(tmp_path / "set")
    assert [len(record.t) for record in data.records] == [800, 200]
    masked = np.concatenate([~record.valid for record in data.records])
    assert np.flatnonzero(masked).tolist() == lost.tolist()
    assert np.allclose(np.concatenate([record.t for record in data.records]), T, atol=1e-9)


DIALECTS = {
    "decimal comma": (";", True, "utf-8", "Versuch 7\nDatum: 22.11.2026\n\n"),
    "tabs, UTF-16": ("\t", False, "utf-16", ""),
    "white space": (" ", False, "utf-8", "# an instrument\n"),
    "Latin": (",", False, "cp1252", "Gerät: 9\n"),
}


@pytest.mark.parametrize("case", DIALECTS)
def test_text_as_labs_write_it(tmp_path: Path, case: str) -> None:
    separator, comma, encoding, above = DIALECTS[case]
    file = tmp_path / "one.txt"
    rows = [["t", "u_x", "v_x"], *([f"{x:.9g}" for x in row] for row in zip(T, WAVE, 2 * WAVE, strict=True))]
    lines = [separator.join(c.replace(".", ",") if comma else c for c in row) for row in rows]
    file.write_bytes((above + "\n".join(lines) + "\n").encode(encoding))
    init(file, "--out", tmp_path / "set", "--nominal", "reference")
    record = load_dataset(tmp_path / "set").fit[0]
    assert np.allclose(record.v[:, 0], 2 * WAVE[:800], atol=1e-8)


def test_arrays_and_matlab_files(tmp_path: Path) -> None:
    from scipy.io import savemat

    savemat(tmp_path / "one.mat", {"t": T, "u_x": WAVE, "v_x": 2 * WAVE, "note": "text"})
    np.savez(tmp_path / "two.npz", t=T, u_x=WAVE, v_x=2 * WAVE)
    np.save(tmp_path / "three.npy", np.column_stack((T, WAVE, 2 * WAVE)))
    maps = ["--map", "t=column 1", "--map", "u_x=column 2", "--map", "v_x=column 3"]
    for name, options in (("one.mat", []), ("two.npz", []), ("three.npy", maps)):
        init(tmp_path / name, "--out", tmp_path / name.split(".")[0], "--nominal", "reference", *options)
        record = load_dataset(tmp_path / name.split(".")[0]).fit[0]
        assert record.v[:, 0].tolist() == (2 * WAVE[:800]).tolist()


def test_objects_in_arrays_are_not_loaded(tmp_path: Path) -> None:
    np.save(tmp_path / "one.npy", np.array([{"t": 1.0}, {"t": 2.0}]), allow_pickle=True)
    with pytest.raises(InputError, match="can't be read"):
        init(tmp_path / "one.npy", "--out", tmp_path / "set")


def test_map_scale_held_out_and_hold(tmp_path: Path) -> None:
    files = [lab_table(tmp_path, f"{name}.csv", **{"sense x [mV]": None, "Ch 1=A": 50 * WAVE}) for name in ("a", "b")]
    options = ["--map", "v_x=Ch 1=A", "--scale", "v_x=mV", "--scale", "u_x=1e-6", "--held-out", files[0]]
    init(*files, "--out", tmp_path / "set", "--nominal", "reference", "--hold", "first", *options)
    data = load_dataset(tmp_path / "set")
    assert [record.name for record in data.held_out] == ["a.parquet"]
    assert {record.hold for record in data.records} == {"first"}
    # Two roundings of a product.
    assert data.fit[0].v[:, 0] == pytest.approx(0.05 * WAVE, rel=1e-14, abs=1e-30)


def test_semicolons_and_a_sample_rate_in_place_of_time(tmp_path: Path) -> None:
    file = tmp_path / "s.csv"
    pl.DataFrame({"V1": WAVE, "V2": 2 * WAVE}).write_csv(file, separator=";")
    init(file, "--out", tmp_path / "set", "--sample-rate", "1e5")
    with pytest.raises(InputError, match=r"no linear model of the runs"):
        load_dataset(tmp_path / "set")
    device = load_device("reference").parameters
    data = load_dataset(tmp_path / "set", device)
    assert (data.axes, data.fit[0].sample_rate) == (1, 1e5)


@pytest.mark.skipif(not SILVERBOX.is_file(), reason="the measured data ../shared/data is absent")
def test_the_silverbox_as_its_lab_gives_it(tmp_path: Path) -> None:
    device = tmp_path / "box.toml"
    mechanics = "m = 5.44749e-06\nkxx = 0.987802\nkxy = 0.0\ndxx = 0.000250409\nsense_gain_x = 1.0\n"
    device.write_text(f'format = 1\nname = "box"\n[parameters]\n{mechanics}')
    options = ["--sample-rate", "610.35", "--hold", "band-limited", "--out", tmp_path / "set"]
    init(SILVERBOX, *options, "--nominal", device)
    data = load_dataset(tmp_path / "set")
    assert data.axes == 1
    assert sum(len(record.t) for record in data.records) == 131072
    assert data.nominal["kxx"] == 0.987802


def test_existing_files_stay_without_force(tmp_path: Path) -> None:
    file = lab_table(tmp_path)
    init(file, "--out", tmp_path / "set")
    before = (tmp_path / "set" / "dataset.toml").read_text()
    with pytest.raises(InputError, match="--force"):
        init(file, "--out", tmp_path / "set", "--nominal", "reference")
    assert (tmp_path / "set" / "dataset.toml").read_text() == before
    init(file, "--out", tmp_path / "set", "--nominal", "reference", "--force")
    assert "kxx = 63.955" in (tmp_path / "set" / "dataset.toml").read_text()
    assert sorted(path.name for path in (tmp_path / "set").iterdir()) == [
        "dataset.toml",
        "one-fit.parquet",
        "one-held-out.parquet",
    ]


WRONG: dict[str, tuple[dict[str, object], list[str], str]] = {
    "no force": ({"F_x [uN]": None}, [], "--map u_x=HEADING"),
    "no time": ({"Time (ms)": None}, [], "--sample-rate"),
    "half an axis": ({"sense y [mV]": None}, [], "--map v_y=HEADING"),
    "heading": ({}, ["--map", "v_x=sense z [mV]"], "'sense x [mV]'"),
    "column": ({}, ["--map", "vx=remark"], "'v_x'"),
    "text of --map": ({}, ["--map", "v_x"], "COLUMN=VALUE"),
    "scale": ({}, ["--scale", "v_x=degC"], "mV"),
    "unit of a heading": ({"sense x [mV]": None, "sense x [counts]": WAVE}, [], "--scale v_x=NUMBER"),
    "two headings": ({"v_x out": None, "vx": WAVE}, [], "--map v_x=HEADING"),
    "text in a column": ({"F_x [uN]": ["low"] * N}, [], "'low'"),
    "time backwards": ({"Time (ms)": -T}, [], "does not increase"),
    "sample rate": ({}, ["--sample-rate", "-1"], "--sample-rate"),
    "hold": ({}, ["--hold", "zoh"], "band-limited"),
    "held out": ({}, ["--held-out", "none.csv"], "none of the files"),
    "nominal": ({}, ["--nominal", "refrence"], "'reference'"),
}


@pytest.mark.parametrize("case", WRONG)
def test_wrong_input_is_one_line_and_writes_nothing(tmp_path: Path, case: str) -> None:
    changes, options, expected = WRONG[case]
    file = lab_table(tmp_path, **changes)
    with pytest.raises(InputError) as error:
        init(file, "--out", tmp_path / "set", *options)
    assert expected in str(error.value)
    assert "\n" not in str(error.value)
    assert not (tmp_path / "set").exists()


def test_a_missing_file_and_a_wrong_kind(tmp_path: Path) -> None:
    for name, expected in (("none.csv", "does not exist"), ("data.xyz", ".parquet")):
        with pytest.raises(InputError, match=expected):
            init(tmp_path / name, "--out", tmp_path / "set")


def test_a_displacement_is_the_voltage_of_a_sensor_of_one_volt_a_metre(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    moved = {"sense x [mV]": None, "sense y [mV]": None, "v_x [um]": WAVE, "v_y [nm]": 1e3 * WAVE}
    init(lab_table(tmp_path, **moved), "--out", tmp_path / "set", "--nominal", "reference")
    data = load_dataset(tmp_path / "set")
    assert data.nominal == {**load_device("reference").parameters, "sense_gain_x": 1.0, "sense_gain_y": 1.0}
    # A product by a unit's factor rounds twice at most.
    assert data.fit[0].v == pytest.approx(1e-6 * np.stack((WAVE, WAVE), 1)[:800], rel=1e-14, abs=1e-30)
    assert "sense_gain_x = 1" in capsys.readouterr().out


def test_runs_in_volts_and_in_metres_are_no_one_set(tmp_path: Path) -> None:
    moved = {"sense x [mV]": None, "v_x [um]": WAVE}
    files = [lab_table(tmp_path), lab_table(tmp_path, "two.csv", **moved)]
    with pytest.raises(InputError, match="make a data set of each"):
        init(*files, "--out", tmp_path / "set")


def test_a_free_decay_has_no_force_if_one_says_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pl.DataFrame({"t": T, "v_x": WAVE, "monitor": WAVE}).write_csv(tmp_path / "ring.csv")
    with pytest.raises(InputError, match=r"which heading is u_x\? .* --map u_x=none if no force acted"):
        init(tmp_path / "ring.csv", "--out", tmp_path / "set")
    init(tmp_path / "ring.csv", "--out", tmp_path / "set", "--map", "u_x=none", "--nominal", "reference")
    assert "u_x = 0: no force acted" in capsys.readouterr().out
    assert not load_dataset(tmp_path / "set").records[0].u.any()


def test_one_axis_may_be_driven_and_both_sensed(tmp_path: Path) -> None:
    table = lab_table(tmp_path, **{"F_y [uN]": None})
    init(table, "--out", tmp_path / "set", "--map", "u_y=none", "--nominal", "reference")
    [record] = load_dataset(tmp_path / "set").fit
    assert record.u[:, 0].any()
    assert not record.u[:, 1].any()


def test_a_heading_that_only_looks_like_a_column_may_be_left_out(tmp_path: Path) -> None:
    pl.DataFrame({"t": T, "u_x": WAVE, "v_x": WAVE, "omega_z": WAVE}).write_csv(tmp_path / "motor.csv")
    init(tmp_path / "motor.csv", "--out", tmp_path / "set", "--map", "omega_z=none", "--nominal", "reference")
    assert "omega_z" not in load_dataset(tmp_path / "set").records[0].conditions


def test_rounded_times_may_be_left_out(tmp_path: Path) -> None:
    twice = [*T[:9], T[8], *T[10:]]
    pl.DataFrame({"t": twice, "u_x": WAVE, "v_x": WAVE}).write_csv(tmp_path / "motor.csv")
    given = "--out", tmp_path / "set", "--nominal", "reference"
    with pytest.raises(InputError, match=r"--map t=none and --sample-rate HZ"):
        init(tmp_path / "motor.csv", *given)
    init(tmp_path / "motor.csv", *given, "--map", "t=none", "--sample-rate", "1000")
    assert load_dataset(tmp_path / "set").records[0].sample_rate == 1000.0


def test_none_is_a_heading_where_there_is_one(tmp_path: Path) -> None:
    pl.DataFrame({"t": T, "v_x": WAVE, "none": WAVE}).write_csv(tmp_path / "drive.csv")
    init(tmp_path / "drive.csv", "--out", tmp_path / "set", "--map", "u_x=none", "--nominal", "reference")
    assert load_dataset(tmp_path / "set").records[0].u.any()


def test_a_row_written_twice_counts_once(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rows = np.repeat(np.arange(N), np.where(np.isin(np.arange(N), [300, 700]), 2, 1))
    table = {name: np.asarray(values)[rows] for name, values in LAB.items()}
    pl.DataFrame(table).write_csv(tmp_path / "one.csv")
    init(tmp_path / "one.csv", lab_table(tmp_path, "two.csv"), "--out", tmp_path / "set")
    assert "2 rows left out that repeat the row before" in capsys.readouterr().out
    [record] = load_dataset(tmp_path / "set").fit
    assert record.v == pytest.approx(0.1 * np.stack((WAVE, 2 * WAVE), 1), rel=1e-14, abs=1e-30)
