"""The page of `gyrotwin play`: the FMU's own bits in a browser, a slider for every effect, a game that a diagnosis can
play too."""

import importlib.util
import json
import os
import re
import shutil
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import gyrotwin as gt
from benchmarks.pages import browser
from benchmarks.tab import Tab
from discrepancy.fit.simulate import Simulator
from gyro_model.build import build_module
from gyro_model.model import load_model
from gyrotwin.playing.hidden import LEAST, MOST, experiment_of, known_parameters
from gyrotwin.playing.page import STEPS
from gyrotwin.playing.sliders import shown_unit, slider

ROOT = Path(__file__).parents[2]
AXE = ROOT / "node_modules" / "axe-core" / "axe.min.js"
MODEL = load_model()
SIZES = {"light": (1200, 900, False), "dark": (1200, 900, True), "phone": (360, 780, False)}

needs_zig = pytest.mark.skipif(importlib.util.find_spec("ziglang") is None, reason="needs the package ziglang")
needs_node = pytest.mark.skipif(shutil.which("node") is None, reason="needs node")
needs_browser = pytest.mark.skipif(browser() is None, reason="needs Chromium")


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    if importlib.util.find_spec("ziglang") is None:
        pytest.skip("needs the package ziglang")
    return gt.play().save(tmp_path_factory.mktemp("play")) / "play.html"


def held(page: Path) -> Any:
    found = re.search(r'<script type="application/json" id="data">(.*?)</script>', page.read_text(), re.S)
    assert found
    return json.loads(found[1])


def in_node(page: Path, first: int, last: int) -> Any:
    command = ["node", str(Path(__file__).with_name("play.mjs")), str(page), str(first), str(last)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-2000:]
    return json.loads(done.stdout)


def test_the_page_is_small_and_asks_no_network(page: Path) -> None:
    text = page.read_text()
    # 247 kB, with the module packed; a page that is opened at once.
    assert page.stat().st_size <= 300_000
    assert "://" not in text
    assert not re.search(r"<link|<img|@import|url\(|fetch\(|XMLHttpRequest|import\(", text)


def test_every_input_and_every_number_of_every_effect_has_a_slider(page: Path) -> None:
    data, text = held(page), page.read_text()
    sliders = {s["name"]: s for group in data["sliders"].values() for s in group}
    wanted = {q.name for q in MODEL.quantities if q.role in ("input", "size", "shape", "start")}
    assert wanted <= set(sliders)
    for effect in MODEL.effects:
        assert (f'data-sliders="{effect.id}"' in text) == bool(effect.parameters)
    for name, s in sliders.items():
        quantity = MODEL.by_name[name]
        assert quantity.low <= s["low"] < s["high"] <= quantity.high, name
        assert s["low"] <= s["start"] <= s["high"] or s["scale"] == "limit", name
        assert bool(s["unit"]) == (quantity.unit != "1"), name


@pytest.mark.parametrize(
    ("unit", "shown"),
    [("N/m.V2", "N/(m·V²)"), ("N.s/m3", "N·s/m³"), ("1/N2", "1/N²"), ("V/Hz0.5", "V/√Hz"), ("deg/s", "°/s"), ("1", "")],
)
def test_units_read_as_people_write_them(unit: str, shown: str) -> None:
    assert shown_unit(unit) == shown


def test_ends_of_a_slider_follow_from_the_definition() -> None:
    # A decade beyond the typical size, within the bounds.
    assert (slider(MODEL, "k3_x", 0.0).low, slider(MODEL, "k3_x", 0.0).high) == (-1e11, 1e11)
    assert (slider(MODEL, "friction_x", 0.0).low, slider(MODEL, "hysteresis_n", 1.0).low) == (0.0, 1.0)
    assert slider(MODEL, "adc_limit", 1e300).scale == "limit"
    # A temperature is as large as its differences, not as its distance from zero.
    assert (slider(MODEL, "temperature", 300.0).low, slider(MODEL, "temperature", 300.0).high) == (200.0, 400.0)


