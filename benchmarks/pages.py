"""Pages of every command, and a contact sheet of their screenshots: `make pages`.

    python -m benchmarks.pages [FOLDER]

The pages are written to FOLDER (default build/pages) and opened in headless Chromium, light and dark, as a phone shows
them and as A4 paper does.
"""

import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Final

import gyrotwin as gt

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
    "phone": ("--window-size=500,3200",),
}
"""Chromium's narrowest window is 500 pixels; narrower ones are tried by the tests in a frame."""


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
    rate = gt.rate(plant="envelope", duration=60, rate_step=100, rate_period=20, temperature=(0.0, 10.0, 10.0))
    yield "rate", rate.save(folder / "rate") / "report.html"
    yield (
        "compare",
        gt.compare("reference", "tuning_fork", seeds=2, duration=0.2).save(folder / "compare") / "report.html",
    )
    trial = folder / "trial"
    shutil.rmtree(trial, ignore_errors=True)
    found = gt.diagnose(gt.simulate_dataset(trial, hidden={"k3_x": 4e9, "k3_y": 4e9}, samples=4000), max_effects=1)
    yield "diagnosis", found.save(folder / "diagnosis") / "report.html"


def main(folder: Path) -> None:
    """Writes pages, screenshots and the contact sheet."""
    folder.mkdir(parents=True, exist_ok=True)
    cells = []
    for name, page in results(folder):
        for view, flags in VIEWS.items():
            picture = folder / f"{name}-{view}.png"
            shoot(page, picture, *flags)
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
