"""The report and the terminal tables, from a made-up run."""

import html.parser
import io
import json
import re

import numpy as np
import polars as pl
import pytest
from rich.console import Console

from cosim.angle_filters import band_pass, low_pass
from cosim.layout import PARAMETER_NAMES, STATE_NAMES
from cosim.metrics import Bounds, summarise
from cosim.rate_profile import true_angle
from cosim.recorder import Validity
from cosim.scenarios import scenario
from gyrotwin import figures
from gyrotwin.console import results
from gyrotwin.numbers import degrees, microseconds, relative
from gyrotwin.report import render

PERIOD = 5e-5
PLOTS = {"angle": 3, "units": 1, "states": 4, "parameters": 8, "relative-error": 1, "bound": 1}


def made_up_run(name="constant", converged_at=0.08):
    """Summary, trace and bounds of a run of 1 s; the numbers mean nothing."""
    chosen = scenario(name)
    count = 20_000
    t = np.arange(count) * PERIOD
    omega = chosen.omega_z(0, count, PERIOD)
    valid = t >= (np.inf if converged_at is None else converged_at)
    theta = np.where(valid, true_angle(omega, PERIOD), np.nan)
    ripple = 1e-4 * np.sin(5e4 * t)
    columns = {"t": t, "omega_true": omega, "est_omega_z": omega, "angle_true": theta}
    columns |= {"angle": theta + ripple, "angle_quality": np.ones(count), "converged": valid}
    columns |= {f"angle_{unit}": theta + ripple for unit in "ABC"}
    columns |= {
        "drift_sigma": np.full(count, 2e-3),
        "drift_sigma_now": np.full(count, 1e-3),
        "angle_sigma": np.full(count, 1e-3),
    }
    columns |= {f"{kind}_{s}": np.cos(2e4 * t) for s in STATE_NAMES for kind in ("est", "true")}
    for parameter in PARAMETER_NAMES:
        columns[f"true_{parameter}"] = np.full(count, 2.0)
        columns[f"est_{parameter}"] = 2.0 + np.exp(-t / 0.01) + ripple
    trace = pl.DataFrame(columns)
    at = np.geomspace(0.01, 1.0, 20)
    bounds = Bounds(at, np.outer(1e-4 / at, np.ones(7)), np.ones(20), np.full(20, 1e-3))
    summary = summarise(
        trace,
        scenario=name,
        seed=4,
        unit=chosen.angle_unit,
        converged_at=converged_at,
        edges=chosen.edges_until(1.0),
        bounds=bounds,
        validity=Validity(0.9, ((0.5, "dxy is not <i>steady</i>"),), converged_at is not None, "", ""),
        extra={},
        real_time_factor=1.5,
        run={"device": "<b>reference</b>", "description": "a </script> in a text"},
    )
    return summary | {"characteristics": {}}, trace, bounds


CHARACTERISTICS = {
    "spin": {"title": "Spin", "not_done": "pattern <i>turned</i> by 1 rad", "figures": {}, "curves": []},
    "rest": {
        "title": "Rest",
        "not_done": "",
        "figures": {
            "angle_random_walk": {
                "name": "angle random walk",
                "value": 0.0123,
                "error": 4e-4,
                "unit": "°/√h",
                "note": "",
            }
        },
        "curves": [
            {"id": "allan", "name": "Allan", "columns": {"tau [s]": [1.0, 2.0], "deviation [°/h]": [3.0, None]}}
        ],
    },
}


def test_what_a_run_of_its_kind_shows_is_in_terminal_and_report(tmp_path):
    summary, trace, bounds = made_up_run()
    summary["characteristics"] = CHARACTERISTICS
    out = io.StringIO()
    Console(file=out, width=120).print(results(summary))
    assert "0.01230 ± 0.0004" in out.getvalue()
    assert "not done: pattern <i>turned</i> by 1 rad" in out.getvalue()
    render(summary, trace, bounds, filters(), tmp_path / "report.html")
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "0.01230 ± 0.0004" in text
    assert "<i>turned</i>" not in text
    assert Page(text).panels["allan"] == 1


