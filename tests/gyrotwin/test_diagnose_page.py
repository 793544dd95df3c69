"""The page of a diagnosis: whole, without network, with all that was found."""

import json
import re
from html.parser import HTMLParser
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from cubic_case import QUINTIC

from discrepancy.data.record import make_record
from discrepancy.tell.answer import Stage
from gyro_model.model import load_model
from gyrotwin import diagnosis_figures, diagnosis_report
from gyrotwin.diagnosis_console import verdict
from gyrotwin.numbers import hertz, uncertain

VOID = {"area", "base", "br", "col", "embed", "hr", "img", "input", "link", "meta", "source", "track", "wbr"}


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


def test_figures_of_a_motion_that_leaves_all_bounds_are_drawn() -> None:
    t, device = np.arange(2000) / 1e5, {"m": 1e-7, "kxx": 40.0}
    v = np.sin(2 * np.pi * 3e3 * t)[:, None]
    run = make_record("held.csv", t, np.cos(2 * np.pi * 3e3 * t)[:, None], v, sample_rate=1e5)
    lost = np.where(t[:, None] < 1e-2, 0.1 * v, np.nan)
    ends = (("nominal", 0.5, 0.5 * v), ("refit", np.inf, lost), ("k3", np.nan, lost))
    stages = [Stage(name, device, {"": gap, "held.csv": gap}, {"held.csv": left}) for name, gap, left in ends]
    found = SimpleNamespace(stages=stages, removed={"k3": {"held.csv": lost}})
    data = SimpleNamespace(held_out=(run,), axes=1)
    bars = diagnosis_figures.misfit_figure(found, None)  # type: ignore[arg-type]
    others = (diagnosis_figures.map_figure(data, found, None), diagnosis_figures.spectrum_figure(data, found, None))  # type: ignore[arg-type]
    for figure in (bars, *others):
        json.dumps(figure.data(), allow_nan=False)
    assert bars.data()[0]["values"] == [0.5, None, None]
    assert bars.data()[0]["names"] == ["nominal", "refit<br>left all bounds", "+ k3<br>left all bounds"]


def test_a_map_of_what_no_spring_holds_shows_all_frequencies() -> None:
    t = np.arange(2000) / 1e3
    v = np.random.default_rng(1).standard_normal((2000, 1))
    run = make_record("held.csv", t, np.cos(t)[:, None], v, sample_rate=1e3)
    free = {"m": 1.0, "kxx": 1e-9}
    stages = [Stage(name, free, {"": 1.0, "held.csv": 1.0}, {"held.csv": v}) for name in ("nominal", "refit")]
    data, found = SimpleNamespace(held_out=(run,), axes=1), SimpleNamespace(stages=stages)
    figure = diagnosis_figures.map_figure(data, found, 1.0)  # type: ignore[arg-type]
    assert max(figure.data()[0]["rows"]) > 400


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


@pytest.mark.parametrize(("refit", "final", "goes"), [(0.5, 0.1, "falls"), (None, 0.1, "falls"), (0.5, None, "rises")])
def test_a_model_that_leaves_all_bounds_has_a_verdict(refit: float | None, final: float | None, goes: str) -> None:
    misfit = {"refit": refit, "final": final, "noise_floor": 0.01}
    said = verdict({"verdict": "partly explained", "left": 0.2, "misfit": misfit, "effects": [{"id": "play"}]})
    assert f"held-out runs {goes} from" in said