@needs_node
def test_the_module_gives_the_bits_of_the_native_fmu(page: Path) -> None:
    plan = held(page)["fingerprint"]
    found = in_node(page, 1, 0)
    assert plan["done"] == STEPS, "the fixed run diverges"
    assert (found["hash"], found["steps"]) == (plan["hash"], STEPS)
    # All effects were on.
    on = dict(plan["numbers"])
    sizes = {i: q for i, q in enumerate(MODEL.quantities) if q.role == "size"}
    assert [q.name for i, q in sizes.items() if on[i] == q.start] == []


@needs_node
def test_a_case_hides_what_shows_and_what_the_right_model_explains(page: Path) -> None:
    data = held(page)
    sliders = {s["name"]: s for group in data["sliders"].values() for s in group}
    cases = in_node(page, 1, 60)["cases"]
    assert len({case["effect"] for case in cases}) >= 10
    assert len({(case["name"], case["value"]) for case in cases}) > 40
    for case in cases:
        s = sliders[case["name"]]
        assert s["low"] <= case["value"] <= s["high"], case["number"]
        # Sizes in between those tried, where the motion may be a little more or less.
        assert 0.5 * LEAST < case["unexplained"] < 2 * MOST, case["number"]
        # What the pickoff's noise leaves: 2e-5 V of some V.
        assert case["right"] < 1e-4, case["number"]
        name, _, value = case["commands"].splitlines()[0].rpartition(" ")[2].partition("=")
        assert (name, float(value)) == (case["name"], case["value"]), "a text that Python reads as the same double"


@needs_node
def test_a_case_is_the_first_run_of_its_data_set(page: Path, tmp_path: Path) -> None:
    device = gt.load_device("pendulum")
    experiment = experiment_of(device)
    [case] = in_node(page, 3, 3)["cases"]
    with Simulator(MODEL, jobs=1) as simulator:
        wanted = simulator.run(experiment.record, {**known_parameters(device), case["name"]: case["value"]})
    # Sums of forty sines differ in their last bits between libraries.
    off = np.linalg.norm(np.array(case["v"]).T - wanted) / np.linalg.norm(wanted)
    assert off < 1e-9
    simulate, diagnose = case["commands"].splitlines()
    command = [sys.executable, "-m", *simulate.split()]
    subprocess.run(command, cwd=tmp_path, check=True, capture_output=True, env=environment())
    record = gt.load_dataset(tmp_path / f"case-{case['number']}").records[0]
    assert np.allclose(record.u, experiment.record.u, rtol=0, atol=1e-12 * np.abs(record.u).max())
    # White noise of 2e-5 V a sample lies between.
    assert np.linalg.norm(record.v - wanted) / np.linalg.norm(wanted) < 1e-4
    assert diagnose == f"gyrotwin diagnose case-{case['number']}"


def environment() -> dict[str, str]:
    return os.environ | {"PYTHONPATH": str(ROOT)}


def opened(page: Path, size: str) -> Tab:
    return Tab(page.resolve().as_uri(), *SIZES[size][:2], dark=SIZES[size][2])


READY = "document.documentElement.dataset.drawn && player && player.frames > 20"


@needs_browser
@pytest.mark.parametrize("size", SIZES)
def test_it_runs_in_a_browser_as_fast_as_it_is_shown(page: Path, size: str) -> None:
    with opened(page, size) as tab:
        tab.wait(READY)
        assert tab.run("document.documentElement.dataset.same") == "yes"
        tab.wait("document.getElementById('factor').dataset.value")
        assert tab.run("Number(document.getElementById('factor').dataset.value)") >= 1
        # Every canvas holds more than one colour.
        empty = """[...document.querySelectorAll("canvas")].filter(canvas => {
            const {data} = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
            return new Set(new Uint32Array(data.buffer)).size < 10;
        }).map(canvas => canvas.id)"""
        assert tab.run(empty) == []
        assert tab.run("document.documentElement.scrollWidth <= innerWidth")
        past = "[...document.querySelectorAll('section')].filter(s => s.scrollWidth > s.clientWidth + 1).length"
        assert tab.run(past) == 0
        assert tab.console == []


