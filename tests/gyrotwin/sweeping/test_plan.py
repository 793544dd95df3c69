"""Points of a plan: grids, lists, distributions, correlation; and what is refused."""

import sys
import tomllib
from pathlib import Path

import jsonschema
import numpy as np
import pytest

import gyrotwin as gt
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


def test_a_plan_is_another_with_another_version_or_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    own = tmp_path / "effects" / "a.py"
    own.parent.mkdir()
    given = {"task": "run", "parameters": {"device": {"grid": [str(tmp_path / "a.toml"), "reference"]}},
             "fixed": {"effects": [str(own.parent)], "note": "x" * 5000}}  # fmt: skip
    names = {load_plan(given).digest()}
    for path in (tmp_path / "a.toml", own):
        path.write_text("1")
        names.add(load_plan(given).digest())
    monkeypatch.setattr("gyrotwin.sweeping.plan.__version__", "0.0.1")
    names.add(load_plan(given).digest())
    assert len(names) == 4


def test_names_with_dots_need_no_quotes(tmp_path: Path) -> None:
    path = tmp_path / "plan.toml"
    path.write_text(
        'task = "run"\n[parameters]\ndesigner.q = {grid = [1e3, 2e3]}\nangle.unit.kind = {values = [1, 2]}\n'
        "[parameters.k3_x]\ngrid = [0.0]\n[limits]\nangle.rms_deg = [0, 1]\nomega.rms_error = [0, 2]\n"
    )
    plan = load_plan(path)
    assert list(plan.parameters) == ["designer.q", "angle.unit.kind", "k3_x"]
    assert plan.limits == {"angle.rms_deg": [0, 1], "omega.rms_error": [0, 2]}
    jsonschema.validate(tomllib.loads(path.read_text()), gt.schema("plan"))


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