def filters():
    return [make(200e3, 3000.0, shape) for make in (band_pass, low_pass) for shape in ("lag_free", "butterworth")]


class Page(html.parser.HTMLParser):
    """Collects what the checks need: scripts, links of any kind, panels under each figure."""

    def __init__(self, text):
        super().__init__()
        self.scripts, self.links, self.panels = [], [], {}
        self._figure = None
        self._in_script = False
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        attributes = dict(attrs)
        self.links += [attributes[k] for k in ("src", "href", "data", "action") if k in attributes]
        if tag == "script":
            self._in_script = True
            self.scripts.append((attributes, ""))
        if tag == "figure":
            self._figure = attributes["id"]
            self.panels[self._figure] = 0
        if "panel" in attributes.get("class", "").split():
            self.panels[self._figure] += 1

    def handle_endtag(self, tag):
        self._in_script = self._in_script and tag != "script"

    def handle_data(self, data):
        if self._in_script:
            attributes, text = self.scripts[-1]
            self.scripts[-1] = (attributes, text + data)


@pytest.fixture(scope="module")
def page_text(tmp_path_factory):
    out = tmp_path_factory.mktemp("report") / "report.html"
    render(*made_up_run(), filters(), out)
    assert [path.name for path in out.parent.iterdir()] == ["report.html"]
    return out.read_text(encoding="utf-8")


def strictly(text):
    def refuse(constant):
        raise AssertionError(f"{constant} is no JSON")

    return json.loads(text, parse_constant=refuse)


def test_page_is_self_contained(page_text):
    page = Page(page_text)
    assert page.links == []
    outside_plotly = page_text.replace(page.scripts[0][1], "")
    assert not re.search(r"https?:|//\w+\.|@import|url\(", outside_plotly)
    # plotly-basic.min.js is 1.1 MB; the data of a run must stay small beside it.
    assert len(page_text.encode()) < 8e6
    assert len(outside_plotly.encode()) < 2e6


def test_every_figure_has_its_data(page_text):
    page = Page(page_text)
    assert len(page.scripts) == 3
    data = strictly(page.scripts[1][1])
    assert {name: len(panels) for name, panels in data.items()} == {**PLOTS, "filters": 4}
    assert page.panels == {**PLOTS, "filters": 4}
    for panels in data.values():
        for panel in panels:
            assert panel["x_title"] and re.search(r"\[.+\]|error", panel["y_title"])
            for line in panel["lines"]:
                assert len(line["x"]) == len(line["y"]) <= figures.POINTS
                assert f"{line['role']}:" in page_text or f'"{line["role"]}":' in page_text


def test_texts_are_escaped(page_text):
    assert "&lt;b&gt;reference&lt;/b&gt;" in page_text
    assert "a &lt;/script&gt; in a text" in page_text


def test_source_figures_are_named(page_text):
    for number in ("fig. 4", "fig. 5", "fig. 7", "figs. 6 and 9"):
        assert f"patent TW 201137310, {number}" in page_text


def test_second_embodiment_and_no_convergence(tmp_path):
    summary, trace, _ = made_up_run("varying", converged_at=None)
    render(summary, trace, None, filters(), tmp_path / "report.html")
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "patent TW 201137310, fig. 8" in text and "patent TW 201137310, fig. 10" in text
    assert "converged: no angle" in text
    data = strictly(Page(text).scripts[1][1])
    assert "bound" not in data
    assert set(data["units"][0]["lines"][2]["y"]) == {None}


def test_no_half_written_report(tmp_path):
    summary, trace, bounds = made_up_run()
    (tmp_path / "report.html").mkdir()
    with pytest.raises(OSError):
        render(summary, trace, bounds, filters(), tmp_path / "report.html")
    assert [path.name for path in tmp_path.iterdir()] == ["report.html"]


