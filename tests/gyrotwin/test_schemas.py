"""JSON Schemas: they accept what the program reads and writes, and refuse what it refuses by name or type."""

import json
import tomllib
from pathlib import Path
from typing import Any

import jsonschema
import pytest

import gyrotwin as gt
from cosim.design import packaged_designs
from cosim.scenarios.files import packaged_scenarios
from discrepancy.criteria import Criteria
from discrepancy.tell.fleet import Estimate, Row, fleet
from discrepancy.tell.limits import Limits
from gyro_model.device import load_device, packaged_devices
from gyro_model.errors import InputError
from gyrotwin.schemas import schemas


def check(name: str, content: Any) -> None:
    """Raises ValidationError where ``content`` is none of the format."""
    jsonschema.validate(content, gt.schema(name), jsonschema.Draft202012Validator)


def read(path: Path) -> Any:
    return tomllib.loads(path.read_text(encoding="utf-8"))


PACKAGED = [
    *(("device", path) for path in packaged_devices().values()),
    *(("design", path) for path in packaged_designs().values()),
    *(("scenario", path) for path in packaged_scenarios().values()),
]


@pytest.mark.parametrize("name", schemas())
def test_it_is_a_schema(name: str) -> None:
    jsonschema.Draft202012Validator.check_schema(gt.schema(name))
    assert json.loads(json.dumps(gt.schema(name), allow_nan=False)) == gt.schema(name)


@pytest.mark.parametrize(("name", "path"), PACKAGED, ids=lambda value: getattr(value, "stem", value))
def test_packaged_files_are_accepted(name: str, path: Path) -> None:
    check(name, read(path))


def test_what_a_run_writes_is_accepted(tmp_path: Path) -> None:
    folder = gt.run("constant", seed=7, duration=0.05).save(tmp_path / "run")
    check("summary", json.loads((folder / "summary.json").read_text(encoding="utf-8")))
    check("design", read(folder / "design.toml"))


def test_a_data_set_is_accepted(tmp_path: Path) -> None:
    dataset = gt.simulate_dataset(tmp_path / "set", runs=2, samples=1000)
    check("dataset", read(dataset.folder / "dataset.toml"))


def test_defaults_of_the_criteria_are_accepted() -> None:
    check("criteria", {name: found["default"] for name, found in gt.schema("criteria")["properties"].items()})
    assert set(gt.schema("criteria")["properties"]) == set(Criteria.__dataclass_fields__)


def test_limits_are_accepted_as_the_program_reads_them() -> None:
    given = {"force_x": 1e-6, "longest": 0.5, "v_bias": [0.0, 12.0], "omega_z": [0, 0]}
    check("limits", given)
    Limits.of(given)
    assert set(gt.schema("limits")["properties"]) == set(Limits.__dataclass_fields__)
    with pytest.raises(jsonschema.ValidationError):
        check("limits", {"v_bias": 12.0})


def test_a_fleet_with_a_population_is_accepted() -> None:
    sizes = (1.0, 1.1, 0.9, 1.05, 0.95, 1.02, 0.98, 1.0, 1.04, 0.96, 0.99, 7.0)
    rows = [Row(f"die-{k}", "named", effects={"cubic_stiffness": ("k3_x",)}, values={"k3_x": Estimate(x, 0.01, "N/m3")})
            for k, x in enumerate(sizes)]  # fmt: skip
    found = fleet(
        [*rows, Row("die-9", error="no data")], {"x [mm]": {row.name: float(k) for k, row in enumerate(rows)}}
    )
    assert found.spreads and found.outliers
    check("fleet", json.loads(json.dumps(found.report())))


WRONG = {
    "unknown key": 'format = 1\nname = "a"\n[paramters]\nkxx = 60.0\n',
    "unknown parameter": 'format = 1\nname = "a"\n[parameters]\nkxz = 60.0\n',
    "a text for a number": 'format = 1\nname = "a"\n[parameters]\nkxx = "60"\n',
    "out of bounds": 'format = 1\nname = "a"\n[parameters]\nm = -1.0\n',
    "another format": 'format = 2\nname = "a"\n',
    "no name": "format = 1\n",
    "half an interval": 'format = 1\nname = "a"\n[intervals]\nkxx = [60.0]\n',
}


@pytest.mark.parametrize("what", WRONG)
def test_what_it_refuses_the_program_refuses(what: str, tmp_path: Path) -> None:
    path = tmp_path / "device.toml"
    path.write_text(WRONG[what], encoding="utf-8")
    with pytest.raises(jsonschema.ValidationError):
        check("device", read(path))
    with pytest.raises(InputError):
        load_device(str(path))


@pytest.mark.parametrize("kind", ["sawtooth", "sine"])
def test_a_course_has_the_keys_of_its_kind(kind: str) -> None:
    content = {"format": 1, "name": "a", "description": "b", "duration": 1.0, "omega_z": {"kind": kind, "value": 1.0}}
    with pytest.raises(jsonschema.ValidationError):
        check("scenario", content)


def test_a_plan_says_how_a_parameter_varies() -> None:
    good = {"task": "run", "parameters": {"k3_x": {"distribution": "norm", "loc": 0.0, "scale": 1e9}}}
    check("plan", good)
    with pytest.raises(jsonschema.ValidationError):
        check("plan", {"task": "run", "parameters": {"k3_x": {"grid": [1.0], "values": [1.0]}}})


def test_a_mistyped_format_gets_the_nearest() -> None:
    with pytest.raises(InputError, match="did you mean 'device'"):
        gt.schema("devise")
