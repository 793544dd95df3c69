"""The WebAssembly component of an FMU (draft of fmi-ls-wasm): how an FMU announces it, and what else is in the FMU."""

import zipfile
from pathlib import Path

import fmpy
import pytest
from component_fmus import MODELS
from fmpy.validation import validate_fmu
from lxml import etree

from gyro_model import compiling, sensor_fmu
from gyro_model.build import Fmus, build_form, platforms_of
from gyro_model.errors import InputError
from gyro_model.platforms import COMPONENT, own_platform
from gyrotwin.commands.verify import verify

EXTRA = "extra/org.modelica.fmi-ls-wasm"


@pytest.mark.parametrize("name", MODELS)
def test_an_fmu_announces_its_component(name: str, folder: Path) -> None:
    path = folder / "fmi3" / f"{name}.fmu"
    assert platforms_of(path) == {COMPONENT.fmi3, own_platform()}
    schema = Path(fmpy.__file__).parent / "schema/fmi3/fmi3LayeredStandardManifest.xsd"
    with zipfile.ZipFile(path) as archive:
        for file in ("manifest.xml", "fmi-ls-manifest.xml"):
            root = etree.fromstring(archive.read(f"{EXTRA}/{file}"))
            etree.XMLSchema(etree.parse(schema)).assertValid(root)
            said = {key.partition("}fmi-ls-")[2]: value for key, value in root.attrib.items()}
            assert (said["name"], said["version"]) == ("org.modelica.fmi-ls-wasm", "0.1.0")
    assert validate_fmu(str(path)) == []
    if "fmi2" in MODELS[name].STANDARDS:
        assert COMPONENT.fmi3 not in platforms_of(folder / "fmi2" / f"{name}.fmu")


def test_an_importer_that_knows_no_component_runs_the_fmu(folder: Path) -> None:
    result = fmpy.simulate_fmu(str(folder / "fmi3" / "GyroscopeSensor.fmu"), stop_time=0.01, output_interval=1e-3)
    assert len(result) == 11


def test_the_rest_of_an_fmu_is_as_without_it(folder: Path, tmp_path: Path) -> None:
    name = "GyroscopeSensor"
    build_form(MODELS[name], tmp_path, platforms=[own_platform()])
    assert (tmp_path / f"fmi2/{name}.fmu").read_bytes() == (folder / f"fmi2/{name}.fmu").read_bytes()
    with zipfile.ZipFile(tmp_path / f"fmi3/{name}.fmu") as old, zipfile.ZipFile(folder / f"fmi3/{name}.fmu") as new:
        added = {f"binaries/{COMPONENT.fmi3}/{name}.wasm", f"{EXTRA}/manifest.xml", f"{EXTRA}/fmi-ls-manifest.xml"}
        assert set(new.namelist()) - set(old.namelist()) == added
        assert [one for one in old.namelist() if old.read(one) != new.read(one)] == []


def test_without_zig_it_says_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    find = compiling.importlib.util.find_spec
    monkeypatch.setattr(compiling.importlib.util, "find_spec", lambda name: None if name == "ziglang" else find(name))
    with pytest.raises(InputError, match=r"platform 'wasm32-wasip2': .* `pip install gyrotwin\[zig\]`"):
        build_form(MODELS["GyroscopeClocked"], tmp_path, platforms=[COMPONENT.fmi3])
    assert not list(tmp_path.rglob("*.fmu"))


def test_an_exported_sensor_has_none(folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    built = Fmus(*(folder / fmi / "GyroscopeSensor.fmu" for fmi in Fmus._fields))
    monkeypatch.setattr(sensor_fmu, "build", lambda model: built)
    path = sensor_fmu.write_sensor({"angle_random_walk": 1e-3}, tmp_path).fmi3
    assert platforms_of(path) == {own_platform()}
    with zipfile.ZipFile(path) as archive:
        assert not [name for name in archive.namelist() if name.startswith(EXTRA)]


def test_verify_says_that_it_plays_the_library(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    whole, bare = folder / "fmi3" / "GyroscopeSensor.fmu", tmp_path / "bare.fmu"
    verify(whole)
    assert f"Played: the library for {own_platform()}; not those for wasm32-wasip2." in capsys.readouterr().out
    with zipfile.ZipFile(whole) as old, zipfile.ZipFile(bare, "w") as new:
        for name in old.namelist():
            if own_platform() not in name:
                new.writestr(name, old.read(name))
    with pytest.raises(InputError, match=f"no library for {own_platform()}, this machine; there are wasm32-wasip2"):
        verify(bare)
