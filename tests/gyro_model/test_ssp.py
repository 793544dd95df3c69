"""The system structure package: valid, and each device's parameter set is that device."""

import zipfile
from pathlib import Path
from xml.etree import ElementTree as ET

import fmpy
import pytest
from lxml import etree

from gyro_model.build import build
from gyro_model.device import load_device, packaged_devices
from gyro_model.experiments import SSV
from gyro_model.model import load_model
from gyro_model.ssp import SSD, build_ssp

SCHEMAS = Path(fmpy.__file__).parent / "ssp" / "schema"


@pytest.fixture(scope="module")
def package(tmp_path_factory: pytest.TempPathFactory) -> zipfile.ZipFile:
    return zipfile.ZipFile(build_ssp(build().fmi3, tmp_path_factory.mktemp("ssp") / "Gyroscope.ssp"))


def test_every_file_is_valid(package: zipfile.ZipFile) -> None:
    kinds = {".ssd": "SystemStructureDescription.xsd", ".ssv": "SystemStructureParameterValues.xsd"}
    seen = 0
    for name in package.namelist():
        if (schema := kinds.get(Path(name).suffix)) is not None:
            # FMPy brings the schemas of 1.0, whose elements these are; 2.0 changed none of them.
            text = package.read(name).replace(b'version="2.0"', b'version="1.0"')
            etree.XMLSchema(etree.parse(SCHEMAS / schema)).assertValid(etree.fromstring(text))
            seen += 1
    assert seen == 2 * len(packaged_devices()) + 1


def test_default_is_the_reference_device(package: zipfile.ZipFile) -> None:
    assert package.read("SystemStructure.ssd") == package.read("reference.ssd")


@pytest.mark.parametrize("name", packaged_devices())
def test_a_structure_names_what_is_there(package: zipfile.ZipFile, name: str) -> None:
    root = ET.fromstring(package.read(f"{name}.ssd"))
    assert root.get("version") == "2.0"
    sources = [e.attrib["source"] for e in root.iter() if "source" in e.attrib]
    assert sources == ["resources/Gyroscope.fmu", f"resources/{name}.ssv"]
    assert set(sources) <= set(package.namelist())
    connectors = [e.attrib["name"] for e in root.iter(f"{{{SSD}}}Connector")]
    own = [q.name for q in load_model().quantities if q.role in ("input", "output")]
    assert connectors == [*own, *own]
    assert len(list(root.iter(f"{{{SSD}}}Connection"))) == len(own)


@pytest.mark.parametrize("name", packaged_devices())
def test_a_parameter_set_is_the_device_to_the_last_bit(package: zipfile.ZipFile, name: str) -> None:
    device = load_device(name)
    root = ET.fromstring(package.read(f"resources/{name}.ssv"))
    found = {e.attrib["name"]: float(e[0].attrib["value"]) for e in root.iter(f"{{{SSV}}}Parameter")}
    assert found == device.all_parameters


def test_equal_packages_are_equal_files(tmp_path: Path) -> None:
    fmu = build().fmi2
    assert build_ssp(fmu, tmp_path / "a.ssp").read_bytes() == build_ssp(fmu, tmp_path / "b.ssp").read_bytes()
