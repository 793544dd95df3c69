"""`gyrotwin rate` as a user types it: files, columns, wrong input as one line with exit code 2."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from cosim.rate import kept, master
from cosim.rate.run import RateRun
from gyro_model.errors import InputError
from gyrotwin.cli import main

COLUMNS = [
    *("t", "rate", "rate_true", "quadrature", "drive_frequency", "drive_amplitude", "drive_force"),
    *("temperature", "temperature_structure", "temperature_circuit", "sensor_structure", "sensor_circuit"),
]


def gyrotwin(capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, str]:
    """Exit code and standard error."""
    try:
        main(["rate", *arguments])
        code: object = 0
    except SystemExit as stop:
        code = stop.code
    return int(str(code or 0)), capsys.readouterr().err


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("rate") / "out"
    arguments = ("--plant", "envelope", "--rate-step", "100", "--rate-period", "8", "--temperature", "20,30,10")
    with pytest.raises(SystemExit) as ended:
        main(["rate", *arguments, "--out", str(out), "--seed", "4"])
    assert not ended.value.code
    return out


def test_three_files_and_nothing_else(folder: Path) -> None:
    assert sorted(path.name for path in folder.iterdir()) == ["report.html", "summary.json", "trace.parquet"]


def test_record_has_its_columns_and_its_rate(folder: Path) -> None:
    record = pl.read_parquet(folder / "trace.parquet")
    assert record.columns == COLUMNS
    assert len(record) == 600
    np.testing.assert_allclose(np.diff(record["t"].to_numpy()), 0.1, rtol=1e-9)
    assert set(np.rad2deg(record["rate_true"].unique().to_numpy()).round(9)) == {-100.0, 0.0, 100.0}
    assert record.null_count().row(0) == (0,) * len(COLUMNS)


def test_summary_says_what_the_run_was(folder: Path) -> None:
    summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    assert (summary["device"], summary["sense"], summary["plant"], summary["seed"]) == (
        "rate-mode",
        "open",
        "envelope",
        4,
    )
    # Scale factor between those at 20 °C and 30 °C, 0.9984 and 1.0024.
    assert 0.998 < summary["scale_factor"] < 1.003
    assert summary["temperature_deg_c"]["ambient"]["max"] == pytest.approx(30.0, abs=0.02)
    assert summary["allan"] is None


def test_page_stands_alone(folder: Path) -> None:
    page = (folder / "report.html").read_text(encoding="utf-8")
    for section in ("rate", "over-temperature", "drive", "temperature"):
        assert f'<figure id="{section}">' in page
    assert "http://" not in page.split("<script>")[0] and "https://" not in page.split("<script>")[0]


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("--sense", "closd"), "--sense closd: use open or closed; did you mean 'closed'?"),
        (("--plant", "slow"), "--plant slow: use full or envelope"),
        (("--device", "rate_mode"), "did you mean 'rate-mode'?"),
        (("--rate-step", "400"), "beyond the full scale of 300 deg/s"),
        (("--rate-step", "0"), "give a rate above 0"),
        (("--rate-step", "10", "--rate-profile", "x.csv"), "give one of them"),
        (("--rate-profile", "x.csv"), "needs --rate-column"),
        (("--rate-profile", "x.csv", "--rate-column", "z"), "x.csv does not exist"),
        (("--temperature", "20,30"), "give one temperature, START,STOP,RAMP"),
        (("--temperature", "20,30,0"), "RAMP > 0"),
        (("--temperature", "20,80,6000", "--output-rate", "1"), "within one row of the record"),
        (("--temperature", "none.csv"), "none.csv: no such file"),
        (("--temperature", "-300"), "-300 °C"),
        (("--duration", "nan"), "duration nan s"),
        (("--set", "rate_mode.phase_bandwith=3"), "did you mean 'phase_bandwidth'?"),
        (("--set", "rate_mode.phase_bandwidth=-3"), "give a positive number in Hz"),
        (("--set", "tcp=x"), "give name=value with a number"),
        (("--set", "rate_mode.demodulator_bandwidth=2000"), "less than a quarter of the drive frequency"),
        (("--seed", "-1"), "seed = -1"),
        (("--design", "rate_mode"), "did you mean 'rate-mode'?"),
    ],
)
def test_wrong_input_is_one_line_and_exit_code_2(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, arguments: tuple[str, ...], says: str
) -> None:
    out = tmp_path / "out"
    code, error = gyrotwin(capsys, *arguments, "--out", str(out))
    assert code == 2
    assert says in error
    assert error.count("\n") == 1
    assert not out.exists()


def test_a_lost_lock_writes_nothing(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    out = tmp_path / "out"
    lazy = ("--set", "rate_mode.phase_bandwidth=0.3", "--set", "structure_lag=0", "--temperature", "20,80,540")
    code, error = gyrotwin(capsys, *lazy, "--plant", "envelope", "--out", str(out))
    assert code == 2
    assert "lost its lock at t = " in error
    assert not out.exists()


def test_a_profile_beyond_the_bandwidth_is_said_and_gives_no_scale_factor(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    t = np.arange(0, 6, 1e-3)
    swept = 20 * np.sin(2 * np.pi * (2 * t + 0.5 * (167 - 2) / 6 * t**2))
    pl.DataFrame({"t": t, "omega_z": swept}).write_csv(tmp_path / "swept.csv")
    profile = ("--rate-profile", tmp_path / "swept.csv", "--rate-column", "omega_z", "--rate-unit", "deg/s")
    with pytest.raises(SystemExit) as end:
        main(["rate", "--plant", "envelope", *map(str, profile), "--out", str(tmp_path / "out")])
    assert end.value.code in (0, None)
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert summary["scale_factor"] is None
    assert "beyond the output's 40 Hz" in summary["warnings"][0]
    assert "warning:" in capsys.readouterr().out


def test_loops_and_calibration_know_what_the_design_says(tmp_path: Path) -> None:
    design = tmp_path / "nominal.toml"
    values = {"m": 2e-8, "kxx": 19.74, "kyy": 20.14, "dxx": 1.257e-7, "dyy": 1.058e-6}
    design.write_text(
        "\n".join(['format = 1\nname = "nominal"\n[parameters]', *(f"{n} = {v}" for n, v in values.items())])
    )
    steps = ("--plant", "envelope", "--rate-step", "100", "--rate-period", "12")
    with pytest.raises(SystemExit) as end:
        main(["rate", *steps, "--design", str(design), "--out", str(tmp_path / "out")])
    assert end.value.code in (0, None)
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert summary["design"] == "nominal"
    # A package mode that the design does not know pulls the drive by 0.3 Hz of a split of 50 Hz.
    assert summary["scale_factor"] == pytest.approx(0.994, abs=0.002)


INTERRUPTED = """
import os, signal, sys
from cosim.rate import kept
from gyrotwin.cli import main
write, kept.EVERY, kept.SHARE = kept.Keeper._write, 0.05, 1.0
def and_stop(self, arrays):
    write(self, arrays)
    if len(arrays["rows"]) > 100:
        os.kill(os.getpid(), signal.SIGINT)
