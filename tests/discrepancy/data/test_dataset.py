"""Data sets on disk: what is read, and every fault as one line that names it."""

import gzip
from collections.abc import Callable
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from discrepancy.data.dataset import Dataset, load_dataset
from discrepancy.data.record import MINIMUM_SAMPLES, make_record
from gyro_model.errors import InputError

EXAMPLES = Path(__file__).parents[4] / "shared" / "examples"
needs_examples = pytest.mark.skipif(not EXAMPLES.is_dir(), reason="the example data sets ../shared/examples are absent")

N, RATE = 200, 1e5
NOMINAL = """
m = 1.8e-7
kxx = 63.955
kyy = 95.92
kxy = 12.779
dxx = 1.8e-6
dyy = 1.8e-6
dxy = 3.6e-7
sense_gain_x = 1e6
sense_gain_y = 1e6
"""
ONE_AXIS = "m = 1.8e-7\nkxx = 63.955\ndxx = 1.8e-6\nsense_gain_x = 1e6\n"


def table(*leave: str, **columns: object) -> pl.DataFrame:
    t = np.arange(N) / RATE
    wave = np.sin(2 * np.pi * 3000 * t)
    frame = {"t": t, "u_x": 1e-6 * wave, "u_y": 2e-6 * wave, "v_x": 0.1 * wave, "v_y": 0.2 * wave, **columns}
    return pl.DataFrame({name: values for name, values in frame.items() if name not in leave})


def run(file: str, extra: str = "") -> str:
    return f'[[run]]\nfile = "{file}"\nsample_rate = {RATE}\n{extra}\n'


TWO_RUNS = run("a.csv") + run("b.csv", 'role = "held-out"')


def write(
    folder: Path, *, runs: str = TWO_RUNS, nominal: str = NOMINAL, head: str = "format = 1", **tables: object
) -> Path:
    (folder / "dataset.toml").write_text(f"{head}\n[nominal]\n{nominal}\n{runs}")
    frames = {"a": table(), "b": table(), **tables}
    for name, frame in frames.items():
        if isinstance(frame, pl.DataFrame):
            frame.write_csv(folder / f"{name}.csv")
    return folder


def test_reads_what_was_written(tmp_path: Path) -> None:
    data = load_dataset(write(tmp_path, a=table(omega_z=np.full(N, 3.0))))
    [first] = data.fit
    expected = table()
    assert (data.folder, data.axes, data.notes) == (tmp_path, 2, ())
    assert (first.name, first.role, first.hold, first.sample_rate) == ("a.csv", "fit", "zero", RATE)
    # polars writes the shortest text that reads back to the same float.
    assert np.array_equal(first.u, expected[["u_x", "u_y"]].to_numpy())
    assert np.array_equal(first.v, expected[["v_x", "v_y"]].to_numpy())
    assert set(first.conditions) == {"omega_z"}
    assert first.valid.all()
    assert [record.name for record in data.held_out] == ["b.csv"]
    assert data.nominal["kyy"] == 95.92


def test_the_toml_itself_may_be_named(tmp_path: Path) -> None:
    assert load_dataset(write(tmp_path) / "dataset.toml").folder == tmp_path


@pytest.mark.parametrize("suffix", [".csv", ".csv.gz", ".parquet"])
def test_every_kind_of_table(tmp_path: Path, suffix: str) -> None:
    write(tmp_path, runs=run(f"c{suffix}") + run("b.csv", 'role = "held-out"'), c=table())
    (tmp_path / "c.csv.gz").write_bytes(gzip.compress((tmp_path / "c.csv").read_bytes()))
    table().write_parquet(tmp_path / "c.parquet")
    assert np.array_equal(load_dataset(tmp_path).fit[0].v, table()[["v_x", "v_y"]].to_numpy())


