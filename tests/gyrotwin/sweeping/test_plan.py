"""Points of a plan: grids, lists, distributions, correlation; and what is refused."""

import sys
from pathlib import Path

import numpy as np
import pytest

from gyro_model.errors import InputError
from gyrotwin.cli import main
from gyrotwin.sweeping.plan import load_plan

NORMAL = {"distribution": "norm", "loc": 1.0, "scale": 0.1}


def test_grids_are_combined_and_lists_go_together() -> None:
    plan = load_plan({
        "task": "run", "seeds": 2,
        "parameters": {"a": {"grid": [1, 2, 3]}, "b": {"values": [4, 5]}, "c": {"values": [6, 7]}},
    })  # fmt: skip
    points = plan.points()
    assert len(points) == 3 * 2 * 2
    assert [p.number for p in points] == list(range(12))
    assert {(p.values["b"], p.values["c"]) for p in points} == {(4, 6), (5, 7)}
    assert [p.seed for p in points[:2]] == [1, 2]


@pytest.mark.parametrize("method", ["sobol", "latin", "random"])
def test_correlated_normals_have_their_moments(method: str) -> None:
    plan = load_plan({
        "task": "run", "parameters": {"a": NORMAL, "b": NORMAL}, "correlation": {"a,b": 0.8},
        "sampling": {"method": method, "points": 4096, "seed": 3},
    })  # fmt: skip
    table = np.array([[p.values["a"], p.values["b"]] for p in plan.points()])
    # Independent points scatter most: 0.1/sqrt(4096) in the mean, 0.36/sqrt(4096) in the correlation; four times that.
    assert table.mean(axis=0) == pytest.approx([1, 1], abs=4 * 0.1 / 64)
    assert np.corrcoef(table.T)[0, 1] == pytest.approx(0.8, abs=4 * 0.36 / 64)


def test_a_plan_is_named_by_its_content() -> None:
    first = {"task": "run", "parameters": {"a": NORMAL}}
    assert load_plan(first).digest() == load_plan(dict(first)).digest()
    assert load_plan(first).digest() != load_plan({**first, "seeds": 2}).digest()
    assert load_plan(first).digest(b"a") != load_plan(first).digest(b"b")


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"parameters": {}}, "at least one"),
        ({"parameters": {"a": {"grid": []}}}, "give a list"),
        ({"parameters": {"a": {"distribution": "nrm"}}}, "'norm'"),
        ({"parameters": {"a": {"distribution": "norm", "lok": 1}}}, "norm"),
        ({"parameters": {"a": {"distribution": "norm", "scale": -1}}}, "check its arguments"),
        ({"parameters": {"a": {"values": [1]}, "b": {"values": [1, 2]}}}, "one length"),
        ({"sampling": {"method": "sobl"}}, "'sobol'"),
        ({"correlation": {"a,q": 0.5}}, "'q'"),
        ({"correlation": {"a,b": 1.5}}, "between -1 and 1"),
        ({"limits": {"y": [2, 1]}}, "low, high"),
        ({"seeds": [-1]}, "seed"),
        ({"task": 3}, "task is missing"),
        ({"paramters": {}}, "'parameters'"),
    ],
)
def test_what_is_wrong_is_said(change: dict, said: str) -> None:
    with pytest.raises(InputError, match=said):
        load_plan({"task": "run", "parameters": {"a": NORMAL, "b": NORMAL}, **change}).points()


@pytest.mark.parametrize("option", ["--simulate-scale", "--workers=1"])
def test_without_dask_the_extra_is_named(
    option: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "task.py").write_text("def half(a):\n    return a / 2\n")
    plan = tmp_path / "plan.toml"
    plan.write_text('format = 1\ntask = "task.py:half"\n[parameters.a]\ngrid = [1.0, 2.0]\n')
    with pytest.raises(SystemExit) as ended:
        main(["sweep", str(plan), option])
    assert ended.value.code == 2
    assert "gyrotwin[sweep]" in capsys.readouterr().err
