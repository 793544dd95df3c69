"""Pages in headless Chromium: no error, nothing past its column, fit for paper, phones and screen readers."""

import html
import json
import re
import subprocess
import tempfile
from pathlib import Path

import pytest

import gyrotwin as gt
from benchmarks.pages import FLAGS, browser, simulated_fleet
from calibration.datasheet.figure import Figure, Outcome
from calibration.datasheet.measure import Test as Measured
from calibration.datasheet.procedure import RATE, Procedure
from gyrotwin.datasheet_result import DatasheetResult

ROOT = Path(__file__).parents[2]
AXE = ROOT / "node_modules" / "axe-core" / "axe.min.js"
LARGEST_PAGE = 1.6e6
"""Bytes: 1.12 MB of them are the script that draws."""
PROBE = """
<script>
addEventListener("load", () => setTimeout(async () => {
  const wide = document.documentElement;
  const past = [...document.querySelectorAll("section")].filter(box => box.scrollWidth > box.clientWidth + 1)
    .map(box => box.innerText.slice(0, 40));
  const found = {drawn: wide.dataset.drawn, plots: document.querySelectorAll(".panel > .plot-container").length,
    panels: document.querySelectorAll(".panel").length, past, width: wide.scrollWidth, window: innerWidth,
    empty: [...document.querySelectorAll(".panel")].filter(p => !p.querySelector(".trace, image, .textpoint")).length};
  found.unseen = [...document.querySelectorAll(".scroll tr")].filter(row => row.cells.length > 1 &&
    row.cells[1].getBoundingClientRect().right > row.closest(".scroll").getBoundingClientRect().right + 1)
    .map(row => row.innerText);
  if (window.axe) found.axe = (await axe.run()).violations.filter(v => ["serious", "critical"].includes(v.impact))
    .map(v => v.id + ": " + v.nodes.map(n => n.target).slice(0, 3).join(" "));
  const out = document.createElement("pre"); out.id = "probe"; out.textContent = JSON.stringify(found);
  document.body.append(out);
}, 500));
</script>
"""

needs_browser = pytest.mark.skipif(browser() is None, reason="needs Chromium")


