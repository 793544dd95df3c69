"""`gyrotwin diagnose` as a user types it: files, page, device and FMU of a small set with a known effect hidden in it;
wrong input as one line; an interrupted search."""

import io
import json
import re
import signal
import subprocess
import sys
import tomllib
from collections.abc import Callable, Iterator
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import fmpy
import jsonschema
import numpy as np
import polars as pl
import pytest
from fmpy.fmi2 import FMU2Slave
from fmpy.fmi3 import FMU3Slave
from rich.console import Console

import gyrotwin as gt
from discrepancy import diagnose as naming
from discrepancy.data.dataset import Dataset, load_dataset
from discrepancy.data.record import make_record
from discrepancy.fit.simulate import Simulator
from discrepancy.tell.answer import Diagnosis, Value
from gyro_model.build import Fmus, token_of
from gyro_model.device import load_device, write_device
from gyro_model.model import load_model
from gyrotwin import diagnosis_report
from gyrotwin.cli import main
from gyrotwin.interrupt import Interrupted
from gyrotwin.numbers import hertz, uncertain
from gyrotwin.tasks import diagnose

MODEL = load_model()
RATE = 200_000.0
SAMPLES = 4000
TRUE = {"m": 1.8e-7, "kxx": 63.955, "kyy": 95.92, "kxy": 12.779, "dxx": 1.8e-6, "dyy": 1.8e-6, "dxy": 3.6e-7,
        "sense_gain_x": 1e6, "sense_gain_y": 1e6}  # fmt: skip
HIDDEN = {"k3_x": 2e10, "k3_y": 2e10}
VOID = {"area", "base", "br", "col", "embed", "hr", "img", "input", "link", "meta", "source", "track", "wbr"}

Tables = dict[str, pl.DataFrame]


def tables() -> Tables:
    """Three runs of 20 ms of the reference device with a cubic spring, driven like noise over the modes."""
    rng = np.random.default_rng(4)
    t = np.arange(SAMPLES) / RATE
    made = {}
    with Simulator(MODEL, jobs=1) as simulator:
        for number in range(3):
            f = rng.uniform(200, 6000, (40, 2))
            u = 5e-6 * np.sin(2 * np.pi * f * t[:, None, None] + rng.uniform(0, 6.28, (40, 2))).sum(axis=1)
            blank = make_record("blank", t, u, np.ones_like(u), sample_rate=RATE)
            v = simulator.run(blank, {**TRUE, **HIDDEN, "sense_noise": 2e-5, "seed": 40 + number})
            columns = {"t": t, "u_x": u[:, 0], "u_y": u[:, 1], "v_x": v[:, 0], "v_y": v[:, 1]}
            made[f"run-{number}.parquet"] = pl.DataFrame(columns)
    return made


def written(folder: Path, runs: Tables, nominal: dict[str, float] | None = None, head: str = "format = 1") -> Path:
    """A data set folder; [nominal] is 1 % off."""
    folder.mkdir(parents=True)
    believed = {n: v * (1.01 if n in ("m", "kxx") else 1.0) for n, v in TRUE.items()} if nominal is None else nominal
    lines = [head, "[nominal]", *(f"{name} = {value!r}" for name, value in believed.items())]
    for name, table in runs.items():
        lines += ["[[run]]", f'file = "{name}"', f"sample_rate = {RATE}"]
        table.write_parquet(folder / name)
    (folder / "dataset.toml").write_text("\n".join(lines) + "\n")
    return folder


def exit_code(*arguments: str) -> int:
    with pytest.raises(SystemExit) as ending:
        main(list(arguments))
    return int(ending.value.code or 0)


@pytest.fixture(scope="module")
def runs() -> Tables:
    return tables()


