"""`gyrotwin diagnose` as a user types it: files, device and FMU of a small set with a known effect hidden in it."""

import json
import tomllib
from collections.abc import Callable
from dataclasses import replace
from io import StringIO
from pathlib import Path
from time import sleep
from types import SimpleNamespace
from typing import Any

import fmpy
import jsonschema
import numpy as np
import pytest
from cubic_case import HIDDEN, MODEL, QUINTIC, RATE, TRUE, Tables, exit_code, written
from fmpy.fmi2 import FMU2Slave
from fmpy.fmi3 import FMU3Slave
from rich.console import Console

import gyrotwin as gt
from discrepancy import diagnose as naming
from discrepancy.data.dataset import Dataset, load_dataset
from discrepancy.data.record import make_record
from discrepancy.fit.refit import Fitter
from discrepancy.fit.simulate import Simulator
from discrepancy.name.begin import believed
from discrepancy.name.search import Given, Search, nominal_of
from discrepancy.tell.answer import Value
from gyro_model.build import token_of
from gyro_model.device import load_device, write_device
from gyro_model.model import load_model
from gyrotwin.tasks import diagnose


def final_parameters(answer: SimpleNamespace) -> dict[str, float]:
    return dict(answer.found.parameters)


def test_the_files_and_nothing_else(answer: SimpleNamespace) -> None:
    names = sorted(path.name for path in answer.out.iterdir())
    assert names == ["device.toml", "fmi2.fmu", "fmi3.fmu", "report.html", "report.json"]


def test_report_json_has_the_keys_of_the_contract(answer: SimpleNamespace) -> None:
    report = json.loads((answer.out / "report.json").read_text(), parse_constant=pytest.fail)
    assert set(report) == {"verdict", "doubts", "left", "record", "effects", "immaterial", "noise", "misfit", "located",
                           "detectable", "criteria"}  # fmt: skip
    assert report["left"] < report["criteria"]["left"]
    assert report["record"] == []
    assert report["verdict"] == "missing effects"
    [effect] = report["effects"]
    assert effect["id"] == "cubic_stiffness"
    assert set(effect) <= {"id", "either", "probability", "parameters", "force_x", "force_y", "next_experiment"}
    assert 0.9 < effect["probability"] < 1
    assert set(effect["parameters"]["k3_x"]) == {"value", "low", "high", "unit"}
    assert effect["parameters"]["k3_x"]["unit"] == "N/m3"
    four = {"nominal", "refit", "final", "noise_floor"}
    assert set(report["misfit"]) == {*four, "runs"}
    assert set(report["misfit"]["runs"]) == {"run-2.parquet"}
    assert set(report["misfit"]["runs"]["run-2.parquet"]) == four
    assert report["located"]
    for place in report["located"]:
        assert set(place) == {"run", "channel", "t", "f", "condition", "share"}


def test_report_and_device_follow_their_schemas(answer: SimpleNamespace) -> None:
    report = json.loads((answer.out / "report.json").read_text(encoding="utf-8"))
    jsonschema.validate(report, gt.schema("report"))
    jsonschema.validate(tomllib.loads((answer.out / "device.toml").read_text(encoding="utf-8")), gt.schema("device"))


def test_device_file_comes_back_to_the_last_bit(answer: SimpleNamespace, tmp_path: Path) -> None:
    device = load_device(str(answer.out / "device.toml"))
    assert {n: v for n, v in device.parameters.items() if n in final_parameters(answer)} == final_parameters(answer)
    assert set(HIDDEN) <= set(device.intervals)
    assert device.name == "cubic"
    write_device(device, tmp_path / "again.toml")
    assert load_device(str(tmp_path / "again.toml")) == device


def test_the_device_runs_in_the_loop(answer: SimpleNamespace, tmp_path: Path) -> None:
    device = str(answer.out / "device.toml")
    out = str(tmp_path / "out")
    # 10 ms are too short for the flag: what was found is the plant and the design, and the files are there.
    run = ("run", "constant", "--device", device, "--design", device, "--duration", "0.01", "--out", out)
    assert exit_code(*run) == 3
    assert "cubic_stiffness" in json.loads((tmp_path / "out" / "summary.json").read_text())["run"]["effects"]


@pytest.mark.parametrize(("file", "slave"), [("fmi2.fmu", FMU2Slave), ("fmi3.fmu", FMU3Slave)])
def test_the_fmu_is_the_fitted_model_with_nothing_set(
    answer: SimpleNamespace, file: str, slave: Any, tmp_path: Path, residual: Callable[[str, float, float], None]
) -> None:
    record = load_dataset(answer.data).held_out[0]
    with Simulator(MODEL, jobs=1) as simulator:
        expected = simulator.run(record, final_parameters(answer))[:600]
    got = stepped(answer.out / file, slave, record.u[:600], tmp_path)
    # The same C with the same numbers: only the decimal text of the start values lies between, which is exact.
    residual("voltage", np.abs(got - expected).max() / np.abs(expected).max(), 1e-12)


