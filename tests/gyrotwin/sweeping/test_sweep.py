"""Sweeps on a real scheduler: the same rows however many workers there are and whatever happens to them."""

import os
import time
from math import pi
from pathlib import Path

import polars as pl
import pytest

import gyrotwin as gt
from gyrotwin.sweeping import engine, rows
from gyrotwin.sweeping.engine import sweep as work_off
from gyrotwin.sweeping.plan import load_plan
from gyrotwin.sweeping.work import job_of
from gyrotwin.tasks.sweep import replay

distributed = pytest.importorskip("distributed", reason="needs the extra `sweep`")

TASK = '''
import os, time
from math import sin
import numpy as np

def ishigami(a, b, c):
    return sin(a) + 7 * sin(b) ** 2 + 0.1 * c**4 * sin(a)

def product(n, seed):
    """A sum whose last bits would show another number of threads."""
    rng = np.random.default_rng(1000 * n + seed)
    a = rng.normal(size=(300, 300))
    if n == 3:
        raise ValueError("three")
    return {"trace": float(np.trace(a @ a)), "text": f"n{n}"}

def slow(n, folder):
    open(f"{folder}/{os.getpid()}", "a").close()
    time.sleep(0.15)
    return {"twice": 2.0 * n}

def dies(n):
    if n == 2:
        os._exit(1)
    return {"n": n}
'''


@pytest.fixture
def task(tmp_path: Path) -> str:
    path = tmp_path / "task.py"
    path.write_text(TASK)
    return str(path)


def test_one_two_and_four_workers_give_the_same_rows(task: str, tmp_path: Path) -> None:
    plan = {"task": f"{task}:product", "seeds": 3, "parameters": {"n": {"grid": list(range(8))}}}
    found = [gt.sweep(plan, tmp_path / f"out{n}", workers=n).rows for n in (1, 2, 4)]
    assert found[0].equals(found[1])
    assert found[0].equals(found[2])
    assert found[0]["point"].to_list() == list(range(24))
    assert found[0].filter(pl.col("error").is_not_null())["n"].unique().to_list() == [3]
    assert found[0].filter(pl.col("n") == 3)["error"][0] == "ValueError: three"


def test_a_worker_killed_in_the_middle_changes_no_row(task: str, tmp_path: Path) -> None:
    (tmp_path / "pids").mkdir()
    plan = load_plan({
        "task": f"{task}:slow", "parameters": {"n": {"grid": list(range(40))}},
        "fixed": {"folder": str(tmp_path / "pids")},
    })  # fmt: skip
    with (
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, processes=True, dashboard_address="127.0.0.1:0", host="127.0.0.1"
        ) as cluster,
        distributed.Client(cluster.scheduler_address) as client,
    ):
        killed: list[int] = []

        def progress(done: float, total: float) -> None:
            if not killed and done >= 5:
                killed.append(int(next(iter((tmp_path / "pids").iterdir())).name))
                os.kill(killed[0], 9)

        work_off(client, job_of(plan), plan.points(), tmp_path / "out", progress)
    found = rows.read(tmp_path / "out")
    assert killed
    # The work went on in another process than the one killed.
    assert len(list((tmp_path / "pids").iterdir())) >= 2
    assert found["twice"].to_list() == [2.0 * n for n in range(40)]
    assert found["error"].null_count() == 40


def test_a_point_that_kills_its_worker_becomes_a_row(task: str, tmp_path: Path) -> None:
    plan = {"task": f"{task}:dies", "parameters": {"n": {"grid": [0, 1, 2, 3, 4, 5]}}}
    found = gt.sweep(plan, tmp_path / "out", workers=2).rows
    assert found.filter(pl.col("error").is_null())["n"].to_list() == [0, 1, 3, 4, 5]
    assert found["error"][2].startswith("worker died")


