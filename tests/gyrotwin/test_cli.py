"""The command as a user types it: files and tables, wrong input as one line with exit code 2, Ctrl-C without traces."""

import json
import math
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from gyro_model.model import EFFECTS_FOLDER
from gyrotwin.cli import main

COMMAND = [sys.executable, "-m", "gyrotwin"]

TRACE_COLUMNS = [
    *("t", "omega_true", "angle_true", "angle", "angle_quality", "converged", "v_x", "v_y", "u_x", "u_y"),
    *("est_kxx", "est_kyy", "est_kxy", "est_dxx", "est_dyy", "est_dxy", "est_m", "est_omega_z"),
    *("true_kxx", "true_kyy", "true_kxy", "true_dxx", "true_dyy", "true_dxy", "true_m"),
]


def gyrotwin(*arguments: str, folder: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [*COMMAND, *arguments],
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=300,
        env={**os.environ, **environment},
    )


@pytest.fixture(scope="module")
def run_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("run")
    result = gyrotwin("run", "constant", "--duration", "0.12", "--seed", "3", "--out", "out", folder=folder)
    assert result.returncode == 0, result.stderr
    return folder / "out"


FILES = ["design.toml", "report.html", "summary.json", "trace.parquet"]


def test_a_run_writes_its_files_and_nothing_else(run_folder: Path) -> None:
    assert sorted(path.name for path in run_folder.iterdir()) == FILES


def test_summary_holds_every_promised_number(run_folder: Path) -> None:
    summary = json.loads((run_folder / "summary.json").read_text())
    assert (summary["scenario"], summary["seed"]) == ("constant", 3)
    assert set(summary["parameters"]) == {"kxx", "kyy", "kxy", "dxx", "dyy", "dxy", "m"}
    for values in summary["parameters"].values():
        assert set(values) == {"true", "estimate", "relative_error", "within_1_percent_at", "over_bound"}
    angle_keys = {"rms_deg", "max_deg", "reference_deg", "raw_rms_deg", "raw_max_deg", "drift_deg_per_s", "lag_s"}
    assert set(summary["angle"]) == {"unit", *angle_keys}
    assert set(summary["angle_units"]) == {"A", "B", "C"}
    assert all(set(values) == angle_keys for values in summary["angle_units"].values())
    assert summary["converged_at"] < 0.12
    assert set(summary["valid"]) == {"share", "withdrawn", "now", "reason", "stopped"}
    assert summary["valid"]["now"] is True
    assert 0 < summary["predicted"]["drift_sigma_deg_per_s"] < 0.5
    assert summary["real_time_factor"] > 0
    assert summary["omega"]["rms_error"] is not None


def test_trace_has_the_promised_columns_at_20_khz(run_folder: Path) -> None:
    trace = pl.read_parquet(run_folder / "trace.parquet")
    assert [name for name in TRACE_COLUMNS if name not in trace.columns] == []
    assert len(trace) == 2400
    # Decimated times are k * 10 * 5 us; each product rounds once.
    assert trace["t"][1] == pytest.approx(50e-6, rel=1e-15)


def test_angles_are_in_rad_and_nan_before_convergence(run_folder: Path) -> None:
    trace = pl.read_parquet(run_folder / "trace.parquet")
    before = trace.filter(~pl.col("converged"))
    after = trace.filter(pl.col("converged"))
    assert before["angle"].is_nan().all()
    assert before["angle_true"].is_nan().all()
    assert after["angle_true"][0] == 0.0
    # Over 0.12 s at 5 rad/s the angle stays below 0.5 rad; in degrees it would not.
    assert after["angle_true"].abs().max() < 0.5


def test_the_same_seed_gives_the_same_trace(run_folder: Path, tmp_path: Path) -> None:
    gyrotwin("run", "constant", "--duration", "0.12", "--seed", "3", "--out", "again", folder=tmp_path)
    again = pl.read_parquet(tmp_path / "again" / "trace.parquet")
    assert again.equals(pl.read_parquet(run_folder / "trace.parquet"), null_equal=True)