@pytest.fixture(scope="module")
def answer(runs: Tables, tmp_path_factory: pytest.TempPathFactory) -> Iterator[SimpleNamespace]:
    """One diagnosis by the command: folder of the data, folder of the answer, the Diagnosis itself."""
    root = tmp_path_factory.mktemp("diagnosis")
    data = written(root / "cubic", runs)
    found: list[Diagnosis] = []
    terminal = io.StringIO()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(naming, "diagnose", kept(naming.diagnose, found))
        patch.setattr(diagnose, "console", Console(file=terminal, width=100))
        assert exit_code("diagnose", str(data), "--out", str(root / "out"), "--jobs", "1", "--max-effects", "2") == 0
    yield SimpleNamespace(data=data, out=root / "out", found=found[0], terminal=terminal.getvalue())


def kept(function: Callable[..., Any], results: list[Any]) -> Callable[..., Any]:
    def call(*arguments: Any, **options: Any) -> Any:
        results.append(function(*arguments, **options))
        return results[-1]

    return call


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


class Page(HTMLParser):
    """Open elements, ids, links and scripts; an element closed out of order is a fault."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.ids: set[str] = set()
        self.links: list[str] = []
        self.scripts: list[str] = []
        self.text = ""
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = dict(attrs)
        self.links += [str(given[k]) for k in ("src", "href", "data", "action") if k in given]
        if given.get("id"):
            self.ids.add(str(given["id"]))
        if tag not in VOID:
            self.open.append(tag)
        if tag == "script":
            self.scripts.append("")

    def handle_endtag(self, tag: str) -> None:
        assert self.open and self.open[-1] == tag, f"</{tag}> closes {self.open[-3:]}"
        self.open.pop()

    def handle_data(self, data: str) -> None:
        if self.open and self.open[-1] == "script":
            self.scripts[-1] += data
        else:
            self.text += data


@pytest.fixture(scope="module")
def page(answer: SimpleNamespace) -> Page:
    return Page((answer.out / "report.html").read_text(encoding="utf-8"))


def test_the_page_is_whole_and_needs_no_network(answer: SimpleNamespace, page: Page) -> None:
    assert page.open == []
    assert page.links == []
    outside = (answer.out / "report.html").read_text(encoding="utf-8").replace(page.scripts[0], "")
    assert not re.search(r"https?:|//\w+\.|@import|url\(", outside)
    # plotly-basic.min.js alone is 1.1 MB.
    assert (answer.out / "report.html").stat().st_size < 1.6e6


def test_the_page_shows_everything(answer: SimpleNamespace, page: Page) -> None:
    sections = {"effects", "misfit", "map", "located", "scores", "spectra", "parameters", "noise", "detectable"}
    assert sections <= page.ids
    for text in ("The model lacks cubic_stiffness", "F_x = -k3_x·x^3", "the last, run-2.parquet, is held out", "N/m³"):
        assert text in page.text, text
    data = json.loads(page.scripts[1], parse_constant=pytest.fail)
    assert {name: len(panels) for name, panels in data.items()} == {"misfit": 1, "map": 4, "scores": 1, "spectra": 2}
    bars = data["misfit"][0]
    assert bars["names"] == ["nominal", "refit", "+ cubic_stiffness"]
    assert bars["values"] == sorted(bars["values"], reverse=True)
    assert bars["values"][-1] == pytest.approx(bars["floor"], rel=0.1)
    gaps = json.loads((answer.out / "report.json").read_text())["misfit"]
    # The same simulations twice; the page rounds nothing here.
    assert bars["values"] == pytest.approx([gaps[key] for key in ("nominal", "refit", "final")], rel=1e-9)
    for panel in data["map"]:
        # Base64: four letters for three cells.
        assert len(panel["levels"]) == 4 * -(-len(panel["columns"]) * len(panel["rows"]) // 3)


def test_terminal_table(answer: SimpleNamespace) -> None:
    for word in ("warning: ", "The model lacks cubic_stiffness", "k3_x", "±", "nominal", "noise floor", "report.html"):
        assert word in answer.terminal, word


@pytest.fixture
def stored(answer: SimpleNamespace, monkeypatch: pytest.MonkeyPatch) -> None:
    """The search gives what it gave before, without the search."""
    monkeypatch.setattr(naming, "diagnose", lambda _, model, **__: replace(answer.found, model=model))


QUINTIC = '''"""Quintic stiffness. F_x = -k5 x^5 (a test)."""

from gyro_model.anatomy import Energy, Force, Limit
from gyro_model.quantities import size
from gyro_model.symbols import x

K5 = size("k5", "N/m5", "quintic stiffness")

EFFECT = Force(
    id="quintic",
    parameters=(K5,),
    force=(-K5.symbol * x**5, 0),
    energy=Energy(stored=K5.symbol * x**6 / 6),
    signature="resonance moves with the fourth power of the amplitude",
    host_experiment="drive level ramp",
    limits=(Limit(why="1e24 at 1 um", at={"k5": 1e24, "x": 1e-6}, gives={"force_x": -1e-6, "force_y": 0.0}),),
)
'''


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
        search = naming.Search(simulator, dataset, lambda _: None)
        # What the lab believes to be there is fitted, and not looked for.
        assert [free.name for free in search._believed()] == ["k5"]
        assert "quintic" in search.present
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


def test_nothing_is_written_through_a_link_in_the_folder(
    answer: SimpleNamespace, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "effects").symlink_to(tmp_path / "elsewhere")
    assert exit_code("diagnose", str(answer.data), "--out", str(tmp_path / "out")) == 2
    assert "is a link" in capsys.readouterr().err


def cut(runs: Tables) -> Tables:
    """The runs without fifty rows in the middle of the first."""
    first = runs["run-0.parquet"]
    return {**runs, "run-0.parquet": pl.concat([first[:2000], first[2050:]])}


def changed(runs: Tables, *expressions: pl.Expr) -> Tables:
    return {name: table.with_columns(*expressions) for name, table in runs.items()}


Fault = tuple[Callable[[Path, Tables], Path], list[str], str]

FAULTS: dict[str, Fault] = {
    "no folder": (lambda p, r: p / "none", [], "dataset init"),
    "format": (lambda p, r: written(p / "d", r, head="format = 2"), [], "format = 2"),
    "unknown nominal key": (lambda p, r: written(p / "d", r, {**TRUE, "kxxx": 1.0}), [], "'kxx'"),
    "lacking nominal": (lambda p, r: written(p / "d", r, {"kxx": 64.0}), [], "lacks m "),
    "no run": (lambda p, r: written(p / "d", {}), [], "no run"),
    "no run to fit": (lambda p, r: written(p / "d", {"a.parquet": r["run-0.parquet"]}), [], "no run to fit"),
    "missing column": (lambda p, r: written(p / "d", {n: t.drop("v_y") for n, t in r.items()}), [], "v_y"),
    "hole": (lambda p, r: written(p / "d", cut(r)), [], "hole"),
    "no number": (lambda p, r: written(p / "d", changed(r, pl.col("u_x").shift(1))), [], "u_x"),
    "wrong sign": (lambda p, r: written(p / "d", changed(r, -pl.col("v_x"), -pl.col("v_y"))), [], "sign"),
    "swapped": (
        lambda p, r: written(p / "d", changed(r, pl.col("v_y").alias("v_x"), pl.col("v_x").alias("v_y"))),
        [],
        "v_x and v_y",
    ),
    "millivolt": (lambda p, r: written(p / "d", changed(r, pl.col("v_x") * 1e3, pl.col("v_y") * 1e3)), [], "mV"),
    "time in ms": (lambda p, r: written(p / "d", changed(r, pl.col("t") * 1e3)), [], "ms"),
    "dead channel": (lambda p, r: written(p / "d", changed(r, pl.col("v_y") * 0)), [], "unconnected"),
    "device": (lambda p, r: written(p / "d", r), ["--device", "refrence"], "'reference'"),
    "effects": (lambda p, r: written(p / "d", r), ["--effects", "nowhere"], "nowhere"),
    "max effects": (lambda p, r: written(p / "d", r), ["--max-effects", "-1"], "--max-effects"),
    "jobs": (lambda p, r: written(p / "d", r), ["--jobs", "0"], "--jobs"),
}


@pytest.mark.parametrize("case", FAULTS)
def test_a_fault_is_one_line_and_exit_code_2(
    case: str, runs: Tables, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    make, options, expected = FAULTS[case]
    data = make(tmp_path, runs)
    before = sorted(tmp_path.rglob("*"))
    assert exit_code("diagnose", str(data), *options, "--out", str(tmp_path / "out")) == 2
    [line] = capsys.readouterr().err.strip().splitlines()
    assert line.startswith("gyrotwin: ")
    assert expected in line
    assert sorted(tmp_path.rglob("*")) == before


def test_a_missing_table(runs: Tables, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    data = written(tmp_path / "d", runs)
    (data / "run-1.parquet").unlink()
    assert exit_code("diagnose", str(data), "--out", str(tmp_path / "out")) == 2
    assert "run-1.parquet does not exist" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_an_interrupted_search_goes_on(
    answer: SimpleNamespace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"

    def stops(*_: Any, checkpoint: Path, **__: Any) -> None:
        checkpoint.write_text("half-way")
        raise Interrupted

    def goes_on(*_: Any, checkpoint: Path, **__: Any) -> Diagnosis:
        assert checkpoint.read_text() == "half-way"
        found: Diagnosis = answer.found
        return found

    monkeypatch.setattr(diagnose, "build", lambda *_: Fmus(answer.out / "fmi2.fmu", answer.out / "fmi3.fmu"))
    monkeypatch.setattr(naming, "diagnose", stops)
    assert exit_code("diagnose", str(answer.data), "--out", str(out)) == 130
    [line] = capsys.readouterr().err.strip().splitlines()
    assert "the same command goes on" in line and str(out) in line
    assert [path.name for path in out.iterdir()] == [diagnose.CHECKPOINT]
    monkeypatch.setattr(naming, "diagnose", goes_on)
    assert exit_code("diagnose", str(answer.data), "--out", str(out)) == 0
    assert not (out / diagnose.CHECKPOINT).exists()
    assert (out / "report.html").is_file()


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no SIGINT for one process")
def test_ctrl_c_in_the_search(answer: SimpleNamespace, tmp_path: Path) -> None:
    command = [sys.executable, "-u", "-m", "gyrotwin", "diagnose", str(answer.data), "--out", "out"]
    process = subprocess.Popen(command, cwd=tmp_path, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    while "nominal parameters" not in (line := process.stdout.readline()):
        assert line, "ended before the search"
    process.send_signal(signal.SIGINT)
    _, complaint = process.communicate(timeout=60)
    assert process.returncode == 130
    assert "interrupted" in complaint and "Traceback" not in complaint
    assert list(tmp_path.rglob("report*")) == []


def test_a_folder_that_cannot_be_written(answer: SimpleNamespace, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    assert exit_code("diagnose", str(answer.data), "--out", str(tmp_path / "file" / "out")) == 2


def test_numbers() -> None:
    assert uncertain(7.99, 7.934, 8.046) == "7.990 ± 0.056"
    assert uncertain(2.0000012e10, 2e10, 2.0000024e10) == "2.0000012e+10 ± 1.2e+04"
    assert uncertain(0.0, -1e-3, 1e-3) == "0.0 ± 0.001"
    assert uncertain(2e-6, 2e-6, 2e-6) == "2e-06"
    assert [hertz(f) for f in (6.95, 2459.05, 12968.0)] == ["6.95 Hz", "2459 Hz", "12.97 kHz"]


def test_the_page_says_what_an_effect_cannot_be_told_from(tmp_path: Path) -> None:
    (tmp_path / "quintic.py").write_text(QUINTIC)
    shown = diagnosis_report._rivals(load_model(tmp_path), ["quintic", "drive_feedthrough"], 2)
    # A feedthrough is no force.
    assert shown == {"quintic": "F_x = -k5·x^5", "drive_feedthrough": ""}