def test_workers_that_nobody_restarts_are_replaced(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(engine, "LONELY_S", 1.0)
    with engine.cluster(1, None) as client:
        before = client.submit(os.getpid).result()
        for nanny in client.cluster.workers.values():
            nanny.auto_restart = False
        os.kill(before, 9)
        assert client.submit(os.getpid, pure=False).result(timeout=120) != before


def test_an_interrupted_sweep_goes_on_where_it_was(task: str, tmp_path: Path) -> None:
    plan = {"task": f"{task}:product", "parameters": {"n": {"grid": [0, 1, 2, 4]}}}
    whole = gt.sweep(plan, tmp_path / "out", workers=1).rows
    parts = sorted((tmp_path / "out" / "rows").iterdir())
    kept = {path: path.stat().st_mtime_ns for path in parts[1:]}
    parts[0].unlink()
    told: list[tuple[float, float]] = []
    again = gt.sweep(plan, tmp_path / "out", workers=1, progress=lambda *at: told.append(at))
    assert again.rows.equals(whole)
    assert told[-1][1] < 4
    assert {path: path.stat().st_mtime_ns for path in kept} == kept
    with pytest.raises(gt.InputError, match="another plan"):
        gt.sweep({**plan, "seeds": 2}, tmp_path / "out", workers=1)


def test_sobol_indices_of_the_ishigami_function(task: str, tmp_path: Path) -> None:
    """Ishigami and Homma 1990 with a = 7, b = 0.1: variance by integration over the cube (-π, π)³."""
    whole = 7**2 / 8 + 0.1 * pi**4 / 5 + 0.1**2 * pi**8 / 18 + 0.5
    first = [0.5 * (1 + 0.1 * pi**4 / 5) ** 2 / whole, 7**2 / 8 / whole, 0.0]
    both = 0.1**2 * pi**8 * (1 / 18 - 1 / 50) / whole
    total = [first[0] + both, first[1], both]
    angle = {"distribution": "uniform", "loc": -pi, "scale": 2 * pi}
    plan = {
        "task": f"{task}:ishigami", "parameters": dict.fromkeys("abc", angle),
        "sampling": {"method": "saltelli", "points": 1024, "seed": 1}, "limits": {"value": [-3, 9]},
    }  # fmt: skip
    result = gt.sweep(plan, tmp_path / "out", workers=2)
    assert len(result.rows) == 1024 * 5
    for index, a, b in zip(result.sensitivity["value"], first, total, strict=True):
        # The intervals hold 95 % each; twice their half-width all six.
        assert abs(index.first - a) < 2 * index.first_reach
        assert abs(index.total - b) < 2 * index.total_reach
        assert index.first_reach < 0.1
    page = (tmp_path / "out" / "report.html").read_text()
    assert "What value depends on" in page
    assert f"--point {result.worst(1)['point'][0]}" in page
    assert 0.85 < result.summary["yield"]["value"] < 0.99


def test_the_worst_points_go_on_within_the_limits(task: str, tmp_path: Path) -> None:
    angles = {"grid": [-1.5, -0.5, 0.5, 1.5]}
    plan = {"task": f"{task}:ishigami", "parameters": {"a": angles, "b": {"grid": [0.0]}, "c": {"grid": [0.0]}},
            "limits": {"value": [float("-inf"), 0.9]}}  # fmt: skip
    # sin(a): 0.997 is beyond the limit, the others are the farther within the smaller they are.
    result = gt.sweep(plan, tmp_path / "out", workers=1)
    assert result.worst(4)["a"].to_list() == [1.5, 0.5, -0.5, -1.5]


def test_morris_tells_what_matters_from_what_does_not(tmp_path: Path) -> None:
    path = tmp_path / "linear.py"
    path.write_text("def f(a, b):\n    return 3 * a\n")
    unit = {"distribution": "uniform"}
    plan = {"task": f"{path}:f", "parameters": {"a": unit, "b": unit},
            "sampling": {"method": "morris", "points": 8}}  # fmt: skip
    a, b = gt.sweep(plan, tmp_path / "out", workers=1).sensitivity["value"]
    # Linear: every elementary effect is the slope.
    assert a.first == pytest.approx(3.0)
    assert b.first == 0.0


def test_devices_of_a_wafer_run_and_one_replays(tmp_path: Path) -> None:
    plan = {
        "task": "run", "fixed": {"scenario": "constant", "duration": 0.05, "designer": {"q": 2000, "mass": 1e-7}},
        "parameters": {"designer.frequency": {"grid": [3000, 0.1]}, "designer.split": {"grid": [30]}},
        "outputs": ["omega.rms_error"],
    }  # fmt: skip
    result = gt.sweep(plan, tmp_path / "out", workers=1)
    assert result.rows["error"][0] is None
    assert "1 to 1e+07 Hz" in result.rows["error"][1]
    again = replay(load_plan(plan), 0)
    assert again.outputs["omega.rms_error"] == result.rows["omega.rms_error"][0]


def test_overhead_a_task_is_small(task: str, tmp_path: Path) -> None:
    """At most 5 ms a task on idle cores: tasks are batched, so that a thousand quick ones cost their batches."""
    plan = load_plan({"task": f"{task}:ishigami", "parameters": {n: {"grid": list(range(10))} for n in "abc"}})
    with (
        distributed.LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address="127.0.0.1:0") as cluster,
        distributed.Client(cluster) as client,
    ):
        client.run(lambda: __import__("gyrotwin.sweeping.work"))
        start = time.perf_counter()
        work_off(client, job_of(plan), plan.points(), tmp_path / "out")
        took = time.perf_counter() - start
    assert len(rows.read(tmp_path / "out")) == 1000
    assert took / 1000 < 5e-3
