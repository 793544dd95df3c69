"""Every command of README and docs runs, in the order of its page, in an empty folder."""

import os
import re
import shlex
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import polars as pl
import pytest

from gyrotwin.tasks.run import NOT_VALID
from tests.docs.documented import PAGES, ROOT, commands

pytestmark = pytest.mark.minutes(17)

# What a page asks of its reader, or of a machine, that a test can't give.
ELSEWHERE = {
    "gyrotwin build --platforms all": "minutes of zig: tests/gyro_model/test_platforms.py builds them",
    "gyrotwin sweep plan.toml --scheduler tcp://host:8786": "tests/gyrotwin/sweeping starts a scheduler",
}
# Words added to a command, since it takes a minute and more without them.
SHORTER = {
    "gyrotwin datasheet rate-mode --mode rate-closed": "--quick",
    "gyrotwin datasheet whole_angle": "--quick",
    "gyrotwin datasheet rate-mode --design": "--quick",
    # In full it runs on the page of the datasheet, which takes some minutes.
    "gyrotwin datasheet rate-mode --out results/datasheet": "--quick",
    "gyrotwin datasheet disk_serrano_2016": "--quick",
}


def test_what_runs_elsewhere_stands_on_a_page() -> None:
    every = {text for page in PAGES for text in commands(page)}
    assert set(ELSEWHERE) <= every
    assert all(any(text.startswith(begin) for text in every) for begin in SHORTER)


def typed(text: str, folder: Path) -> subprocess.CompletedProcess[str]:
    """A command as a process of its own, in ``folder``. A browser that it opens is none."""
    words = [word for begin, word in SHORTER.items() if text.startswith(begin)]
    command = [sys.executable, "-m", *shlex.split(text), *words]
    quiet = os.environ | {"BROWSER": "true", "PYTHONPATH": str(ROOT)}
    return subprocess.run(command, cwd=folder, env=quiet, stdin=subprocess.DEVNULL, capture_output=True, text=True,
                          check=False)  # fmt: skip


def block(page: str, language: str, number: int = 0) -> str:
    text = (ROOT / "docs" / page).read_text(encoding="utf-8")
    return re.findall(rf"```{language}\n(.*?)```", text, re.S)[number]


def simulated(folder: Path, name: str) -> Path:
    made = typed(f"gyrotwin dataset simulate {name} --samples 2000 --set k3_x=2e9", folder)
    assert made.returncode == 0, made.stderr
    return folder / name


def a_wafer(folder: Path) -> None:
    for die in ("die-1", "die-2"):
        simulated(folder, f"wafer/{die}")


def a_record(folder: Path) -> None:
    a_wafer(folder)
    pl.read_parquet(simulated(folder, "source") / "run-01.parquet").write_csv(folder / "measured.csv")


def a_plan(page: str) -> Callable[[Path], None]:
    def given(folder: Path) -> None:
        (folder / "plan.toml").write_text(block(page, "toml"))
        if page == "howto/sweep.md":
            (folder / "task.py").write_text(block(page, "python"))

    return given


def an_effect(folder: Path) -> None:
    (folder / "my_effects").mkdir()
    (folder / "my_effects" / "own_spring.py").write_text(block("howto/effect.md", "python"))


def an_observer(folder: Path) -> None:
    (folder / "mine.py").write_text(block("howto/observer.md", "python"))


def a_scenario(folder: Path) -> None:
    text = (ROOT / "docs" / "scenarios.md").read_text(encoding="utf-8")
    begin, end = text.index("    format = 1"), text.index("- Inputs:")
    (folder / "my.toml").write_text("\n".join(line[4:] for line in text[begin:end].splitlines()))
    rows = "\n".join(f"{t / 10},{t % 7}" for t in range(600))
    (folder / "drive.csv").write_text(f"t [s],Gyro Z (deg/s)\n{rows}\n")


def a_design(folder: Path) -> None:
    (folder / "known.toml").write_text((ROOT / "gyro_model" / "devices" / "rate-mode.toml").read_text())


# What the reader of a page has before its first command.
GIVEN: dict[str, Callable[[Path], None]] = {
    "README.md": a_wafer,
    "diagnosis.md": a_wafer,
    "lab.md": a_record,
    "designer.md": a_plan("guides/designer.md"),
    "sweep.md": a_plan("howto/sweep.md"),
    "effect.md": an_effect,
    "observer.md": an_observer,
    "scenarios.md": a_scenario,
    "datasheet.md": a_design,
}


@pytest.mark.parametrize("page", [page for page in PAGES if commands(page)], ids=lambda page: page.name)
def test_the_commands_of_a_page_run(page: Path, tmp_path: Path) -> None:
    # README names a file of the checkout.
    (tmp_path / "cosim").symlink_to(ROOT / "cosim")
    GIVEN.get(page.name, lambda folder: None)(tmp_path)
    for text in commands(page):
        if text in ELSEWHERE:
            continue
        done = typed(text, tmp_path)
        # A run whose angle is not valid at its end is a run.
        good = (0, NOT_VALID) if text.startswith("gyrotwin run ") else (0,)
        assert done.returncode in good, f"{text}\n{done.stdout[-2000:]}\n{done.stderr[-2000:]}"
        assert "Traceback" not in done.stderr, text