kept.Keeper._write = and_stop
main(sys.argv[1:])
"""
"""A program that types Ctrl-C once some hundred rows are kept."""


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no SIGINT for one process")
def test_an_interrupted_run_goes_on_to_the_same_files(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    asked = ("--temperature", "20,40,4", "--rate-step", "50", "--sense-record", "250", "--seed", "5")
    out = tmp_path / "out"
    command = [sys.executable, "-c", INTERRUPTED, "rate", *asked, "--out", str(out)]
    stopped = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    assert stopped.returncode == 130, stopped.stderr
    [line] = stopped.stderr.strip().splitlines()
    assert f"{out / 'rate.checkpoint'} keeps " in line
    assert line.endswith(" of 300 s: the same command goes on from there")
    assert [path.name for path in out.iterdir()] == ["rate.checkpoint"]
    assert gyrotwin(capsys, *asked, "--out", str(out)) == (0, "")
    assert gyrotwin(capsys, *asked, "--out", str(tmp_path / "whole")) == (0, "")
    names = sorted(path.name for path in (tmp_path / "whole").iterdir())
    assert sorted(path.name for path in out.iterdir()) == names
    assert {name for name in names if (out / name).read_bytes() != (tmp_path / "whole" / name).read_bytes()} == set()


def test_what_another_run_left_is_told_and_removed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "rate.checkpoint").write_text("something else")
    with pytest.raises(SystemExit) as ended:
        main(["rate", "--plant", "envelope", "--duration", "5", "--out", str(tmp_path)])
    assert not ended.value.code
    assert "rate.checkpoint: can't be read; the run starts anew" in " ".join(capsys.readouterr().out.split())
    assert not (tmp_path / "rate.checkpoint").exists()


def test_a_run_that_fails_leaves_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    kept_at_failure: list[bool] = []
    out = tmp_path / "out"

    def lost(run: RateRun, block: np.ndarray, first: int) -> None:
        if first >= 30:
            kept_at_failure.append((out / "rate.checkpoint").is_file())
            raise InputError("drive loop lost its lock")

    monkeypatch.setattr(kept, "EVERY", 0.0)
    monkeypatch.setattr(master, "check_lock", lost)
    code, said = gyrotwin(capsys, "--plant", "envelope", "--duration", "20", "--out", str(out))
    assert (code, kept_at_failure) == (2, [True])
    assert "lost its lock" in said
    assert not out.exists()