WRONG = {
    "scenario": (["run", "constnt"], "'constant'"),
    "device name": (["run", "constant", "--device", "refrence"], "'reference'"),
    "parameter name": (["run", "constant", "--set", "k3_xx=1"], "'k3_x'"),
    "parameter text": (["run", "constant", "--set", "kxx"], "name=value"),
    "parameter bound": (["run", "constant", "--set", "m=0"], "m = 0"),
    "not a number": (["run", "constant", "--set", "kxx=nan"], "finite"),
    "stiffness": (["run", "constant", "--set", "kxy=200"], "positive definite"),
    "damping": (["run", "constant", "--set", "dxy=1"], "dxx*dyy"),
    "controller setting": (["run", "constant", "--set", "controller.tone_z=1"], "'tone_"),
    "angle unit": (["run", "constant", "--angle", "D"], "A, B, C"),
    "observer": (["run", "constant", "--observer", "efk"], "'ekf'"),
    "sample rate": (["run", "constant", "--sample-rate", "10"], "Hz"),
    "duration": (["run", "constant", "--duration", "-1"], "duration"),
    "rate file": (["run", "motion", "--rate-profile", "none.csv", "--rate-column", "z"], "none.csv"),
    "rate column": (["run", "motion", "--rate-profile", "rate.csv", "--rate-column", "rat"], "'rate'"),
    "rate unit": (
        ["run", "motion", "--rate-profile", "rate.csv", "--rate-column", "rate", "--rate-unit", "turns"],
        "deg/s",
    ),
    "no rate unit": (["run", "motion", "--rate-profile", "rate.csv", "--rate-column", "rate"], "give --rate-unit"),
    "rate file too short": (
        [
            "run",
            "motion",
            "--rate-profile",
            "rate.csv",
            "--rate-column",
            "rate",
            "--rate-unit",
            "deg/s",
            "--duration",
            "9",
        ],
        "short",
    ),
    "time that stands still": (
        ["run", "motion", "--rate-profile", "still.csv", "--rate-column", "rate", "--rate-unit", "deg/s"],
        "increase",
    ),
    "device file": (["run", "constant", "--device", "wrong.toml"], "'kxy'"),
    "output": (["run", "constant", "--out", "rate.csv/out"], "--out"),
    "listing": (["list", "effect"], "'effects'"),
    "designed device": (
        ["device", "new", "--frequency", "3000", "--split", "1", "--q", "0", "--axis-angle", "0", "--mass", "1"],
        "q = ",
    ),
    "design name": (["run", "constant", "--design", "labb"], "'lab'"),
    "design file": (["run", "constant", "--design", "design.toml"], "'kxy'"),
    "trace rate": (["run", "constant", "--trace-rate", "-1"], "trace rate"),
    "observer setting": (["run", "constant", "--set", "observer.blok=1"], "'block'"),
    "monitor setting": (["run", "constant", "--set", "monitor.drift=1"], "'drift_limit'"),
    "part": (["run", "constant", "--set", "obsever.block=1"], "'observer'"),
}


@pytest.fixture(scope="module")
def wrong_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("wrong")
    rows = [f"{0.01 * k:.2f},{math.sin(0.1 * k):.6f}" for k in range(50)]
    (folder / "rate.csv").write_text("\n".join(["t,rate", *rows]))
    (folder / "still.csv").write_text("\n".join(["t,rate", *(rows[0] for _ in range(9))]))
    (folder / "wrong.toml").write_text('format = 1\nname = "wrong"\n[parameters]\nkx = 1.0\n')
    (folder / "design.toml").write_text('format = 1\nname = "wrong"\n[intervals]\nkx = [1.0, 2.0]\n')
    return folder


