"""The package as a library: public names, typed and documented; results that save the files of the commands."""

import doctest
import importlib
import inspect
import pkgutil
import subprocess
import sys
import typing
from pathlib import Path

import polars as pl
import pytest

import gyrotwin as gt
from gyrotwin import api
from gyrotwin.cli import COMMANDS

FUNCTIONS = [name for name in gt.__all__ if inspect.isfunction(getattr(gt, name))]


@pytest.fixture(scope="module")
def result() -> gt.RunResult:
    return gt.run("constant", device="reference", seed=7, duration=0.2)


def test_every_public_name_is_there_and_listed() -> None:
    assert dir(gt) == sorted(gt.__all__)
    assert all(getattr(gt, name) is not None for name in gt.__all__)
    with pytest.raises(AttributeError, match="no_such"):
        gt.no_such  # noqa: B018


@pytest.mark.parametrize(
    "module",
    [
        *(f"gyrotwin.api.{module.name}" for module in pkgutil.iter_modules(api.__path__)),
        "gyro_model.device",
        "gyrotwin.contract",
    ],
)
def test_examples_in_docstrings_run(module: str) -> None:
    found = doctest.testmod(importlib.import_module(module))
    assert found.attempted > 0
    assert found.failed == 0


@pytest.mark.parametrize("name", FUNCTIONS)
def test_docstrings_explain_every_argument_what_is_returned_and_what_is_raised(name: str) -> None:
    function = getattr(gt, name)
    doc = inspect.getdoc(function) or ""
    head, _, rest = doc.partition("Parameters\n----------\n")
    assert head.strip()
    assert "Returns\n-------" in rest
    assert "Raises\n------" in rest
    explained = rest.partition("Returns\n")[0]
    for parameter in inspect.signature(function).parameters.values():
        assert parameter.name in explained, f"{name}: {parameter.name}"
        assert parameter.annotation is not inspect.Parameter.empty


def test_a_user_s_strict_type_check_passes(tmp_path: Path) -> None:
    script = tmp_path / "use.py"
    script.write_text(
        "import gyrotwin as gt\n"
        'run = gt.run("constant", device=gt.load_device("reference"), seed=7)\n'
        "height: int = run.trace.height\n"
        'found = gt.diagnose(gt.load_dataset("trial"))\n'
        "names: list[str] = [effect.id for effect in found.effects]\n"
        'again: gt.RunResult = gt.run("constant", design=found.design)\n'
    )
    command = [
        sys.executable,
        "-m",
        "mypy",
        "--strict",
        "--follow-imports=silent",
        "--cache-dir",
        str(tmp_path / "cache"),
        str(script),
    ]
    done = subprocess.run(command, capture_output=True, text=True, cwd=Path(gt.__file__).parents[1])
    assert done.returncode == 0, done.stdout


@pytest.mark.parametrize("command", ["run", "rate", "split", "compensate", "diagnose", "build"])
def test_a_command_offers_what_its_function_takes(command: str) -> None:
    """A command adds files to write and the like; it leaves out nothing but callbacks and what --set and --out say."""
    module, _, name = COMMANDS[command].place.partition(":")
    options = set(inspect.signature(getattr(importlib.import_module(module), name)).parameters)
    renamed = {"parameters": "settings", "columns": "column", "checkpoint": "out", "folder": "out"}
    library = {renamed.get(p, p) for p in inspect.signature(getattr(api, command)).parameters} - {"progress"}
    if command == "build":
        library -= {"device", "effects", "out"}
    assert library <= options


@pytest.mark.parametrize("name", COMMANDS)
def test_help_of_the_group_is_the_first_line_of_the_command_s_own(name: str) -> None:
    entry = COMMANDS[name]
    module, _, attribute = entry.place.partition(":")
    found = getattr(importlib.import_module(module), attribute)
    own = found.info.help if hasattr(found, "info") else (inspect.getdoc(found) or "").splitlines()[0]
    assert entry.help == own


def test_a_result_saves_what_the_command_writes(result: gt.RunResult, tmp_path: Path) -> None:
    folder = result.save(tmp_path / "out")
    names = ["design.toml", "report.html", "summary.json", "trace.parquet"]
    assert sorted(path.name for path in folder.iterdir()) == names
    assert pl.read_parquet(folder / "trace.parquet").equals(result.trace, null_equal=True)


def test_a_result_shows_itself_in_a_notebook(result: gt.RunResult) -> None:
    html = result._repr_html_()
    assert "<table>" in html
    assert "constant, seed 7" in html
    assert len(result.figures()) >= 6
    assert [line.split(":")[0] for line in str(result).splitlines()][:2] == ["scenario", "device, design"]


def test_a_device_of_one_s_own_runs_with_a_design_from_itself() -> None:
    device = gt.Device.from_designer(frequency=3000, split=30, q=2000, mass=1e-7, noise=2e-5)
    told: list[tuple[float, float]] = []
    run = gt.run("constant", device=device, design=device, duration=0.1, progress=lambda *at: told.append(at))
    assert run.device.name == device.name
    assert told[-1] == pytest.approx((0.1, 0.1))
    # A device file without intervals: what it names is the first estimate.
    assert run.design.values["kxx"] == device.parameters["kxx"]


def test_an_object_and_its_file_give_the_same_bits(tmp_path: Path, result: gt.RunResult) -> None:
    by_object = gt.run("constant", device=gt.load_device("reference"), seed=7, duration=0.2)
    assert by_object.trace.equals(result.trace, null_equal=True)


def test_what_is_found_is_a_design_that_runs(tmp_path: Path) -> None:
    data = gt.simulate_dataset(tmp_path / "trial", hidden={"k3_x": 4e9, "k3_y": 4e9}, samples=4000)
    lines: list[str] = []
    found = gt.diagnose(data, max_effects=1, progress=lines.append)
    assert lines
    assert [effect.id for effect in found.effects] == ["cubic_stiffness"]
    assert found.misfit["final"] < found.misfit["refit"]
    run = gt.run("constant", device="reference", parameters={"k3_x": 4e9, "k3_y": 4e9}, design=found.design,
                 duration=0.1)  # fmt: skip
    assert "cubic_stiffness" in [e.id for e in run.design.known_model.dynamics.effects]
    saved = found.save(tmp_path / "out")
    assert {"device.toml", "report.html", "report.json", "fmi2.fmu", "fmi3.fmu"} <= {p.name for p in saved.iterdir()}
    assert gt.load_device(saved / "device.toml").parameters == found.device.parameters


def test_type_hints_of_public_functions_resolve() -> None:
    for name in FUNCTIONS:
        function = getattr(gt, name)
        namespace = vars(sys.modules[function.__module__]) | vars(gt) | {"Effect": object, "Residual": object}
        assert "return" in typing.get_type_hints(function, namespace)