@needs_browser
def test_real_time_is_the_time_of_the_clock(page: Path) -> None:
    with opened(page, "light") as tab:
        tab.wait(READY)
        tab.run("document.getElementById('pluck').click()")
        before, begin = tab.run("scene.time"), time.monotonic()
        time.sleep(2)
        shown, spent = tab.run("scene.time") - before, time.monotonic() - begin
        slower = tab.run("player.slower")
    # Frames longer than 0.1 s, on a busy machine, are shown as 0.1 s.
    assert 0.6 * spent < shown * slower < 1.1 * spent


@needs_browser
def test_sliders_change_the_motion_by_mouse_and_by_keys(page: Path) -> None:
    slide = """(id, share) => {
        const input = document.getElementById(id);
        input.value = Number(input.min) + share * (input.max - input.min);
        input.dispatchEvent(new Event("input"));
    }"""
    turned = """(async () => {
        document.getElementById("pluck").click();
        while (scene.time < 0.02) await new Promise(requestAnimationFrame);
        return (scene.swings.latest.angle - scene.swings.angle[0]) / (scene.time * 180 / Math.PI);
    })()"""
    with opened(page, "light") as tab:
        tab.wait(READY)
        # The orbit of a point mass turns against the package, at its rate: 20 ms of it, read to some percent.
        assert tab.run(turned) == pytest.approx(-5, rel=0.1)
        tab.run(f"({slide})('device-omega_z', 0)")
        assert tab.run(turned) == pytest.approx(10, rel=0.1)
        tab.run(f"({slide})('device-angular_gain', 0.25)")
        assert tab.run(turned) == pytest.approx(5, rel=0.1)
        assert tab.run("document.getElementById('device-angular_gain').getAttribute('aria-valuetext')") == "0.5"
        tab.run("document.getElementById('reset').click()")
        assert tab.run(turned) == pytest.approx(-5, rel=0.1)
        tab.run("document.getElementById('device-omega_z').focus()")
        tab.key("ArrowRight", 39)
        assert 5 < tab.run("scene.numbers.get(data.references.omega_z)") < 5.5
        # A fixed parameter starts the FMU anew where the mass is.
        before = tab.run("scene.device.samples")
        tab.run(f"({slide})('device-kyy', 0.6)")
        assert tab.run("scene.device.samples") < before
        tab.wait("scene.device.samples > 2000 && scene.swings.latest.short > 0.05")
        # The other kind of motion: one that leaves the model says so and can be had back.
        tab.run(f"({slide})('device-softening', 1); ({slide})('device-v_bias', 1)")
        tab.wait("document.getElementById('said').textContent")
        tab.run("document.getElementById('reset').click()")
        tab.wait("!document.getElementById('said').textContent && scene.device.samples > 100")
        assert tab.console == []


@needs_browser
def test_the_mass_is_pulled_and_let_go(page: Path) -> None:
    with opened(page, "light") as tab:
        tab.wait(READY)
        box = "(b => [b.left, b.top, b.width])(document.getElementById('orbit').getBoundingClientRect())"
        left, top, width = tab.run(box)
        middle = (left + width / 2, top + width / 2)
        tab.run("document.getElementById('pause').click()")
        scale = tab.run("player.map.x(1) - player.map.x(0)") * 1e-6
        tab.drag(middle, (middle[0] + 60, middle[1] - 90))
        x, y = tab.run("['x_start', 'y_start'].map(name => scene.numbers.get(data.references[name]))")
        # To the pixel, upwards is +y; the voltage of a micrometre is 1 V.
        assert (x, y) == pytest.approx((60 * scale, 90 * scale), abs=scale)
        tab.run("scene.advance(200)")
        assert tab.run("scene.swings.latest.angle") == pytest.approx(np.degrees(np.arctan2(90, 60)), abs=2)
        assert tab.run("document.getElementById('device-x_start').getAttribute('aria-valuetext')").endswith("µm")


