"""A record that `gyrotwin rate` writes, read by `gyrotwin split`: at rest, under hand motion, through a ramp."""

import json
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from cosim.rate.steady_state import parameters_at
from gyro_model.device import load_device
from gyrotwin.cli import main

MOTION = Path(__file__).parents[2] / "cosim" / "profiles" / "hand_motion.csv"
RAMP = ("--temperature", "0,60,12", "--set", "structure_lag=0", "--set", "circuit_lag=0", "--sense-record", "250")
SPLIT = 50.698
"""Of rate-mode at 25 °C by its eigenvalues [Hz]: benchmarks/rate_mode.py, beat of the open loop."""


def gyrotwin(*arguments: object) -> None:
    with pytest.raises(SystemExit) as ended:
        main([*map(str, arguments)])
    assert not ended.value.code


def refused(capsys: pytest.CaptureFixture[str], out: Path, *arguments: object) -> str:
    """The one line on stderr; nothing written."""
    with pytest.raises(SystemExit) as ended:
        main([*map(str, arguments), "--out", str(out)])
    lines = capsys.readouterr().err.strip().splitlines()
    assert ended.value.code == 2
    assert len(lines) == 1
    assert not out.exists()
    return lines[0]


@pytest.fixture(scope="module")
def moved(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("moved") / "rate"
    motion = ("--rate-profile", MOTION, "--rate-column", "omega_z", "--rate-unit", "deg/s")
    gyrotwin("rate", "--plant", "envelope", *motion, "--sense-record", 1000, "--out", out)
    return out


@pytest.fixture(scope="module")
def ramp(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("ramp") / "rate"
    gyrotwin("rate", *RAMP, "--out", out)
    return out


def summary(folder: Path) -> dict:
    return json.loads((folder / "summary.json").read_text(encoding="utf-8"))


def test_record_has_its_columns(moved: Path) -> None:
    assert sorted(path.name for path in moved.iterdir()) == [
        "report.html", "sense.parquet", "summary.json", "trace.parquet",
    ]  # fmt: skip
    record = pl.read_parquet(moved / "sense.parquet")
    assert record.columns == ["t", "v_y_i", "v_y_q", "carrier_frequency"]
    assert record.null_count().row(0) == (0,) * 4
    # The loop's own rate: no filter, so no sample is lost.
    assert len(record) == 6000


def test_split_is_found_under_hand_motion(moved: Path, tmp_path: Path) -> None:
    gyrotwin("split", moved / "sense.parquet", "--guard", 15, "--out", tmp_path / "out")
    found = summary(tmp_path / "out")
    assert abs(found["split"]["value"] - SPLIT) < 4 * found["deviation"]
    assert found["split"]["low"] < SPLIT < found["split"]["high"]
    # 5.7 s are 150 Q/(πf): the bound is 0.34 Hz; a fifth more for floor, Q and taper.
    assert found["deviation"] < 0.42


def test_motion_without_a_guard_is_refused_with_the_remedy(
    moved: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    said = refused(capsys, tmp_path / "out", "split", moved / "sense.parquet")
    assert "wanders" in said
    assert "--guard" in said


def test_track_follows_a_temperature_ramp(ramp: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    gyrotwin("split", ramp / "sense.parquet", "--track", 10, "--q", 600, "--out", out)
    assert sorted(path.name for path in out.iterdir()) == ["report.html", "summary.json", "track.csv"]
    track, trace = pl.read_csv(out / "track.csv"), pl.read_parquet(ramp / "trace.parquet")
    device = load_device("rate-mode")
    truth = []
    for t in track["t"]:
        near = trace.filter((trace["t"] - t).abs() < 5)
        p = parameters_at(device, float(near["temperature_structure"].mean()))  # type: ignore[arg-type]
        # Quadrature pushes the modes apart: Ω_q²/(4π² Δf) = 0.014 Hz.
        truth.append(np.sqrt(p["kyy"] / p["m"]) / (2 * np.pi) + 0.014 - float(near["drive_frequency"].mean()))  # type: ignore[arg-type]
    error = (track["split"].to_numpy() - truth) / ((track["high"] - track["low"]).to_numpy() / (2 * 1.96))
    # 29 steps that share blocks: some five independent ones, at 4 deviations each 3e-4.
    assert np.abs(error).max() < 4
    # Q is given as at 25 °C; it moves by 15 % over the ramp, which moves no peak.
    assert np.ptp(truth) > 0.7
    found = summary(out)
    assert found["blocks_without_a_hump"] == 0
    assert found["first"]["low"] < truth[0] < found["first"]["high"]
    page = (out / "report.html").read_text(encoding="utf-8")
    assert '<figure id="track">' in page


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--track", 0), "--track 0: give the length of a block"),
        (("--track", "nan"), "--track nan"),
        (("--track", 200), "at least 3 of them; record 600 s or more"),
        (("--track", 0.5, "--q", 600), "a block of the track is 0.5 s long: too short"),
        (("--track", 10, "--resolution", 0.1), "--resolution with --track"),
    ],
)
def test_a_bad_track_is_one_line(
    ramp: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], options: tuple[object, ...], message: str
) -> None:
    assert message in refused(capsys, tmp_path / "out", "split", ramp / "sense.parquet", *options)


def test_a_record_too_short_for_the_line_is_refused_before_it_is_made(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    options = ("--plant", "envelope", "--duration", 0.5, "--sense-record", 1000)
    assert "record at least 0.96 s" in refused(capsys, tmp_path / "out", "rate", *options)


def test_a_carrier_that_is_no_number_is_refused(
    moved: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    record = pl.read_parquet(moved / "sense.parquet")
    carriers = record["carrier_frequency"].to_list()
    carriers[4] = None
    record.with_columns(carrier_frequency=pl.Series(carriers)).write_parquet(tmp_path / "broken.parquet")
    said = refused(capsys, tmp_path / "out", "split", tmp_path / "broken.parquet")
    assert "carrier_frequency is no positive number in data row 5" in said
