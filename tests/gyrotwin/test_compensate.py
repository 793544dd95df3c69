"""`gyrotwin compensate` as a user types it: a record in, coefficients and a report out, or one line."""

import json
import re
import tomllib
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from benchmarks.compensation_records import profile, quasi_static
from gyro_model.errors import InputError
from gyrotwin.cli import main
from gyrotwin.compensate_record import read_test

WARMUP = Path(__file__).parents[2].parent / "shared" / "data" / "warmup" / "Tempdata01-02-14.csv.gz"
WARMUP_COLUMNS = [
    "--map", "t=Time", "--map", "sensor_structure=dTemp", "--map", "sensor_circuit=Temp", "--scale", "t=ms",
    "--scale", "rate=counts", "--scale", "sensor_structure=0.00294117647,309.68", "--scale", "sensor_circuit=degC",
]  # fmt: skip
"""Die temperature: T = dTemp/340 + 36.53 °C, in K."""


def compensate(*arguments: object) -> None:
    with pytest.raises(SystemExit) as end:
        main(["compensate", *map(str, arguments)])
    assert end.value.code in (0, None)


def refused(capsys: pytest.CaptureFixture[str], folder: Path, *arguments: object) -> str:
    """The one line on stderr; nothing written."""
    with pytest.raises(SystemExit) as end:
        main(["compensate", *map(str, arguments), "--out", str(folder / "out")])
    assert end.value.code == 2
    lines = capsys.readouterr().err.strip().splitlines()
    assert len(lines) == 1
    assert not (folder / "out").exists()
    return lines[0]


