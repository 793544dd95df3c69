"""Conditions at the edge: one line, exit code 2, nothing half-written, and nobody else's files touched."""

import contextlib
import os
import subprocess
import sys
from pathlib import Path

import polars as pl
import pytest

import gyrotwin as gt
from gyrotwin.cli import main
from gyrotwin.output import check_writable, foreign_files, publish

NINES = "9" * 400
DEEP = "[" * 5000 + "]" * 5000
DEVICE = 'format = 1\nname = "a"\n[parameters]\n'
FILES = {
    "digits.toml": f"{DEVICE}m = {NINES}\n",
    "more_digits.toml": f"{DEVICE}m = {'9' * 5000}\n",
    "nested.toml": f'format = 1\nname = "a"\nx = {DEEP}\n',
    "interval.toml": f"{DEVICE}[intervals]\nm = [1, {NINES}]\n",
    "controller.toml": f"{DEVICE}[controller]\nk = {NINES}\n",
    "exits/a.py": "raise SystemExit(0)\n",
    "divides/a.py": "1/0\n",
    "exits.py": "raise SystemExit\n",
    "nested_set/dataset.toml": f"format = 1\nx = {DEEP}\n",
    "digits_set/dataset.toml": f'format = 1\n[[run]]\nfile = "r.csv"\nsample_rate = {NINES}\n',
    "struct_set/dataset.toml": 'format = 1\n[[run]]\nfile = "r.parquet"\nsample_rate = 2e5\n'
    '[[run]]\nfile = "s.parquet"\nsample_rate = 2e5\n',
    "full/thesis.docx": "mine",
}
NEW = ["device", "new", "--frequency", "3e3", "--split", "30", "--q", "2000", "--mass", "1e-7"]

WRONG = {
    "digits in a device": (["run", "constant", "--device", "digits.toml"], "m = inf"),
    "thousands of digits": (["run", "constant", "--device", "more_digits.toml"], "digits"),
    "nested brackets in a device": (["run", "constant", "--device", "nested.toml"], "nested too deeply"),
    "digits in an interval": (["run", "constant", "--device", "interval.toml"], "low, high"),
    "digits of the controller": (["run", "constant", "--device", "controller.toml"], "positive number in N/m"),
    "nested brackets in a design": (["run", "constant", "--design", "nested.toml"], "nested too deeply"),
    "nested brackets in a scenario": (["run", "nested.toml"], "nested too deeply"),
    "an effect that exits": (["run", "constant", "--effects", "exits"], "SystemExit"),
    "an effect that divides by zero": (["run", "constant", "--effects", "divides"], "ZeroDivisionError"),
    "an observer that exits": (["run", "constant", "--observer", "exits.py"], "SystemExit"),
    "a controller that exits": (["run", "constant", "--controller", "exits.py"], "SystemExit"),
    "nested brackets in a data set": (["diagnose", "nested_set"], "nested too deeply"),
    "digits in a data set": (["diagnose", "digits_set"], "sample_rate"),
    "a struct column": (["diagnose", "struct_set"], "one number a row"),
    "a struct column of a record": (["split", "struct_set/r.parquet", "--column", "u_x"], "one number a row"),
    "a struct column of a lab's table": (["dataset", "init", "struct_set/r.parquet"], "one number a row"),
    "a negative seed": (["dataset", "simulate", "trial", "--seed", "-1"], "seed"),
    "a folder that can't be made": (["dataset", "simulate", "/proc/trial"], "/proc/trial"),
    "a missing folder": ([*NEW, "--out", "nowhere/a.toml"], "nowhere/a.toml"),
    "an absurd rate": (["rate", "--rate-step", "1e300", "--duration", "1"], "deg/s"),
    "absurd frequency": ([*NEW, "--frequency", "3e9"], "1 to 1e+07 Hz"),
    "absurd Q": ([*NEW, "--q", "0.1"], "1 to 1e+10"),
    "absurd mass": ([*NEW, "--mass", "1e30"], "1e-18 to 1000 kg"),
    "a gain that overflows": ([*NEW, "--gain", "1e300"], "V/m"),
    "a gain set to overflow": (["run", "constant", "--set", "sense_gain_x=1e300"], "V/m"),
    "somebody's files": (["run", "constant", "--out", "full"], "thesis.docx"),
    "a command": (["rnu"], "did you mean 'run'"),
}