def test_one_axis_drops_y_and_its_parameters(tmp_path: Path) -> None:
    one = table("u_y", "v_y")
    data = load_dataset(write(tmp_path, a=one, b=one))
    assert data.axes == 1
    assert set(data.nominal) == {"m", "kxx", "dxx", "sense_gain_x"}


def test_the_last_run_is_held_out_and_said_so(tmp_path: Path) -> None:
    data = load_dataset(write(tmp_path, runs=run("a.csv") + run("b.csv")))
    assert [record.role for record in data.records] == ["fit", "held-out"]
    assert any("b.csv" in note and "held out" in note for note in data.notes)


def test_a_device_stands_in_for_nominal(tmp_path: Path) -> None:
    folder = write(tmp_path, nominal="kxx = 60.0")
    device = load_dataset(write(tmp_path)).nominal
    write(tmp_path, nominal="kxx = 60.0")
    data = load_dataset(folder, device)
    assert (data.nominal["kxx"], data.nominal["kyy"]) == (60.0, 95.92)


def test_aligned_axes_are_assumed_aloud(tmp_path: Path) -> None:
    data = load_dataset(write(tmp_path, nominal=NOMINAL.replace("kxy = 12.779", "")))
    assert data.nominal["kxy"] == 0.0
    assert any("kxy" in note for note in data.notes)


def test_other_columns_are_left_aside_aloud(tmp_path: Path) -> None:
    assert any("operator" in note for note in load_dataset(write(tmp_path, a=table(operator=["me"] * N))).notes)


def test_time_printed_with_few_digits_passes(tmp_path: Path) -> None:
    # The measured example prints 1.638 ms steps to a microsecond: single steps are 3e-4 off, the mean is not.
    rate = 610.35
    t = np.round(np.arange(N) / rate, 6)
    runs = TWO_RUNS.replace(str(RATE), str(rate))
    assert load_dataset(write(tmp_path, runs=runs, a=table(t=t), b=table(t=t))).fit[0].sample_rate == rate