@pytest.fixture(scope="module")
def records(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("records")
    cycle = profile(-10, (-10, 1, 5), (50, 2, 10), (-10, 2, 5))
    quasi_static(cycle, 1).write_parquet(folder / "cycle.parquet")
    quasi_static(cycle, 2).write_parquet(folder / "again.parquet")
    quasi_static(profile(-10, (-10, 1, 5), (60, 2, 5)), 3).write_parquet(folder / "hotter.parquet")
    return folder


def test_files_and_numbers(records: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    compensate(records / "cycle.parquet", "--test", records / "again.parquet", "--method", "spline", "--out", out)
    assert {path.name for path in out.iterdir()} == {
        "compensation.toml", "compensation.h", "summary.json", "report.html"
    }  # fmt: skip
    summary = json.loads((out / "summary.json").read_text())
    left = summary["methods"]["spline"]["held_out"]
    # Noise alone would leave "possible"; a range scatters by about a fifth.
    assert left["bias_per_c"]["factor"] > 0.6 * left["bias_per_c"]["noise_allows"]
    assert left["scale_factor_ppm_per_c"]["factor"] > 0.6 * left["scale_factor_ppm_per_c"]["noise_allows"]
    assert left["residual_rms"] == pytest.approx(left["block_noise"], rel=0.15)
    shown = capsys.readouterr().out
    assert "Bias [°/h/°C]" in shown
    assert shown.index("inner validation ...") < shown.index("Bias [°/h/°C]")
    assert tomllib.loads((out / "compensation.toml").read_text())["sampling_time"] == 10.0
    page = (out / "report.html").read_text()
    assert "Bias and scale factor over temperature" in page
    assert "http://" not in page.partition("<script>")[0]


def test_a_coarse_rate_is_told_and_has_a_page(
    records: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    coarse = pl.read_parquet(records / "cycle.parquet").with_columns((pl.col("rate") / 0.01).round() * 0.01)
    coarse.write_parquet(tmp_path / "coarse.parquet")
    out = tmp_path / "out"
    compensate(tmp_path / "coarse.parquet", "--method", "piecewise", "--segments", "2", "--out", out)
    [told] = json.loads((out / "summary.json").read_text())["warnings"]
    assert "rounded in steps of 0.01 rad/s" in told
    assert "rounded in steps" in capsys.readouterr().out
    # The noise of blocks whose rows were all alike was 0, and the page divided by it.
    assert "rounded in steps" in (out / "report.html").read_text()


def test_a_compensation_that_makes_it_worse_is_told(records: Path, tmp_path: Path) -> None:
    # Fitted on one course of the bias over temperature, tested on its mirror image.
    again = pl.read_parquet(records / "again.parquet")
    again.with_columns(rate=2 * pl.col("rate_true") - pl.col("rate")).write_parquet(tmp_path / "mirrored.parquet")
    out = tmp_path / "out"
    compensate(
        records / "cycle.parquet", "--test", tmp_path / "mirrored.parquet", "--method", "piecewise", "--out", out
    )
    [told] = json.loads((out / "summary.json").read_text())["warnings"]
    assert re.search(
        r"the bias over temperature is (1\.9|2|2\.0)\d* times as much with the compensation: don.t use it", told
    )


def test_of_one_cycle_the_report_says_first_that_another_is_untested(
    records: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    compensate(records / "cycle.parquet", "--method", "piecewise", "--out", tmp_path / "out")
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert summary["test"] is None
    assert summary["hold_out"].startswith("Another cycle is untested")
    assert summary["another_cycle_tested"] is False
    assert "missing" in summary["floors"]["history_of_inputs"]
    assert capsys.readouterr().out.removeprefix("inner validation ...").strip().startswith("Another cycle is untested")
    found = summary["methods"]["piecewise, structure"]
    total = found["fitted"]["blocks"] + found["held_out"]["blocks"]
    # A quarter, less what the others do not cover; gaps are in neither.
    assert 0.1 * total < found["held_out"]["blocks"] <= 0.3 * total
    # Ten degrees a segment; measured 20.8.
    assert found["held_out"]["bias_per_c"]["factor"] > 10


def test_whole_cycles_are_held_out_and_the_floors_are_told(
    records: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    compensate(records / "cycle.parquet", records / "again.parquet", "--method", "spline", "--out", tmp_path / "out")
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert summary["another_cycle_tested"] is True
    assert "tested on the last" in summary["hold_out"]
    found = summary["methods"]["spline"]["held_out"]["bias_rms"]
    for floor in summary["floors"].values():
        assert floor["cycles"] == 2
        low, high = floor["bias_rms_interval"]
        # This device has no walk and no turn-on: the floors are the white noise of a block, that of the other cycle in
        # the prediction included (up to √2), and what a local plane leaves of the curve.
        assert found["noise"] < floor["bias_rms"] < 2 * found["noise"]
        assert low < floor["bias_rms"] < high
    scores = [one["score"] for one in summary["inner_validation"]]
    assert scores == sorted(scores)
    assert "inner validation on the fitting cycles alone" in capsys.readouterr().out


def test_beyond_the_fitted_range(records: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    both = (records / "cycle.parquet", "--test", records / "hotter.parquet", "--method", "piecewise", "--segments", 6)
    line = refused(capsys, tmp_path, *both)
    assert "structure reaches from" in line
    assert "--outside clamp" in line
    compensate(*both, "--outside", "clamp", "--out", tmp_path / "out")
    assert "beyond the fitted range and are clamped" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (("--method", "piecwise"), "did you mean 'piecewise'"),
        (("--sensor", "boad"), "--sensor boad: give structure or circuit"),
        (("--outside", "clmp"), "did you mean 'clamp'"),
        (("--method", "piecewise", "--segments", 0), "--segments 0: give 1 or more"),
        (("--method", "piecewise", "--segments", 5000), "give fewer --segments"),
        (("--segments", 1000000), "--segments 1000000"),
        (("--method", "network", "--hidden", 200), "--hidden with fewer neurons"),
        (("--sampling-time", 0), "sampling time 0 s"),
        (("--sampling-time", 100), "give a --sampling-time of that or less"),
        (("--map", "rate=Gx"), "no such heading"),
        (("--map", "rat=Gx"), "did you mean 'rate'"),
        (("--scale", "rate=furlongs"), "give rad/s, deg/s, counts, or FACTOR,OFFSET"),
        (("--map", "rate"), "give COLUMN=VALUE"),
    ],
)
def test_wrong_input_is_one_line(
    records: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], arguments: tuple[object, ...], text: str
) -> None:
    assert text in refused(capsys, tmp_path, records / "cycle.parquet", *arguments)


def test_units_stand_in_the_headings(records: Path, tmp_path: Path) -> None:
    table = pl.read_parquet(records / "cycle.parquet").head(200)
    own = table.select(
        (1e3 * pl.col("t")).alias("t [ms]"), pl.col("rate").degrees().alias("rate (deg/s)"), "rate_true",
        (pl.col("sensor_structure") - 273.15).alias("sensor_structure [°C]"), (pl.col("sensor_circuit") - 273.15)
        .alias("board_degC"),
    )  # fmt: skip
    own.write_csv(tmp_path / "lab.csv", separator=";", decimal_comma=True)
    table.write_parquet(tmp_path / "si.parquet")
    found = read_test(tmp_path / "lab.csv", ("sensor_circuit=board_degC",))
    wanted = read_test(tmp_path / "si.parquet")
    for one, other in ((found.t, wanted.t), (found.rate, wanted.rate), *zip(found.signals.values(),
                       [wanted.signals[name] for name in found.signals], strict=True)):  # fmt: skip
        np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-9)
    with pytest.raises(InputError, match=r"--scale t=s: the heading 't \[ms\]' says ms: leave --scale out"):
        read_test(tmp_path / "lab.csv", ("sensor_circuit=board_degC",), ("t=s",))


def test_missing_columns_are_named(records: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    table = pl.read_parquet(records / "cycle.parquet")
    table.drop("rate").write_parquet(tmp_path / "a.parquet")
    assert "no column rate" in refused(capsys, tmp_path, tmp_path / "a.parquet")
    table.drop("drive_frequency").write_parquet(tmp_path / "b.parquet")
    assert "holds no frequency" in refused(capsys, tmp_path, tmp_path / "b.parquet", "--method", "network")
    table.select("t", "rate", "rate_true").write_parquet(tmp_path / "c.parquet")
    assert "neither a temperature nor a drive frequency" in refused(capsys, tmp_path, tmp_path / "c.parquet")
    assert "does not exist" in refused(capsys, tmp_path, tmp_path / "none.parquet")


@pytest.mark.skipif(not WARMUP.is_file(), reason="measured data (shared/data/warmup) is not here")
@pytest.mark.parametrize("axis", ["Gx", "Gy", "Gz"])
def test_a_measured_warm_up(axis: str, tmp_path: Path) -> None:
    compensate(WARMUP, *WARMUP_COLUMNS, "--map", f"rate={axis}", "--method", "piecewise", "--out", tmp_path / "out")
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert summary["unit"] == "counts"
    found = summary["methods"]["piecewise, structure"]["held_out"]
    # White noise of 300 samples, 0.05 to 0.07 counts; blocks at one temperature differ by 1.4 to 1.8
    # of that at other times (benchmarks/compensation.py).
    assert 0.03 < found["block_noise"] < 0.08
    # Contiguous parts of the only cycle are held out; where they reach beyond the rest they are clamped: 2.03 on Gx.
    assert found["residual_rms"] < 2.5 * found["block_noise"]
    assert np.isfinite(found["bias_per_c"]["factor"])


def test_a_short_record_still_tells_a_scale_factor(tmp_path: Path) -> None:
    quasi_static(profile(10, (20, 2, 4)), 1).write_parquet(tmp_path / "short.parquet")
    compensate(tmp_path / "short.parquet", "--method", "spline", "--out", tmp_path / "out")
    found = json.loads((tmp_path / "out" / "summary.json").read_text())["methods"]["spline"]["held_out"]
    # Stretches of one block would all fall on the same phase of the rate step.
    assert found["scale_factor_ppm_per_c"] is not None
    assert found["bias_per_c"]["factor"] > 20


def test_celsius_in_a_column_of_kelvin_is_asked_about(
    records: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    table = pl.read_parquet(records / "cycle.parquet")
    table.with_columns(pl.col("sensor_structure") - 273.15).write_parquet(tmp_path / "celsius.parquet")
    line = refused(capsys, tmp_path, tmp_path / "celsius.parquet", "--method", "spline")
    assert "--scale sensor_structure=degC" in line
    named = ("--scale", "sensor_circuit=degC")
    assert "--scale sensor_circuit=K" in refused(capsys, tmp_path, records / "cycle.parquet", *named)
