"""`gyrotwin diagnose` on wrong input: one line; and an interrupted search."""

import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import polars as pl
import pytest
from cubic_case import TRUE, Tables, exit_code, written

from discrepancy import diagnose as naming
from discrepancy.tell.answer import Diagnosis
from gyro_model.build import Fmus
from gyrotwin.interrupt import Interrupted
from gyrotwin.tasks import diagnose


def test_nothing_is_written_through_a_link_in_the_folder(
    answer: SimpleNamespace, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "effects").symlink_to(tmp_path / "elsewhere")
    assert exit_code("diagnose", str(answer.data), "--out", str(tmp_path / "out")) == 2
    assert "is a link" in capsys.readouterr().err


def cut(runs: Tables) -> Tables:
    """The runs without fifty rows in the middle of the first."""
    first = runs["run-0.parquet"]
    return {**runs, "run-0.parquet": pl.concat([first[:2000], first[2050:]])}


def changed(runs: Tables, *expressions: pl.Expr) -> Tables:
    return {name: table.with_columns(*expressions) for name, table in runs.items()}


Fault = tuple[Callable[[Path, Tables], Path], list[str], str]

FAULTS: dict[str, Fault] = {
    "no folder": (lambda p, r: p / "none", [], "dataset init"),
    "format": (lambda p, r: written(p / "d", r, head="format = 2"), [], "format = 2"),
    "unknown nominal key": (lambda p, r: written(p / "d", r, {**TRUE, "kxxx": 1.0}), [], "'kxx'"),
    "lacking nominal": (lambda p, r: written(p / "d", r, {"kxx": 64.0}), [], "lacks m "),
    "no run": (lambda p, r: written(p / "d", {}), [], "no run"),
    "no run to fit": (lambda p, r: written(p / "d", {"a.parquet": r["run-0.parquet"]}), [], "no run to fit"),
    "missing column": (lambda p, r: written(p / "d", {n: t.drop("v_y") for n, t in r.items()}), [], "v_y"),
    "hole": (lambda p, r: written(p / "d", cut(r)), [], "hole"),
    "no number": (lambda p, r: written(p / "d", changed(r, pl.col("u_x").shift(1))), [], "u_x"),
    "wrong sign": (lambda p, r: written(p / "d", changed(r, -pl.col("v_x"), -pl.col("v_y"))), [], "sign"),
    "swapped": (
        lambda p, r: written(p / "d", changed(r, pl.col("v_y").alias("v_x"), pl.col("v_x").alias("v_y"))),
        [],
        "v_x and v_y",
    ),
    "millivolt": (lambda p, r: written(p / "d", changed(r, pl.col("v_x") * 1e3, pl.col("v_y") * 1e3)), [], "mV"),
    "time in ms": (lambda p, r: written(p / "d", changed(r, pl.col("t") * 1e3)), [], "ms"),
    "dead channel": (lambda p, r: written(p / "d", changed(r, pl.col("v_y") * 0)), [], "unconnected"),
    "device": (lambda p, r: written(p / "d", r), ["--device", "refrence"], "'reference'"),
    "effects": (lambda p, r: written(p / "d", r), ["--effects", "nowhere"], "nowhere"),
    "max effects": (lambda p, r: written(p / "d", r), ["--max-effects", "-1"], "--max-effects"),
    "jobs": (lambda p, r: written(p / "d", r), ["--jobs", "0"], "--jobs"),
}


@pytest.mark.parametrize("case", FAULTS)
def test_a_fault_is_one_line_and_exit_code_2(
    case: str, runs: Tables, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    make, options, expected = FAULTS[case]
    data = make(tmp_path, runs)
    before = sorted(tmp_path.rglob("*"))
    assert exit_code("diagnose", str(data), *options, "--out", str(tmp_path / "out")) == 2
    [line] = capsys.readouterr().err.strip().splitlines()
    assert line.startswith("gyrotwin: ")
    assert expected in line
    assert sorted(tmp_path.rglob("*")) == before


def test_a_missing_table(runs: Tables, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    data = written(tmp_path / "d", runs)
    (data / "run-1.parquet").unlink()
    assert exit_code("diagnose", str(data), "--out", str(tmp_path / "out")) == 2
    assert "run-1.parquet does not exist" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_an_interrupted_search_goes_on(
    answer: SimpleNamespace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"

    def stops(*_: Any, checkpoint: Path, **__: Any) -> None:
        checkpoint.write_text("half-way")
        raise Interrupted

    def goes_on(*_: Any, checkpoint: Path, **__: Any) -> Diagnosis:
        assert checkpoint.read_text() == "half-way"
        found: Diagnosis = answer.found
        return found

    monkeypatch.setattr(diagnose, "build", lambda *_: Fmus(answer.out / "fmi2.fmu", answer.out / "fmi3.fmu"))
    monkeypatch.setattr(naming, "diagnose", stops)
    assert exit_code("diagnose", str(answer.data), "--out", str(out)) == 130
    [line] = capsys.readouterr().err.strip().splitlines()
    assert "the same command goes on" in line and str(out) in line
    assert [path.name for path in out.iterdir()] == [diagnose.CHECKPOINT]
    monkeypatch.setattr(naming, "diagnose", goes_on)
    assert exit_code("diagnose", str(answer.data), "--out", str(out)) == 0
    assert not (out / diagnose.CHECKPOINT).exists()
    assert (out / "report.html").is_file()


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no SIGINT for one process")
def test_ctrl_c_in_the_search(answer: SimpleNamespace, tmp_path: Path) -> None:
    command = [sys.executable, "-u", "-m", "gyrotwin", "diagnose", str(answer.data), "--out", "out"]
    process = subprocess.Popen(command, cwd=tmp_path, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    while "nominal parameters" not in (line := process.stdout.readline()):
        assert line, "ended before the search"
    process.send_signal(signal.SIGINT)
    _, complaint = process.communicate(timeout=60)
    assert process.returncode == 130
    assert "interrupted" in complaint and "Traceback" not in complaint
    assert list(tmp_path.rglob("report*")) == []


def test_a_folder_that_cannot_be_written(answer: SimpleNamespace, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    assert exit_code("diagnose", str(answer.data), "--out", str(tmp_path / "file" / "out")) == 2