T = np.arange(N) / RATE
FAULTS: dict[str, tuple[dict[str, object], str]] = {
    "format": ({"head": "format = 2"}, "format = 2"),
    "no format": ({"head": ""}, "format = None"),
    "key at the top": ({"head": "format = 1\nnominl = 2"}, "'nominal'"),
    "not TOML": ({"head": "format ="}, "TOML"),
    "nominal name": ({"nominal": NOMINAL + "kx = 1.0"}, "'kx'"),
    "nominal text": ({"nominal": NOMINAL.replace("63.955", '"stiff"')}, "kxx = 'stiff'"),
    "nominal missing": ({"nominal": NOMINAL.replace("m = 1.8e-7", "")}, "lacks m [kg]"),
    "nominal not passive": ({"nominal": NOMINAL.replace("12.779", "200.0")}, "positive definite"),
    "gain zero": ({"nominal": NOMINAL.replace("sense_gain_x = 1e6", "sense_gain_x = 0.0")}, "sense_gain_x = 0"),
    "no run": ({"runs": ""}, "no run"),
    "no run to fit": ({"runs": run("b.csv", 'role = "held-out"')}, "no run to fit"),
    "a single run": ({"runs": run("a.csv")}, "no run to fit"),
    "single brackets": ({"runs": TWO_RUNS.replace("[[run]]", "[run]", 1).split("[[")[0]}, "[[run]]"),
    "key of a run": ({"runs": run("a.csv", 'rolle = "fit"')}, "'role'"),
    "role": ({"runs": run("a.csv", 'role = "heldout"')}, "'held-out'"),
    "hold": ({"runs": run("a.csv", 'hold = "bandlimited"')}, "'band-limited'"),
    "listed twice": ({"runs": run("a.csv") + run("a.csv", 'role = "held-out"')}, "twice"),
    "no file": ({"runs": run("c.csv") + run("b.csv")}, "does not exist"),
    "kind of file": ({"runs": run("a.xlsx") + run("b.csv")}, ".parquet"),
    "file outside": ({"runs": '[[run]]\nfile = "../a.csv"\nsample_rate = 1.0'}, "outside the data set"),
    "no sample rate": ({"runs": '[[run]]\nfile = "a.csv"'}, "sample_rate"),
    "sample rate": ({"runs": TWO_RUNS.replace(str(RATE), "50000.0")}, "t steps at 100000 Hz"),
    "time in ms": ({"a": table(t=1e3 * T)}, "ms"),
    "column missing": ({"a": table("v_y")}, "v_y is missing"),
    "column nearly right": ({"a": table(omegaz=T)}, "'omega_z'"),
    "empty cell": ({"a": table(u_x=[None, *T[1:]])}, "u_x"),
    "empty cells": ({"a": table(v_x=[*T[: N // 2], *[None] * (N - N // 2)])}, "v_x"),
    "NaN": ({"a": table(u_y=[*T[:5], float("nan"), *T[6:]])}, "data row 6"),
    "infinite": ({"a": table(u_y=[*T[:5], float("inf"), *T[6:]])}, "data row 6"),
    "text": ({"a": table(v_x=["n/a", *map(str, T[1:])])}, "'n/a'"),
    "time stands still": ({"a": table(t=[0.0, *T[:-1]])}, "does not increase in data row 2"),
    "too short": ({"a": table().head(MINIMUM_SAMPLES - 1)}, "99 samples"),
    "no rows": ({"a": table().head(0)}, "no rows"),
    "all zero": ({"a": table(u_x=0 * T, u_y=0 * T, v_x=0 * T, v_y=0 * T)}, "zero throughout"),
    "mixed axes": ({"b": table("u_y", "v_y")}, "axes"),
}


@pytest.mark.parametrize("case", FAULTS)
def test_a_fault_is_one_line(tmp_path: Path, case: str) -> None:
    changes, expected = FAULTS[case]
    write(tmp_path, **changes)  # type: ignore[arg-type]
    with pytest.raises(InputError) as error:
        load_dataset(tmp_path)
    assert expected in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    "damage",
    [lambda b: b"", lambda b: b[: len(b) // 2], lambda b: b"\x00\xff" * 50],
    ids=["empty", "cut off", "not gzip"],
)
def test_a_damaged_table_is_one_line(tmp_path: Path, damage: Callable[[bytes], bytes]) -> None:
    write(tmp_path, runs=run("c.csv.gz") + run("b.csv", 'role = "held-out"'), c=table())
    (tmp_path / "c.csv.gz").write_bytes(damage(gzip.compress((tmp_path / "c.csv").read_bytes())))
    with pytest.raises(InputError) as error:
        load_dataset(tmp_path)
    assert "c.csv.gz" in str(error.value)
    assert "\n" not in str(error.value)


def test_no_data_set(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no dataset"):
        load_dataset(tmp_path / "none")


def test_arrays_without_files() -> None:
    frame = table()
    records = [
        make_record(name, T, frame[["u_x"]], frame["v_x"], role=role)
        for name, role in (("a", "fit"), ("b", "held-out"))
    ]
    data = Dataset(Path(), {"m": 1e-7, "kxx": 60.0, "dxx": 1e-6, "sense_gain_x": 1e6}, tuple(records))
    assert data.fit[0].sample_rate == pytest.approx(RATE, rel=1e-12)  # a mean of 199 differences of rounded times


@needs_examples
@pytest.mark.parametrize(
    ("name", "runs", "held_out", "axes"),
    [("null", 4, 1, 2), ("duffing", 4, 1, 2), ("two", 4, 1, 2), ("silverbox", 3, 2, 1)],
)
def test_examples(name: str, runs: int, held_out: int, axes: int) -> None:
    data = load_dataset(EXAMPLES / name)
    assert (len(data.records), len(data.held_out), data.axes) == (runs, held_out, axes)
    assert all(record.valid.all() for record in data.records)
