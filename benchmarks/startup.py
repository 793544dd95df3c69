"""How long a start takes, with and without the cache of compiled code, and the memory of a long run."""

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np

from benchmarks.report import Options, Report, Row, Table, load, row
from gyro_model.build import build
from gyro_model.errors import InputError
from gyrotwin.tasks.run import NOT_VALID

SHORT: Final = 0.01
"""Of the run that shows a start [s]: two hundredths of a second of work."""
LONG: Final = 10.0
COLD, SECOND = 8.0, 3.0
"""Targets [s]."""
MEMORY: Final = 500.0
"""Target [MB]."""
REPEATS: Final = 5
COLD_REPEATS: Final = 3

# A small process in between: the peak of a child counts from that of the process that made it.
_PEAK: Final = (
    "import resource, subprocess, sys; code = subprocess.run(sys.argv[1:], stdout=subprocess.DEVNULL).returncode; "
    f"sys.exit(code) if code not in (0, {NOT_VALID}) else "
    "print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)"
)


def command(scenario: str, observer: str, duration: float, out: Path) -> list[str]:
    """The command line of a run."""
    return [sys.executable, "-m", "gyrotwin", "run", scenario, "--observer", observer, "--duration", str(duration),
            "--out", str(out)]  # fmt: skip


def start_times(repeats: int, cold_repeats: int) -> dict[str, list[float]]:
    """Times [s] of a short run in a process of its own: ``cold`` where nothing but the FMUs has been compiled,
    ``second`` where all has."""
    times: dict[str, list[float]] = {"cold": [], "second": []}
    for _ in range(cold_repeats):
        with tempfile.TemporaryDirectory(prefix="gyrotwin-") as folder:
            _run([sys.executable, "-m", "gyrotwin", "build"], _environment(Path(folder)))
            times["cold"].append(_timed(Path(folder)))
            share = repeats // cold_repeats + 1
            times["second"] += [_timed(Path(folder)) for _ in range(share)]
    return times


def _timed(folder: Path) -> float:
    began = time.perf_counter()
    _run(command("constant", "ekf", SHORT, folder / "out"), _environment(folder), (0, NOT_VALID))
    return time.perf_counter() - began


def _environment(folder: Path) -> dict[str, str]:
    """All caches below ``folder``."""
    cache = {name: str(folder / "cache") for name in ("XDG_CACHE_HOME", "LOCALAPPDATA", "NUMBA_CACHE_DIR")}
    return {**os.environ, **cache, "HOME": str(folder)} if sys.platform == "darwin" else {**os.environ, **cache}


def _run(arguments: Sequence[str], environment: dict[str, str], good: Sequence[int] = (0,)) -> str:
    result = subprocess.run(arguments, env=environment, capture_output=True, text=True, check=False)
    if result.returncode not in good:
        raise InputError(f"benchmark run failed: {result.stderr.strip()[-300:]}")
    return result.stdout


def peak_memory(observer: str, duration: float) -> float:
    """Peak resident memory [MB] of a run with its report."""
    with tempfile.TemporaryDirectory(prefix="gyrotwin-") as folder:
        arguments = command("constant", observer, duration, Path(folder))
        peak = int(_run([sys.executable, "-c", _PEAK, *arguments], dict(os.environ)))
    return peak / (1e6 if sys.platform == "darwin" else 1e3) * (1.0 if sys.platform == "darwin" else 1.024)


def memory_rows(duration: float, observers: Sequence[str] = ("ekf", "lyapunov")) -> list[Row]:
    """Peak memory by observer."""
    if sys.platform == "win32":
        return [row("peak memory", "MB", {"measured": np.nan}, note="skipped: Windows has no resource module")]
    return [
        row(f"{name}: peak memory, run of {lasts:g} s with report", "MB", {"measured": peak_memory(name, lasts)},
            limit=MEMORY if lasts == duration else None)
        for name in observers
        for lasts in dict.fromkeys((duration, SHORT))
    ]  # fmt: skip


def build_time() -> float:
    """Time [s] to generate, compile and pack both FMUs."""
    with tempfile.TemporaryDirectory(prefix="gyrotwin-") as folder:
        began = time.perf_counter()
        build(folder=Path(folder), force=True)
        return time.perf_counter() - began


def run(options: Options) -> Report:
    """Starts, one at a time, and the memory of a 10 s run."""
    before = load()
    build()
    times = start_times(REPEATS, COLD_REPEATS)
    rows = [
        row(f"{name} start", "s", {"least": min(times[name]), "median": float(np.median(times[name]))}, limit=limit)
        for name, limit in (("cold", COLD), ("second", SECOND))
    ]
    once = build_time()
    rows.append(row("both FMUs built", "s", {"least": once, "median": once}, note="once; what a fresh machine adds"))
    notes = [
        f"`gyrotwin run constant --duration {SHORT:g}` as a process of its own, from start to exit, report included.",
        f"Cold: the caches are empty but for the FMUs; {COLD_REPEATS} times. Second: the same folder "
        f"again; {len(times['second'])} times.",
        "Before: " + before,
        "After: " + load(),
    ]
    tables = [Table("start", rows), Table("memory", memory_rows(LONG))]
    return Report("startup", "Start and memory", tables, notes)
