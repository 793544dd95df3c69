"""Reference traces inside the FMUs: as the layered standard says, replayed by this program and by FMPy alone."""

import zipfile
from pathlib import Path
from xml.etree import ElementTree as ET

import fmpy
import numpy as np
import pytest
from lxml import etree

from gyro_model.build import build
from gyro_model.envelope import envelope_model
from gyro_model.errors import InputError
from gyro_model.experiments import EXPERIMENTS, FOLDER, read_experiments, verify
from gyro_model.form import Form
from gyro_model.model import load_model
from gyro_model.sensor import SensorModel

MODELS: dict[str, Form] = {"full": load_model(), "envelope": envelope_model(), "sensor": SensorModel()}
COUNTS = {"full": 7, "envelope": 2, "sensor": 3}
CASES = [(form, fmi) for form in MODELS for fmi in ("fmi2", "fmi3")]
every_fmu = pytest.mark.parametrize(("form", "fmi"), CASES, ids=["-".join(case) for case in CASES])
LS = "{http://fmi-standard.org/fmi-ls-manifest}"


def path_of(form: str, fmi: str) -> Path:
    return Path(getattr(build(MODELS[form]), fmi))


@every_fmu
def test_an_fmu_meets_what_it_brings(form: str, fmi: str) -> None:
    residuals = verify(path_of(form, fmi))
    assert len({r.experiment for r in residuals}) == COUNTS[form]
    assert [r for r in residuals if not r.met] == []
    assert all(r.allowed.reason for r in residuals)


@every_fmu
def test_the_manifest_is_as_the_layered_standard_says(form: str, fmi: str) -> None:
    with zipfile.ZipFile(path_of(form, fmi)) as archive:
        root = ET.fromstring(archive.read(f"{FOLDER}/fmi-ls-manifest.xml"))
        files = {name.removeprefix(f"{FOLDER}/") for name in archive.namelist() if name.startswith(FOLDER)}
        experiments = read_experiments(lambda name: archive.read(f"{FOLDER}/{name}"))
        schema = Path(fmpy.__file__).parent / "ssp/schema/SystemStructureParameterValues.xsd"
        for e in experiments:
            text = etree.fromstring(archive.read(f"{FOLDER}/{e.name}.ssv"))
            etree.XMLSchema(etree.parse(schema)).assertValid(text)
    assert root.get(f"{LS}fmi-ls-name") == "org.fmi-standard.fmi-ls-ref"
    [related] = root.findall("Related")
    assert (related.get("role"), related.get("source")) == ("experiment/validation", EXPERIMENTS)
    assert related.get("type") == "application/x-ma-hs-experiments"
    named = {f"{e.name}{end}" for e in experiments for end in (".ssv", "_in.csv", "_ref.csv")}
    assert files == named | {"fmi-ls-manifest.xml", EXPERIMENTS}


@pytest.mark.parametrize("form", MODELS)
def test_fmpy_replays_them_by_itself(form: str, tmp_path: Path) -> None:
    path = path_of(form, "fmi3")
    with zipfile.ZipFile(path) as archive:
        experiments = read_experiments(lambda name: archive.read(f"{FOLDER}/{name}"))
        archive.extractall(tmp_path)
    for e in experiments[:3]:
        references = fmpy.read_csv(str(tmp_path / FOLDER / f"{e.name}_ref.csv"))
        step = e.time[1] - e.time[0]
        result = fmpy.simulate_fmu(
            str(path),
            start_values=dict(e.parameters),
            input=fmpy.read_csv(str(tmp_path / FOLDER / f"{e.name}_in.csv")),
            output=list(e.outputs),
            stop_time=e.time[-1],
            output_interval=step,
            step_size=step,
        )
        for name in e.outputs:
            off = np.max(np.abs(result[name] - references[name])) / np.max(np.abs(references[name]))
            assert off <= e.tolerances[name].relative, (e.name, name)


def test_a_wrong_fmu_is_found_out(tmp_path: Path) -> None:
    # The same FMU with another mass by default shows nothing: traces say every nominal parameter. One with another
    # reference does.
    source, changed = path_of("full", "fmi3"), tmp_path / "changed.fmu"
    with zipfile.ZipFile(source) as old, zipfile.ZipFile(changed, "w") as new:
        for item in old.infolist():
            data = old.read(item)
            if item.filename.endswith("plain_ref.csv"):
                rows = data.decode().splitlines()
                cells = rows[80].split(",")
                cells[1] = repr(float(cells[1]) + 1e-6)
                data = "\n".join([*rows[:80], ",".join(cells), *rows[81:]]).encode()
            new.writestr(item, data)
    off = [r for r in verify(changed) if not r.met]
    assert [(r.experiment, r.output) for r in off] == [("plain", "v_x")]
    assert 1e-7 < off[0].found < 1e-5


def test_what_can_not_be_replayed_is_said(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="not a readable FMU"):
        verify(tmp_path / "absent.fmu")
    bare = tmp_path / "bare.fmu"
    with zipfile.ZipFile(path_of("full", "fmi3")) as old, zipfile.ZipFile(bare, "w") as new:
        for item in old.infolist():
            if not item.filename.startswith("extra/"):
                new.writestr(item, old.read(item))
    with pytest.raises(InputError, match=r"experiments\.exp"):
        verify(bare)
    with pytest.raises(InputError, match="not experiments"):
        read_experiments(lambda name: b"no xml")
    files = {EXPERIMENTS: b"<Experiments><Experiment name='a'><Stimuli source='a'/></Experiment></Experiments>"}
    with pytest.raises(InputError):
        read_experiments(files.__getitem__)


def test_an_fmu_that_starts_as_another_device_brings_none(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from gyro_model import build as building

    monkeypatch.setattr(building, "compile_library", lambda sources, files, library, *_: library.write_bytes(b""))
    path = build(load_model().starting_at({"k3_x": 1e9}), tmp_path).fmi3
    assert not [name for name in zipfile.ZipFile(path).namelist() if name.startswith("extra/")]
