"""What a user of `gyrotwin sweep` sees: failures, a changed task file, output names."""

from pathlib import Path

import polars as pl
import pytest

from gyro_model.errors import InputError
from gyrotwin.cli import main
from gyrotwin.interrupt import Interrupted
from gyrotwin.sweeping import rows
from gyrotwin.sweeping.plan import Point, load_plan
from gyrotwin.sweeping.work import job_of, work
from gyrotwin.tasks import sweep as task

pytest.importorskip("distributed", reason="needs the extra `sweep`")

PLAN = 'task = "task.py:f"\n[parameters.a]\ngrid = [1, 2]\n[parameters.b]\ngrid = [3, 4, 5]\n'


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "plan.toml").write_text(PLAN)
    return tmp_path


def define(folder: Path, expression: str) -> None:
    (folder / "task.py").write_text(f"def f(a, b):\n    return {{'q': {expression}}}\n")


def sweep(*more: str) -> int:
    """Exit code of the command."""
    try:
        main(["sweep", "plan.toml", "--workers", "1", *more])
    except SystemExit as ended:
        return int(ended.code or 0)
    return 0


def test_rows_follow_the_task_file(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rows = folder / "results" / "plan" / "rows"
    define(folder, "a / (b - 4)")
    assert sweep() == 0
    said = capsys.readouterr().out
    assert "6 points, 2 failed" in said
    assert "point 1 (a = 1, b = 4): ZeroDivisionError: division by zero" in said
    assert pl.read_parquet(rows).sort("point")["q"].to_list() == [-1, None, 1, -2, None, 2]

    define(folder, "10 * a / b")
    assert sweep() == 2
    said = capsys.readouterr().err
    assert "a file that it names was changed" in said
    assert "--force" in said
    assert pl.read_parquet(rows)["q"].null_count() == 2

    assert sweep("--force") == 0
    assert pl.read_parquet(rows).sort("point")["q"].to_list() == [10 * a / b for a in (1, 2) for b in (3, 4, 5)]


def test_failed_points_are_tried_again_by_force(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    define(folder, f"float(open({str(folder / 'gain')!r}).read()) * a")
    assert sweep() == 1
    said = capsys.readouterr().out
    assert "6 points, 6 failed" in said
    assert "point 0 (a = 1, b = 3): FileNotFoundError" in said
    (folder / "gain").write_text("2")
    assert sweep("--force") == 0
    assert "6 points, 0 failed" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("zz", "'zz' is unknown; there are q, group"),
        ("group.froce", "there are group.force, group.rate; did you mean 'group.force'?"),
        ("group", "is a group; there are group.force, group.rate"),
        ("q.x", "'q.x' is unknown; q is a single value"),
    ],
)
def test_a_wrong_output_lists_the_right_ones(name: str, said: str, tmp_path: Path) -> None:
    (tmp_path / "task.py").write_text("def f(a):\n    return {'q': a, 'group': {'force': a, 'rate': a}}\n")
    plan = load_plan({"task": f"{tmp_path}/task.py:f", "parameters": {"a": {"grid": [1]}}, "outputs": [name]})
    done = work(job_of(plan), [Point(0, {"a": 1}, 1)])
    assert done[0].error is not None
    assert done[0].error.startswith(InputError.__name__)
    assert said in done[0].error


@pytest.mark.parametrize(
    ("option", "said"),
    [
        (("--workers", "0"), "--workers 0: give 1 or more"),
        (("--scheduler", "http://127.0.0.1:1"), "--scheduler http://127.0.0.1:1: unknown address scheme"),
    ],
)
def test_a_cluster_that_can_not_be_is_one_line(
    option: tuple[str, str], said: str, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    define(folder, "a")
    assert sweep(*option) == 2
    assert said in capsys.readouterr().err
    # Nothing was computed: another plan may have the folder.
    (folder / "plan.toml").write_text(PLAN.replace("[1, 2]", "[7]"))
    assert sweep() == 0
    assert "3 points, 0 failed" in capsys.readouterr().out


def test_an_interrupted_sweep_says_what_it_keeps(folder: Path) -> None:
    define(folder, "a")

    def stop(done: float, all_points: float) -> None:
        if done > 0:
            raise Interrupted

    with pytest.raises(Interrupted) as stopped:
        task.sweep("plan.toml", "out", workers=1, progress=stop)
    kept = len(rows.read(folder / "out"))
    assert 0 < kept < 6
    assert stopped.value.left == f"out keeps {kept} of 6 points: the same command goes on from there"