@pytest.mark.parametrize("case", WRONG)
def test_wrong_input_is_one_line_and_exit_code_2(
    case: str, wrong_folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments, expected = WRONG[case]
    before = sorted(wrong_folder.rglob("*"))
    monkeypatch.chdir(wrong_folder)
    with pytest.raises(SystemExit) as ending:
        main(arguments)
    assert ending.value.code == 2
    [line] = capsys.readouterr().err.strip().splitlines()
    assert line.startswith("gyrotwin: ")
    assert expected in line
    assert sorted(wrong_folder.rglob("*")) == before


ENDED = {
    "divergence in the first step": (["--set", "k3_x=-1e22", "--duration", "0.01"], "diverged at"),
    "divergence": (["--set", "k3_x=-1e16", "--duration", "0.01"], "diverged at"),
    "jitter": (["--set", "sampling_jitter=1e-8", "--duration", "0.05"], ""),
    "clipping": (["--set", "adc_limit=1.2", "--duration", "0.05"], ""),
    "feedthrough unknown": (["--set", "feedthrough=8", "--duration", "0.05"], ""),
}
"""Runs whose angle is not valid at the end: what is asked, what the reason says."""


@pytest.mark.parametrize("case", ENDED)
def test_a_run_that_is_not_valid_ends_with_its_files_and_exit_code_3(
    case: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments, reason = ENDED[case]
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as ending:
        main(["run", "constant", *arguments, "--out", "out"])
    assert ending.value.code == 3
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == FILES
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert summary["valid"]["now"] is False
    assert summary["valid"]["reason"] and reason in summary["valid"]["reason"]
    assert "not valid at the end" in capsys.readouterr().out
    assert len(pl.read_parquet(tmp_path / "out" / "trace.parquet")) >= 1


def test_the_design_beside_the_results_runs_again(run_folder: Path, tmp_path: Path) -> None:
    design = str(run_folder / "design.toml")
    run = ["run", "constant", "--duration", "0.12", "--seed", "3", "--design", design, "--out", "again"]
    result = gyrotwin(*run, folder=tmp_path)
    assert result.returncode == 0, result.stderr
    first, again = (pl.read_parquet(folder / "trace.parquet") for folder in (run_folder, tmp_path / "again"))
    # An interval is written about its middle and rounds once more when it is read: by some 1e-16 of the value, 1e-14 of
    # the deviation. The estimates are as near as a filter of 24,000 samples keeps that.
    for name in ("kxx", "kyy", "kxy", "dxx", "dyy", "dxy", "m"):
        np.testing.assert_allclose(again[f"est_{name}"][-1], first[f"est_{name}"][-1], rtol=1e-7)
    assert again["converged"].equals(first["converged"])


def test_trace_rate_is_rows_a_second(tmp_path: Path) -> None:
    result = gyrotwin("run", "constant", "--duration", "0.02", "--trace-rate", "1000", "--out", "out", folder=tmp_path)
    assert result.returncode == 3, result.stderr
    assert len(pl.read_parquet(tmp_path / "out" / "trace.parquet")) == 20


def test_no_compiler_is_said(wrong_folder: Path) -> None:
    result = gyrotwin("build", "--force", folder=wrong_folder, CC="no-such-compiler")
    assert result.returncode == 2
    assert "no-such-compiler" in result.stderr


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no SIGINT for one process")
def test_ctrl_c_ends_a_run_and_leaves_nothing(tmp_path: Path) -> None:
    # A minute of it takes some twenty seconds, or more where the loop has to be compiled first.
    command = [*COMMAND, "run", "constant", "--duration", "60", "--out", "out"]
    process = subprocess.Popen(command, cwd=tmp_path, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    # By then it is past its first imports, on a busy machine too.
    time.sleep(5)
    process.send_signal(signal.SIGINT)
    _, complaint = process.communicate(timeout=60)
    assert process.returncode == 130
    assert "interrupted" in complaint
    assert "Traceback" not in complaint
    assert list(tmp_path.rglob("report.html")) == []


def test_a_user_observer_by_file(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text(
        "from cosim.observers.ekf import OBSERVER as packaged\nOBSERVER = packaged._replace(name='mine')\n"
    )
    result = gyrotwin("run", "constant", "--duration", "0.1", "--observer", "mine.py", "--out", "out", folder=tmp_path)
    assert result.returncode == 0, result.stderr
    assert json.loads((tmp_path / "out" / "summary.json").read_text())["run"]["observer"] == "mine"


def test_a_designed_device_runs(tmp_path: Path) -> None:
    design = ["--frequency", "3000", "--split", "30", "--q", "2000", "--axis-angle", "12", "--mass", "1e-7"]
    assert gyrotwin("device", "new", *design, "--name", "mine", folder=tmp_path).returncode == 0
    refused = gyrotwin("device", "new", *design, "--name", "mine", folder=tmp_path)
    assert refused.returncode == 2
    assert "--force" in refused.stderr
    run = ["run", "constant", "--device", "mine.toml", "--duration", "0.15", "--out", "out"]
    assert gyrotwin(*run, folder=tmp_path).returncode == 0


@pytest.mark.parametrize("what", ["effects", "devices", "designs", "scenarios", "observers"])
def test_listings(what: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["list", what])
    named = {"effects": "cubic_stiffness", "devices": "whole_angle", "scenarios": "varying", "observers": "lyapunov"}
    named |= {"designs": "sensing_defects"}
    assert named[what] in capsys.readouterr().out


def test_effects_of_one_s_own_are_listed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = (EFFECTS_FOLDER / "cubic_stiffness.py").read_text().replace("cubic_stiffness", "own_spring")
    (tmp_path / "own_spring.py").write_text(text.replace("k3_", "own_"))
    with pytest.raises(SystemExit) as ended:
        main(["list", "effects", "--effects", str(tmp_path)])
    assert ended.value.code == 0
    assert "own_spring" in capsys.readouterr().out
    with pytest.raises(SystemExit) as ended:
        main(["list", "devices", "--effects", str(tmp_path)])
    assert ended.value.code == 2
    assert "gyrotwin list effects" in capsys.readouterr().err


@pytest.mark.parametrize("command", [["run"], ["build"], ["list"], ["device", "new"], ["diagnose"]])
def test_help_explains_every_option(command: list[str], tmp_path: Path) -> None:
    result = gyrotwin(*command, "--help", folder=tmp_path, COLUMNS="200", NO_COLOR="1", TERM="dumb")
    assert result.returncode == 0
    options = [line for line in result.stdout.splitlines() if line.strip(" │").startswith("--")]
    # An explained option has words after its name, type and default.
    assert [line for line in options if len(line.split()) < 4] == []


@pytest.mark.parametrize(
    ("arguments", "said"),
    [(["run", "constant", "--sede", "7"], "--sede"), (["run"], "scenario"),
     (["run", "constant", "--seed", "x"], "--seed"),
     (["device", "nw"], "new"), (["diagnose", "--each"], "FOLDER")],
)  # fmt: skip
def test_a_mistyped_command_line_is_one_line(
    arguments: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    assert ended.value.code == 2
    [line] = capsys.readouterr().err.splitlines()
    assert line.startswith("gyrotwin: ")
    assert said in line


def test_without_arguments_the_help_is_shown_once(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main([])
    assert capsys.readouterr().out.count("Usage:") == 1


def test_a_device_s_name_is_no_path(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "here"
    folder.mkdir()
    monkeypatch.chdir(folder)
    known = ["--frequency", "3000", "--split", "30", "--q", "2000", "--mass", "1e-7"]
    with pytest.raises(SystemExit) as ended:
        main(["device", "new", *known, "--name", "../up"])
    assert ended.value.code == 2
    assert "--out" in capsys.readouterr().err
    assert [path.name for path in tmp_path.rglob("*")] == ["here"]