@pytest.fixture(scope="module")
def wrong(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("wrong")
    for name, text in FILES.items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_text(text)
    t = pl.Series([k / 2e5 for k in range(1000)])
    table = pl.DataFrame({"t": t, "u_x": t, "u_y": t, "v_x": t, "v_y": t}).with_columns(pl.struct("u_x").alias("u_x"))
    for name in ("r", "s"):
        table.write_parquet(folder / "struct_set" / f"{name}.parquet")
    return folder


@pytest.mark.parametrize("what", WRONG)
def test_one_line_exit_code_2_and_nothing_written(
    what: str, wrong: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    arguments, said = WRONG[what]
    monkeypatch.chdir(wrong)
    before = sorted(wrong.rglob("*"))
    with pytest.raises(SystemExit) as end:
        main(arguments)
    error = capsys.readouterr().err
    assert end.value.code == 2
    assert len(error.splitlines()) == 1
    assert error.startswith("gyrotwin: ")
    assert said in error
    assert sorted(wrong.rglob("*")) == before


def test_force_writes_beside_somebody_s_files(tmp_path: Path) -> None:
    (tmp_path / "thesis.docx").write_text("mine")
    with pytest.raises(gt.InputError, match=r"thesis\.docx"):
        publish(tmp_path, {"summary.json": lambda path: path.write_text("{}")})
    publish(tmp_path, {"summary.json": lambda path: path.write_text("{}")}, force=True)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["summary.json", "thesis.docx"]
    assert (tmp_path / "thesis.docx").read_text() == "mine"


def test_what_commands_write_is_not_foreign_to_them(tmp_path: Path) -> None:
    gt.run("constant", duration=0.05).save(tmp_path)
    assert foreign_files(tmp_path) == []


@pytest.mark.skipif(sys.platform == "win32", reason="limits of a process are POSIX's")
def test_a_full_disk_leaves_nothing(tmp_path: Path) -> None:
    """A limit on the size of a file acts like a disk that is full; it holds for one process."""
    script = (
        "import resource, signal, sys\n"
        "signal.signal(signal.SIGXFSZ, signal.SIG_IGN)\n"
        "from gyrotwin.cli import main\n"
        "from cosim import master\n"
        "import gyrotwin as gt\n"
        "result = gt.run('constant', duration=0.05)\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (20000, 20000))\n"
        "try:\n"
        "    result.save('out')\n"
        "except gt.InputError as error:\n"
        "    print(error)\n"
    )
    done = subprocess.run([sys.executable, "-c", script], cwd=tmp_path, capture_output=True, text=True,
                          env={**os.environ, "PYTHONPATH": str(Path(gt.__file__).parents[1])})  # fmt: skip
    assert "nothing written" in done.stdout, done.stderr
    assert len(done.stdout.splitlines()) == 1
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(sys.platform == "win32", reason="limits of a process are POSIX's")
def test_a_full_disk_leaves_no_part_of_a_data_set(tmp_path: Path) -> None:
    # 500 KiB: more than an FMU's library, less than 20,000 rows.
    done = shell(
        tmp_path, "ulimit -f 500; trap '' XFSZ; exec \"$0\" -m gyrotwin dataset simulate trial --samples 20000"
    )
    assert done.returncode == 2
    assert "trial" in done.stderr and "nothing written" in done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert list((tmp_path / "trial").iterdir()) == []


@pytest.mark.skipif(sys.platform != "linux", reason="/dev/full is Linux's")
def test_where_nothing_can_be_said_that_is_one_line(tmp_path: Path) -> None:
    done = shell(tmp_path, 'exec "$0" -m gyrotwin list effects > /dev/full')
    assert (done.returncode, done.stderr) == (2, "gyrotwin: No space left on device\n")


def test_letters_that_an_output_lacks_are_question_marks(tmp_path: Path) -> None:
    done = shell(tmp_path, 'PYTHONIOENCODING=ascii exec "$0" -m gyrotwin list effects')
    assert done.returncode == 0, done.stderr
    assert "?" in done.stdout


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere the cache has another place")
def test_a_cache_that_can_t_be_written_is_told_with_its_remedy(tmp_path: Path) -> None:
    done = shell(tmp_path, 'XDG_CACHE_HOME=/proc/cache exec "$0" -m gyrotwin run constant --duration 0.05 --design lab')
    assert done.returncode == 2
    assert "XDG_CACHE_HOME" in done.stderr


def shell(folder: Path, line: str) -> subprocess.CompletedProcess[str]:
    """Runs a line in which $0 is this Python."""
    environment = {**os.environ, "PYTHONPATH": str(Path(gt.__file__).parents[1])}
    command = ["bash", "-c", line, sys.executable]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, env=environment, check=False)


def test_a_second_run_into_the_same_folder_is_refused(tmp_path: Path) -> None:
    script = "import sys, time\nfrom pathlib import Path\nfrom gyrotwin.output import check_writable\n"
    script += "check_writable(Path('out'))\nprint('held', flush=True)\ntime.sleep(60)\n"
    environment = {**os.environ, "PYTHONPATH": str(Path(gt.__file__).parents[1])}
    first = subprocess.Popen(
        [sys.executable, "-c", script], cwd=tmp_path, stdout=subprocess.PIPE, text=True, env=environment
    )
    try:
        assert first.stdout is not None
        assert first.stdout.readline() == "held\n"
        with pytest.raises(gt.InputError, match="another run writes to it"):
            check_writable(tmp_path / "out")
    finally:
        first.kill()
        first.wait()
    # However the first one ended, its hold ended with it.
    publish(tmp_path / "out", {"summary.json": lambda path: path.write_text("{}")})


def test_device_new_says_what_it_assumed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "mine.toml"
    with contextlib.suppress(SystemExit):
        main([*NEW, "--gain", "2e6", "--out", str(path)])
    shown = capsys.readouterr().out
    assert all(f"({option})" in shown for option in ("--axis-angle", "--q-upper", "--noise", "--gap"))
    assert "--gain" not in shown
    assert "Assumed: no noise" in path.read_text()
    assert gt.load_device(path).parameters["sense_gain_y"] == 2e6


@pytest.mark.skipif(not hasattr(os, "wait4"), reason="processor time of one child is POSIX's")
def test_something_is_said_within_a_second(tmp_path: Path) -> None:
    """By processor time, which is what a user waits on an idle machine; half as much again for shared caches. Where
    cores are shared, less of it passes before the promise is due."""
    environment = {**os.environ, "PYTHONPATH": str(Path(gt.__file__).parents[1])}
    command = [sys.executable, "-u", "-m", "gyrotwin", "run", "constant"]
    run = subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.PIPE, text=True, env=environment)
    assert run.stdout is not None
    first = run.stdout.readline()
    run.kill()
    _, _, used = os.wait4(run.pid, 0)
    assert first.strip()
    assert used.ru_utime + used.ru_stime < 1.5
