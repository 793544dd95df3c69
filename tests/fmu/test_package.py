"""What an FMU holds beside its code: description, documentation, licence, icon, terminals; and that it is valid."""

import struct
import zipfile
import zlib
from math import isclose
from pathlib import Path
from xml.etree import ElementTree as ET

import fmpy
import pytest
from fmpy.validation import validate_fmu
from lxml import etree

from gyro_model import RELEASED, VERSION
from gyro_model import build as building
from gyro_model.build import build
from gyro_model.envelope import envelope_model
from gyro_model.form import Form
from gyro_model.model import load_model
from gyro_model.sensor import SensorModel
from gyro_model.units import MEASURED

MODELS: dict[str, Form] = {"full": load_model(), "envelope": envelope_model(), "sensor": SensorModel()}
SCHEMAS = Path(fmpy.__file__).parent / "schema"
CASES = [(form, fmi) for form in MODELS for fmi in ("fmi2", "fmi3")]
every_fmu = pytest.mark.parametrize(("form", "fmi"), CASES, ids=["-".join(case) for case in CASES])


def archive(form: str, fmi: str) -> zipfile.ZipFile:
    return zipfile.ZipFile(getattr(build(MODELS[form]), fmi))


def description(form: str, fmi: str) -> ET.Element:
    return ET.fromstring(archive(form, fmi).read("modelDescription.xml"))


def validate(text: bytes, schema: Path) -> None:
    etree.XMLSchema(etree.parse(schema)).assertValid(etree.fromstring(text))


@every_fmu
def test_nothing_is_found_at_fault(form: str, fmi: str) -> None:
    assert validate_fmu(str(getattr(build(MODELS[form]), fmi))) == []
    with archive(form, fmi) as files:
        validate(files.read("modelDescription.xml"), SCHEMAS / fmi / f"{fmi}ModelDescription.xsd")
        if fmi == "fmi3":
            validate(files.read("terminalsAndIcons/terminalsAndIcons.xml"), SCHEMAS / "fmi3/fmi3TerminalsAndIcons.xsd")
            validate(files.read("sources/buildDescription.xml"), SCHEMAS / "fmi3/fmi3BuildDescription.xsd")


@every_fmu
def test_it_says_who_when_and_under_which_licence(form: str, fmi: str) -> None:
    root = description(form, fmi)
    assert root.get("version") == VERSION and root.get("generationTool") == f"gyrotwin {VERSION}"
    assert root.get("author") and root.get("license") == "MIT" and root.get("copyright", "").startswith("Copyright")
    assert root.get("generationDateAndTime") == RELEASED
    assert "MIT License" in archive(form, fmi).read("documentation/licenses/license.txt").decode()


def test_the_date_is_that_of_the_release_or_of_who_builds(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(building, "compile_library", lambda sources, files, library, *_: library.write_bytes(b""))
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "1000000000")
    first = build(folder=tmp_path).fmi3.read_bytes()
    token = building.token_of(tmp_path / "fmi3/Gyroscope.fmu")
    assert b"2001-09-09T01:46:40Z" in zipfile.ZipFile(tmp_path / "fmi3/Gyroscope.fmu").read("modelDescription.xml")
    assert build(folder=tmp_path, force=True).fmi3.read_bytes() == first
    monkeypatch.delenv("SOURCE_DATE_EPOCH")
    build(folder=tmp_path, force=True)
    assert building.token_of(tmp_path / "fmi3/Gyroscope.fmu") == token, "the date names no other model"


@every_fmu
def test_every_variable_has_what_a_tool_shows(form: str, fmi: str) -> None:
    root, model = description(form, fmi), MODELS[form]
    shown = {unit.get("name"): {d.get("name"): d for d in unit.findall("DisplayUnit")} for unit in root.iter("Unit")}
    for element in root.find("ModelVariables") or ():
        assert element.get("description")
        if element.get("name") not in model.by_name:
            continue
        quantity, typed = model.by_name[element.get("name", "")], element[0] if fmi == "fmi2" else element
        if not quantity.integer:
            assert float(typed.get("nominal", 0)) == quantity.typical > 0.0
        if quantity.display:
            assert typed.get("displayUnit") == quantity.display in shown[quantity.unit]
    mechanical = set() if form == "sensor" else {"µm", "µN"}
    assert {"deg/s", "degC"} | mechanical <= {name for units in shown.values() for name in units}
    for unit, displays in shown.items():
        for name, display in displays.items():
            # Back from what is shown is what tables may be in, where both know the unit.
            if (known := MEASURED.get(unit, {}).get(name)) is not None:
                factor, offset = float(display.get("factor", 1)), float(display.get("offset", 0))
                assert isclose(factor * known.factor, 1.0) and isclose(known.offset, -offset / factor)


@every_fmu
def test_documentation_names_every_variable_and_effect(form: str, fmi: str) -> None:
    page = archive(form, fmi).read("documentation/index.html").decode()
    root = etree.fromstring(page.replace("<!DOCTYPE html>", "").replace('<meta charset="utf-8">', ""))
    codes = {element.text for element in root.iter("code")}
    model = MODELS[form]
    assert {q.name for q in model.quantities} | {e.id for e in model.effects} <= codes
    text = " ".join("".join(root.itertext()).split())
    for effect in model.effects:
        assert effect.doc.split("\n")[0].strip() in text
    for paragraph in model.CONVENTIONS:
        assert paragraph in text


@every_fmu
def test_icon(form: str, fmi: str) -> None:
    with archive(form, fmi) as files:
        png = files.read("model.png" if fmi == "fmi2" else "terminalsAndIcons/icon.png")
        assert png.startswith(b"\x89PNG\r\n\x1a\n")
        width, height = struct.unpack(">2I", png[16:24])
        at = png.index(b"IDAT")
        [length] = struct.unpack(">I", png[at - 4 : at])
        assert len(zlib.decompress(png[at + 4 : at + 4 + length])) == height * (1 + 4 * width)
        if fmi == "fmi3":
            assert etree.fromstring(files.read("terminalsAndIcons/icon.svg")).get("viewBox") == f"0 0 {width} {height}"


@pytest.mark.parametrize("form", MODELS)
def test_every_input_and_output_has_a_terminal(form: str) -> None:
    root = ET.fromstring(archive(form, "fmi3").read("terminalsAndIcons/terminalsAndIcons.xml"))
    members = [member.get("variableName") for member in root.iter("TerminalMemberVariable")]
    assert sorted(members) == sorted(q.name for q in MODELS[form].quantities if q.role in ("input", "output"))
    names = [terminal.get("name") for terminal in root.iter("Terminal")]
    assert names == [*([] if form == "sensor" else ["mechanical"]), "electrical", "inertial", "thermal"]
