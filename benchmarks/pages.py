"""Pages of every command, and a contact sheet of their screenshots: `make pages`.

    python -m benchmarks.pages [FOLDER]

The pages are written to FOLDER (default build/pages) and opened in headless Chromium, light and dark, as a phone shows
them and as A4 paper does.
"""

import importlib.util
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Final

import numpy as np

import gyrotwin as gt
from discrepancy.tell.fleet import Estimate, Row, fleet
from gyrotwin.fleet_result import FleetResult

BROWSERS: Final = ("chromium", "chromium-browser", "google-chrome")
FLAGS: Final = (
    *("--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--hide-scrollbars"),
    *(
        "--disable-background-networking",
        "--disable-component-update",
        "--disable-sync",
        "--force-device-scale-factor=1",
    ),
)
VIEWS: Final = {
    "wide": ("--window-size=1200,2600",),
    "dark": ("--window-size=1200,2600", "--blink-settings=preferredColorScheme=0"),
    "phone": ("--window-size=500,3200", "--allow-file-access-from-files"),
}
PHONE: Final = 390
"""Pixels of a phone's width: a frame, as Chromium's narrowest window has 500."""


def browser() -> str | None:
    """The command of a Chromium; None where there is none."""
    return next((path for name in BROWSERS if (path := shutil.which(name))), None)


def shoot(page: Path, picture: Path, *flags: str) -> None:
    """Writes a screenshot, or with ``--print-to-pdf=`` among ``flags`` what that says."""
    command = browser()
    if command is None:
        raise gt.InputError(f"no browser: install one of {', '.join(BROWSERS)}")
    with tempfile.TemporaryDirectory() as profile:
        shown = () if any(flag.startswith("--print-to-pdf=") for flag in flags) else (f"--screenshot={picture}",)
        subprocess.run(
            [command, *FLAGS, f"--user-data-dir={profile}", "--virtual-time-budget=8000", *flags, *shown,
             page.resolve().as_uri()],
            check=True, capture_output=True, timeout=120,
        )  # fmt: skip


def results(folder: Path) -> Iterator[tuple[str, Path]]:
    """Writes one result of every kind; gives name and page."""
    run = gt.run("constant", seed=7, duration=0.3)
    yield "run", run.save(folder / "run") / "report.html"
    rate = gt.rate(plant="envelope", duration=600, rate_step=100, rate_period=40, temperature=(0.0, 50.0, 5.0))
    yield "rate", rate.save(folder / "rate") / "report.html"
    fitted = gt.compensate(folder / "rate" / "trace.parquet", method="piecewise")
    yield "compensate", fitted.save(folder / "compensate") / "report.html"
    rest = gt.rate(plant="envelope", duration=60, sense_record=1000).save(folder / "rest")
    yield "split", gt.split(rest / "sense.parquet").save(folder / "split") / "report.html"
    yield "track", gt.split(rest / "sense.parquet", track=10).save(folder / "track") / "report.html"
    matched = gt.match("mode_matched_as_built", design="mode_matched", duration=30)
    yield "match", matched.save(folder / "match") / "report.html"
    yield "datasheet", gt.datasheet("rate-mode", quick=True).save(folder / "datasheet") / "report.html"
    yield (
        "compare",
        gt.compare("reference", "tuning_fork", seeds=2, duration=0.2).save(folder / "compare") / "report.html",
    )
    trial = folder / "trial"
    shutil.rmtree(trial, ignore_errors=True)
    found = gt.diagnose(gt.simulate_dataset(trial, hidden={"k3_x": 4e9, "k3_y": 4e9}, samples=4000), max_effects=1)
    yield "diagnosis", found.save(folder / "diagnosis") / "report.html"
    yield "fleet", simulated_fleet().save(folder / "fleet") / "report.html"
    if importlib.util.find_spec("distributed"):
        task = folder / "task.py"
        task.write_text("def area(x, y):\n    return x * y\n")
        grids = {"x": {"grid": [1.0, 2.0, 3.0, 4.0]}, "y": {"grid": [0.5, 3.0, 5.0]}}
        plan = {"format": 1, "task": f"{task.resolve()}:area", "parameters": grids, "limits": {"value": [0, 10]}}
        yield "sweep", gt.sweep(plan, folder / "sweep", workers=1).folder / "report.html"
    if importlib.util.find_spec("ziglang"):
        yield "play", gt.play().save(folder / "play") / "play.html"


def simulated_fleet() -> FleetResult:
    """Forty devices as if diagnosed, with a gradient and one that does not belong."""
    rng = np.random.default_rng(1)
    rows, places = [], {}
    for k in range(40):
        name = f"die-{k:02d}"
        places[name] = float(k % 8)
        k3 = 3e9 - 1e8 * places[name] + 5e7 * rng.standard_normal() + (2e9 if k == 17 else 0.0)
        values = {"k3_x": Estimate(k3, 4e7, "N/m3"), "m": Estimate(1e-7 + 1e-9 * rng.standard_normal(), 1e-11, "kg")}
        effects = {"cubic_stiffness": ("k3_x",)}
        rows.append(Row(name, "missing effects", effects, values=values, misfit=2e-5, floor=2e-5))
    return FleetResult("wafer", fleet(rows, {"x [mm]": places}))


def _framed(page: Path) -> Path:
    """A page that shows ``page`` as wide as a phone."""
    frame = page.with_name("frame.html")
    style = f"width:{PHONE}px;height:3200px;border:0"
    frame.write_text(f'<!DOCTYPE html><body style="margin:0"><iframe src="{page.name}" style="{style}"></iframe>')
    return frame


def main(folder: Path) -> None:
    """Writes pages, screenshots and the contact sheet."""
    folder.mkdir(parents=True, exist_ok=True)
    cells = []
    for name, page in results(folder):
        for view, flags in VIEWS.items():
            picture = folder / f"{name}-{view}.png"
            shoot(_framed(page) if view == "phone" else page, picture, *flags)
            cells.append(
                f'<figure><img src="{picture.name}" width="380"><figcaption>{name}, {view}</figcaption></figure>'
            )
        shoot(page, folder / "unused.png", f"--print-to-pdf={folder / (name + '.pdf')}", "--no-pdf-header-footer")
        cells.append(f'<p><a href="{name}.pdf">{name} on A4</a></p>')
    sheet = folder / "index.html"
    style = "body{display:flex;flex-wrap:wrap;gap:12px;font-family:sans-serif}figure{margin:0}"
    sheet.write_text(f"<!DOCTYPE html><meta charset=utf-8><title>Pages</title><style>{style}</style>{''.join(cells)}")
    print(sheet)


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "build/pages"))