def test_envelope_keeps_extremes():
    t = np.arange(100_000.0)
    y = np.sin(t / 7.0)
    y[12_345], y[77_777] = 9.0, -9.0
    x, kept = figures.envelope(t, y)
    assert len(kept) <= figures.POINTS
    assert kept.max() == 9.0 and kept.min() == -9.0
    assert (np.diff(x) > 0).all()


def test_an_envelope_leaves_a_gap_where_there_are_no_numbers():
    t = np.arange(100_000.0)
    y = np.cos(t / 7.0)
    y[:40_000], y[70_000::3], y[80_000] = np.nan, np.nan, 5.0
    x, kept = figures.envelope(t, y)
    assert np.isnan(kept[x < 39_000]).all() and len(kept[x < 39_000]) > 100
    assert np.isfinite(kept[x > 40_000]).all()
    assert kept[x > 40_000].max() == 5.0


def test_rms_in_bins_by_hand():
    middle, rms = figures.rms_in_bins(np.arange(1000.0), np.tile([3.0, -3.0, 4.0, 4.0, 0.0], 200))
    assert len(middle) == figures.BINS
    # Each bin holds one period: (9 + 9 + 16 + 16 + 0)/5 = 10.
    np.testing.assert_allclose(rms, np.sqrt(10.0))
    assert middle[0] == 2.0


@pytest.mark.parametrize("log", [False, True])
def test_bins_hold_every_sample_once(log):
    t = np.arange(30_000.0)
    middle, rms = figures.rms_in_bins(t, np.full(30_000, 2.0), log)
    np.testing.assert_allclose(rms, 2.0)
    assert (np.diff(middle) > 0).all()
    assert len(middle) <= figures.BINS
    x, _ = figures.envelope(t, t, log)
    assert x[0] == (1.0 if log else 0.0)
    assert x[-1] == t[-1]


def test_numbers():
    assert degrees(-1e-9) == "0.000°"
    assert degrees(-0.0336, "°/s") == "-0.034°/s"
    assert microseconds(-4e-7) == "0 µs"
    assert relative(3.8e-8) == "+0.038 ppm"
    assert relative(-0.012) == "-1.2 %"
    assert relative(None) == "–"


@pytest.mark.parametrize("converged_at", [0.08, None])
def test_terminal_tables(converged_at):
    summary, _, _ = made_up_run(converged_at=converged_at)
    out = io.StringIO()
    Console(file=out, width=100).print(results(summary))
    text = out.getvalue()
    for name in (*PARAMETER_NAMES, "A (chosen)", "constant, seed 4"):
        assert name in text
    assert ("80.0 ms" in text) == (converged_at is not None)


@pytest.mark.parametrize(("sigma_deg", "lost"), [(51.962, True), (0.05, False), (None, False)])
def test_a_lost_angle_is_said_in_table_and_report(tmp_path, sigma_deg, lost):
    summary, trace, bounds = made_up_run()
    summary["predicted"]["angle_sigma_deg"] = sigma_deg
    assert ("The angle is lost" in shown(summary)) == lost
    render(summary, trace, bounds, filters(), tmp_path / "report.html")
    assert ("The angle is lost" in (tmp_path / "report.html").read_text(encoding="utf-8")) == lost


@pytest.mark.parametrize(("rms_deg", "missing"), [(None, True), (0.01, False)])
def test_why_figures_of_the_angle_are_missing_is_said(tmp_path, rms_deg, missing):
    summary, trace, bounds = made_up_run()
    summary["angle"] = summary["angle"] | {"rms_deg": rms_deg}
    assert ("give a higher --trace-rate" in shown(summary).replace("\n", " ")) == missing
    render(summary, trace, bounds, filters(), tmp_path / "report.html")
    assert ("give a higher --trace-rate" in (tmp_path / "report.html").read_text(encoding="utf-8")) == missing


def shown(summary):
    """The tables as the terminal shows them."""
    console = Console(file=io.StringIO(), width=250)
    console.print(results(summary))
    return console.file.getvalue()
