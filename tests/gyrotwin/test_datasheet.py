"""`gyrotwin datasheet` as a user types it, and gt.datasheet."""

import copy
import html.parser
import json
from pathlib import Path

import fmpy
import numpy as np
import pytest
from rich.console import Console

import gyrotwin as gt
from calibration.datasheet.procedure import procedures
from cosim.rate import bench as rate_bench
from gyrotwin.cli import main
from gyrotwin.commands import datasheet as command
from gyrotwin.curve_figures import draw
from gyrotwin.datasheet_report import expected_of
from gyrotwin.numbers import with_error

SHORT = rate_bench.QUICK._replace(rest_records=2, rest_duration=40.0, turn_ons=3, turn_on_duration=2.0)


@pytest.fixture(autouse=True)
def short(monkeypatch: pytest.MonkeyPatch) -> None:
    """Records of some seconds: what is looked at here is what is written."""
    monkeypatch.setattr(rate_bench, "QUICK", SHORT)


@pytest.fixture(scope="module")
def sheet() -> gt.DatasheetResult:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(rate_bench, "QUICK", SHORT)
        return gt.datasheet("rate-mode", quick=True, seed=3)


def test_every_test_of_the_mode_is_there(sheet: gt.DatasheetResult) -> None:
    assert [test["id"] for test in sheet.summary["tests"]] == list(procedures("rate-open"))
    assert sheet.summary["plant"]["long_tests"] == "envelope"
    for test in sheet.summary["tests"]:
        assert bool(test["figures"]) != bool(test["not_done"])
    ids = [figure["id"] for test in sheet.summary["tests"] for figure in test["figures"]]
    assert len(ids) == len(set(ids)) >= 30
    for key in ("allan", "transfer", "temperature", "scale_factor"):
        lengths = {len(values) for values in sheet.summary["curves"][key]["columns"].values()}
        assert len(lengths) == 1


def test_figures_meet_their_formulas(sheet: gt.DatasheetResult) -> None:
    off = [figure.id for figure in sheet.figures.values() if figure.holds is False]
    # Three standard errors: none of 30 by chance but one in eight sheets; the terms of the noise have few values here.
    assert set(off) <= {"bias_repeatability", "scale_factor_repeatability"}


def test_another_seed_is_another_record_and_the_same_is_the_same() -> None:
    device = gt.load_device("rate-mode")
    first, again, other = (rate_bench.Bench(device, seed=s, plan=SHORT).record(2.0, envelope=True) for s in (5, 5, 6))
    assert (first.rate == again.rate).all()
    assert (first.rate != other.rate).any()