@needs_browser
def test_the_game_is_won_by_the_right_model(page: Path) -> None:
    with opened(page, "phone") as tab:
        tab.wait("game && game.hidden")
        for number in (1, 2, 3):
            tab.run(f"game.open({number})")
            assert tab.run("document.getElementById('commands').hidden")
            assert tab.run("game.misfit") > 0.5 * LEAST
            tab.run("document.getElementById('guess').value = game.hidden.effect;"
                    "document.getElementById('guess').dispatchEvent(new Event('change'))")  # fmt: skip
            tab.run("game.model.set(data.references[game.hidden.name], game.hidden.value); game.compare()")
            assert tab.run("game.misfit") < 1e-4
            tab.run("document.getElementById('answer').click()")
            verdict = tab.run("document.getElementById('verdict').textContent")
            assert verdict.startswith("Right.") and f"{number} of {number} right" in verdict
            assert tab.run("document.getElementById('commands').textContent").startswith("gyrotwin dataset simulate")
        tab.run("document.getElementById('next').click()")
        wrong = (
            "[...document.getElementById('guess').options].find(o => o.value && o.value !== game.hidden.effect).value"
        )
        tab.run(f"document.getElementById('guess').value = {wrong};"
                "document.getElementById('guess').dispatchEvent(new Event('change'))")  # fmt: skip
        tab.run("document.getElementById('answer').click()")
        assert tab.run("document.getElementById('verdict').textContent").startswith("No.")
        assert tab.run("document.documentElement.scrollWidth <= innerWidth")
        assert tab.console == []


@needs_browser
@pytest.mark.skipif(not AXE.is_file(), reason="needs axe-core: npm install")
@pytest.mark.parametrize("size", ["light", "dark"])
def test_axe_finds_no_serious_fault(page: Path, size: str) -> None:
    with opened(page, size) as tab:
        tab.wait(READY)
        tab.run("document.querySelectorAll('details').forEach(d => { d.open = true; });"
                "document.getElementById('guess').selectedIndex = 1;"
                "document.getElementById('guess').dispatchEvent(new Event('change'));"
                "document.getElementById('reveal').click()")  # fmt: skip
        tab.run(AXE.read_text() + "; 1")
        found = tab.run("axe.run().then(r => r.violations.filter(v => ['serious', 'critical'].includes(v.impact))"
                        ".map(v => v.id + ': ' + v.nodes.map(n => n.target).slice(0, 3).join(' ')))")  # fmt: skip
    assert found == []


@needs_zig
def test_an_effect_of_ones_own_gets_sliders_and_is_not_hidden(tmp_path: Path) -> None:
    text = (ROOT / "docs" / "howto" / "effect.md").read_text()
    source = re.search(r"```python\n(.*?)```", text, re.S)
    assert source
    (tmp_path / "own_spring.py").write_text(source[1])
    page = gt.play(effects=[tmp_path]).save(tmp_path / "out") / "play.html"
    data = held(page)
    assert data["sliders"]["own_spring"]
    assert "own_spring" not in {hidden["effect"] for hidden in data["hideable"]}
    assert data["fingerprint"]["done"] == STEPS


def test_without_zig_it_says_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    find = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None if name == "ziglang" else find(name))
    with pytest.raises(gt.InputError, match=r"to compile for it takes zig; `pip install gyrotwin\[zig\]`"):
        build_module(MODEL, tmp_path)
    assert not list(tmp_path.rglob("*.wasm"))


@needs_zig
def test_the_module_is_compiled_once_for_a_model(tmp_path: Path) -> None:
    path = build_module(MODEL, tmp_path)
    first = path.stat().st_mtime_ns
    assert build_module(MODEL, tmp_path).stat().st_mtime_ns == first
    path.write_bytes(path.read_bytes()[:1000])
    assert build_module(MODEL, tmp_path).stat().st_size > 1000
    assert [p.name for p in path.parent.iterdir()] == [path.name]


@needs_zig
def test_the_command_says_at_once_what_it_does_and_where_the_page_is(tmp_path: Path) -> None:
    command = [sys.executable, "-u", "-m", "gyrotwin", "play", "--device", "reference", "--out", "there"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, env=environment())
    assert done.returncode == 0, done.stderr
    assert re.search(r"there.play\.html: \d{3} kB", done.stdout)
    assert held(tmp_path / "there" / "play.html")["device"] == "reference"
    refused = subprocess.run([*command[:-4], "--device", "no_such"], cwd=tmp_path, capture_output=True, text=True,
                             env=environment())  # fmt: skip
    assert refused.returncode == 2 and "no_such" in refused.stderr