@pytest.fixture(scope="module")
def pages(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("pages")
    runs = [gt.run("constant", seed=seed, duration=0.2).save(folder / f"run{seed}") for seed in (1, 2)]
    rate = gt.rate(plant="envelope", duration=30, rate_step=100, rate_period=10, temperature=(0.0, 10.0, 20.0))
    saved = {
        "run": runs[0],
        "rate": rate.save(folder / "rate"),
        "compare": gt.compare(*runs).save(folder / "compare"),
        "fleet": simulated_fleet().save(folder / "fleet"),
    }
    return {name: where / "report.html" for name, where in saved.items()}


def look(page: Path, *flags: str, script: str = "") -> tuple[dict, list[str]]:
    """What the probe finds on the page, and what the console says."""
    copy = page.with_name("probed.html")
    copy.write_text(page.read_text().replace("</body>", f"{script}{PROBE}</body>"))
    command = browser()
    assert command is not None
    with tempfile.TemporaryDirectory() as profile:
        done = subprocess.run(
            [command, *FLAGS, f"--user-data-dir={profile}", "--enable-logging=stderr", "--virtual-time-budget=20000",
             *flags, "--dump-dom", copy.as_uri()],
            capture_output=True, text=True, timeout=120,
        )  # fmt: skip
    copy.unlink()
    shown = re.search(r'<pre id="probe">(.*?)</pre>', done.stdout, re.S)
    assert shown, done.stderr[-500:]
    said = [line for line in done.stderr.splitlines() if "CONSOLE" in line]
    return json.loads(html.unescape(shown.group(1))), said


@needs_browser
@pytest.mark.parametrize("name", ["run", "rate", "compare", "fleet"])
@pytest.mark.parametrize(
    "flags",
    [("--window-size=1200,900",), ("--window-size=1200,900", "--blink-settings=preferredColorScheme=0"),
     ("--window-size=500,900",)],
    ids=["light", "dark", "phone"],
)  # fmt: skip
def test_a_page_is_drawn_without_an_error_and_within_its_columns(
    pages: dict[str, Path], name: str, flags: tuple[str, ...]
) -> None:
    found, said = look(pages[name], *flags)
    assert said == []
    assert found["drawn"] == "yes"
    assert found["plots"] == found["panels"] > 0
    assert found["empty"] == 0
    assert found["past"] == []
    assert found["width"] <= found["window"]


PHONE = '<script>document.body.style.width = "390px"</script>'
"""Chromium's narrowest window has 500 pixels."""


@needs_browser
@pytest.mark.parametrize("name", ["run", "rate", "compare", "fleet", "datasheet"])
def test_a_phone_shows_the_first_value_of_every_row(pages: dict[str, Path], name: str, tmp_path: Path) -> None:
    page = pages.get(name) or long_datasheet(tmp_path)
    found, _ = look(page, "--window-size=500,900", script=PHONE)
    assert found["unseen"] == []


def long_datasheet(folder: Path) -> Path:
    """A page of a datasheet with the longest names and values that there are."""
    figures = [
        Figure("a", "nominal scale factor of the sense channel", 4999.819473, "ppm of full scale", 3.1e-7, 5, 4999.8,
               "harmonic balance of the settled device"),
        Figure("b", "scale factor after warming less that after cooling", -0.3, "ppm", 1.7),
    ]  # fmt: skip
    procedure = Procedure("Scale factor", "12.9", RATE, lambda bench: Outcome(figures))
    head = {"device": "long", "mode": "rate-open", "standard": "IEEE Std 1431-2004", "design": None, "seed": 1,
            "plan": "quick", "plant": {"long_tests": "envelope", "note": ""}}  # fmt: skip
    return DatasheetResult(head, [Measured("scale_factor", procedure, Outcome(figures))]).save(folder) / "report.html"


@pytest.mark.parametrize("name", ["run", "rate", "compare", "fleet"])
def test_a_page_is_small_and_asks_no_network(pages: dict[str, Path], name: str) -> None:
    text = pages[name].read_text()
    assert len(text.encode()) < LARGEST_PAGE
    drawing = (ROOT / "gyrotwin" / "assets" / "plotly-basic.min.js").read_text()
    assert drawing in text
    assert not re.search(r"""(?:src|href)=["']https?:|@import|url\(""", text.replace(drawing, ""))


@needs_browser
@pytest.mark.skipif(not AXE.is_file(), reason="needs axe-core: npm install")
@pytest.mark.parametrize("name", ["run", "rate", "compare", "fleet"])
@pytest.mark.parametrize("flags", [(), ("--blink-settings=preferredColorScheme=0",)], ids=["light", "dark"])
def test_axe_finds_no_serious_fault(pages: dict[str, Path], name: str, flags: tuple[str, ...]) -> None:
    found, _ = look(pages[name], *flags, script=f"<script>{AXE.read_text()}</script>")
    assert found["axe"] == []


@needs_browser
def test_a_page_prints_on_a4(pages: dict[str, Path], tmp_path: Path) -> None:
    command = browser()
    assert command is not None
    paper = tmp_path / "run.pdf"
    subprocess.run(
        [command, *FLAGS, f"--user-data-dir={tmp_path / 'profile'}", f"--print-to-pdf={paper}",
         "--no-pdf-header-footer", pages["run"].as_uri()],
        check=True, capture_output=True, timeout=120,
    )  # fmt: skip
    boxes = re.findall(rb"/MediaBox \[0 0 ([\d.]+) ([\d.]+)\]", paper.read_bytes())
    assert boxes
    # A4 in points, as whole numbers or with decimals.
    assert all(abs(float(w) - 595) < 1.5 and abs(float(h) - 842) < 1.5 for w, h in boxes)