def test_the_command_writes_page_and_json(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(command, "console", Console(width=140))
    with pytest.raises(SystemExit) as end:
        main(["datasheet", "rate-mode", "--mode", "rate-closed", "--quick", "--out", str(tmp_path / "sheet")])
    assert end.value.code in (0, None)
    shown = capsys.readouterr().out
    assert "angle random walk" in shown
    summary = json.loads((tmp_path / "sheet" / "datasheet.json").read_text())
    assert summary["mode"] == "rate-closed"
    page = (tmp_path / "sheet" / "report.html").read_text()
    html.parser.HTMLParser().feed(page)
    assert "Transfer function" in page
    assert "http" not in page.split("<script>")[0]


def test_what_the_design_says_wrongly_shows_in_the_sheet(sheet: gt.DatasheetResult) -> None:
    device = gt.load_device("rate-mode")
    # Calibrated for a split that is 2 Hz wider than it is: 4 % of scale factor.
    wide = device.parameters["m"] * (2 * 3.141592653589793 * 5052.0) ** 2
    known = device.with_parameters({"kyy": wide})
    off = gt.datasheet("rate-mode", design=known, quick=True, seed=3)
    assert off.figures["scale_factor"].value > 1.02 > sheet.figures["scale_factor"].value
    assert off.figures["scale_factor"].holds


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["rate-mod"], "rate-mode"),
        (["rate-mode", "--mode", "rate-opn"], "rate-open"),
        (["rate-mode", "--standard", "ieee1432"], "ieee1431"),
        (["rate-mode", "--set", "kxx=-1"], "kxx"),
        (["rate-mode", "--seed", "-1"], "seed"),
    ],
)
def test_wrong_input_is_one_line(
    arguments: list[str], message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as end:
        main(["datasheet", *arguments, "--quick", "--out", str(tmp_path / "out")])
    assert end.value.code == 2
    assert message in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_the_sensor_is_exported(sheet: gt.DatasheetResult, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    sheet.save(tmp_path / "sheet")
    out = tmp_path / "sensor"
    with pytest.raises(SystemExit) as end:
        main(["export", "sensor", str(tmp_path / "sheet" / "datasheet.json"), "--out", str(out)])
    assert end.value.code in (0, None)
    written = sorted(path for path in out.rglob("*") if path.is_file())
    # What takes a while is said beside.
    assert written == sorted(Path(line) for line in capsys.readouterr().out.splitlines() if line.startswith(str(out)))
    result = gt.export_sensor(sheet)
    assert result.files == {path.name: path.read_text() for path in out.iterdir() if path.is_file()}
    assert gt.export_sensor(sheet, formats=["px4"]).parameters == {}
    for fmi in ("fmi2", "fmi3"):
        fmu = out / fmi / "GyroscopeSensor.fmu"
        started = {v.name: v.start for v in fmpy.read_model_description(fmu).modelVariables}
        assert {name: float(started[name]) for name in result.parameters} == result.parameters
        # A quick datasheet knows 25 °C itself: at rest the output is its bias, within the noise of a mean over 2 s.
        output = fmpy.simulate_fmu(str(fmu), stop_time=2.0, output_interval=1e-2)["rate"][20:]
        assert np.degrees(output.mean()) == pytest.approx(sheet.figures["bias"].value, abs=0.01)
    (tmp_path / "sheet" / "datasheet.json").write_text("[1, 2")
    with pytest.raises(gt.InputError, match="gyrotwin datasheet DEVICE"):
        gt.export_sensor(tmp_path / "sheet" / "datasheet.json")


def test_a_filter_that_two_sections_do_not_make_is_told(
    sheet: gt.DatasheetResult, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert gt.export_sensor(sheet, formats=["fmu"]).doubts == []
    content = copy.deepcopy(dict(sheet.summary))
    columns = content["curves"]["transfer"]["columns"]
    # Twice around within the lines by a pure delay.
    delay = 2.0 / columns["frequency [Hz]"][-1]
    columns["phase [°]"] = [
        p - 360 * f * delay for p, f in zip(columns["phase [°]"], columns["frequency [Hz]"], strict=True)
    ]
    path = tmp_path / "datasheet.json"
    path.write_text(json.dumps(content))
    with pytest.raises(SystemExit):
        main(["export", "sensor", str(path), "--format", "fmu", "--out", str(tmp_path / "sensor")])
    assert "two sections of second order" in capsys.readouterr().out


def test_values_show_two_digits_of_their_error(sheet: gt.DatasheetResult) -> None:
    figure = sheet.figures["bias"]._replace(value=1.23456, error=0.0123, expected=1.2, how="at least")
    assert with_error(figure.value, figure.error) == "1.235 ± 0.012"
    assert expected_of(figure) == "≥ 1.2"
    assert with_error(None, figure.error) == "–"
    assert with_error(0.001, 20.0) == "0 ± 20"


def test_curves_are_drawn_by_their_units(sheet: gt.DatasheetResult) -> None:
    drawings = [draw(curve) for test in sheet.tests for curve in test.outcome.curves]
    assert {drawing.id for drawing in drawings if drawing} == {
        "allan",
        "noise_spectrum",
        "transfer",
        "temperature",
        "scale_factor",
    }
    transfer = next(drawing for drawing in drawings if drawing and drawing.id == "transfer")
    assert [panel.y_title for panel in transfer.panels] == ["gain [1]", "phase [°]"]
    assert all(panel.x_log for panel in transfer.panels)