def stepped(path: Path, slave: Any, u: np.ndarray, folder: Path) -> np.ndarray:
    """V_x, v_y (n, 2) of an FMU that is only loaded and run."""
    description = fmpy.read_model_description(path)
    references = {variable.name: variable.valueReference for variable in description.modelVariables}
    fmu = slave(
        guid=description.guid or description.instantiationToken,
        unzipDirectory=fmpy.extract(path, folder / "unzipped"),
        modelIdentifier=description.coSimulation.modelIdentifier,
        instanceName="improved",
    )
    fmu.instantiate()
    if slave is FMU2Slave:
        fmu.setupExperiment(startTime=0.0)
        fmu.enterInitializationMode()
        put, get = fmu.setReal, fmu.getReal
    else:
        fmu.enterInitializationMode(startTime=0.0)
        put, get = fmu.setFloat64, fmu.getFloat64
    inputs, outputs = ([references[f"{kind}_{axis}"] for axis in "xy"] for kind in "uv")
    put(inputs, u[0].tolist())
    fmu.exitInitializationMode()
    v = [get(outputs)]
    for k in range(len(u) - 1):
        put(inputs, u[k].tolist())
        fmu.doStep(k / RATE, 1 / RATE)
        v.append(get(outputs))
    fmu.terminate()
    fmu.freeInstance()
    return np.array(v)


def test_terminal_table(answer: SimpleNamespace) -> None:
    for word in ("warning: ", "The model lacks cubic_stiffness", "k3_x", "±", "nominal", "noise floor", "report.html"):
        assert word in answer.terminal, word


@pytest.fixture
def stored(answer: SimpleNamespace, monkeypatch: pytest.MonkeyPatch) -> None:
    """The search gives what it gave before, without the search."""
    monkeypatch.setattr(naming, "diagnose", lambda _, model, **__: replace(answer.found, model=model))


def test_further_effect_files_go_into_the_fmu(
    answer: SimpleNamespace, runs: Tables, stored: None, tmp_path: Path
) -> None:
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "quintic.py").write_text(QUINTIC)
    out = tmp_path / "out"
    assert exit_code("diagnose", str(answer.data), "--effects", str(tmp_path / "mine"), "--out", str(out)) == 0
    assert (out / "effects" / "quintic.py").read_text() == QUINTIC
    variables = {variable.name for variable in fmpy.read_model_description(out / "fmi2.fmu").modelVariables}
    assert "k5" in variables
    assert token_of(out / "fmi3.fmu") == token_of(out / "fmi2.fmu") != token_of(answer.out / "fmi2.fmu")


def test_nominal_may_name_a_parameter_of_a_further_effect(
    runs: Tables, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "quintic.py").write_text(QUINTIC)
    model = load_model(tmp_path / "mine")
    data = written(tmp_path / "data", runs, nominal={**TRUE, "k5": 1e18})
    dataset, _ = diagnose.load_nominal(diagnose.Request(data, tmp_path / "out"), model)
    assert dataset.nominal["k5"] == 1e18
    with Simulator(model, jobs=1) as simulator:
        # What the lab believes to be there is fitted, and not looked for.
        fitted = believed(model, dataset, nominal_of(model, dataset))
        assert [free.name for free in fitted] == ["k5"]
        whole = Fitter(simulator, dataset.fit)
        assert "quintic" in Search.of(Given(dataset), dataset, whole, whole.begin(dataset.nominal, fitted)).present
    assert exit_code("diagnose", str(data), "--out", str(tmp_path / "out")) == 2
    assert "parameter 'k5' is unknown" in capsys.readouterr().err
    wrong = written(tmp_path / "wrong", runs, nominal={**TRUE, "k55": 1e18})
    mine = ("--effects", str(tmp_path / "mine"), "--out", str(tmp_path / "out"))
    assert exit_code("diagnose", str(wrong), *mine) == 2
    assert "did you mean 'k5'" in capsys.readouterr().err


def test_a_device_replaces_the_nominal_values(runs: Tables, tmp_path: Path) -> None:
    data = written(tmp_path / "data", runs, nominal={"sense_gain_x": 1e6, "sense_gain_y": 1e6, "kxx": 60.0})
    request = diagnose.Request(data, tmp_path / "out", device="reference")
    dataset, notes = diagnose.load_nominal(request, MODEL)
    assert dataset.nominal["kxx"] == TRUE["kxx"]
    # The reference device has noise; a fit simulates without.
    assert "sense_noise" not in dataset.nominal
    assert notes == ["device reference replaces the nominal kxx of the data set"]


def test_what_a_one_axis_record_gives() -> None:
    t = np.arange(200) / RATE
    records = tuple(
        make_record(n, t, np.sin(t * 2e4), np.cos(t * 2e4), role=r) for n, r in (("a", "fit"), ("b", "held-out"))
    )
    data = Dataset(Path(), {"m": 1e-7, "kxx": 50.0, "dxx": 1e-6, "sense_gain_x": 2e6}, records)
    value = Value(51.0, 50.0, 52.0, "N/m")
    found = SimpleNamespace(device={"kxx": value}, noise={}, parameters={**data.nominal, "kxx": 51.0})
    device = diagnose.improved_device("one", data, MODEL, found)  # type: ignore[arg-type]
    p = device.all_parameters
    assert (p["kyy"], p["dyy"], p["sense_gain_y"], p["kxy"], p["dxy"]) == (51.0, 1e-6, 2e6, 0.0, 0.0)
    assert device.intervals == {"kxx": (50.0, 52.0)}
    started = diagnose.improved_model(data, MODEL, device)
    assert dict(started.starts)["sample_period"] == 1 / records[0].sample_rate


def test_a_log_hears_of_a_step_that_takes_long(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(diagnose, "QUIET", 0.02)
    out = Console(file=StringIO(), force_terminal=False)
    with diagnose.steps_shown(out) as progress:
        progress("a long step")
        sleep(0.2)
    said = out.file.getvalue().splitlines()  # type: ignore[attr-defined]
    assert said[0] == "· a long step"
    assert "· still at it, for 0 s" in said[1:]
