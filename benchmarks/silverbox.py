"""What a diagnosis makes of a measured set: the Silverbox, an electronic oscillator with a cubic spring (Wigren and
Schoukens, nonlinearbenchmark.org), one axis, input recorded and not held."""

import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from benchmarks.report import NONE, Options, Report, Row, Table, load, row
from benchmarks.silverbox_bound import at_once
from discrepancy.data.dataset import Dataset, load_dataset
from discrepancy.data.record import Floats
from discrepancy.fit.measures import start_fitted
from discrepancy.fit.simulate import Simulator
from gyro_model.build import build
from gyro_model.device import load_device
from gyro_model.errors import InputError
from gyro_model.model import Model, load_model
from gyrotwin.numbers import significant

SET: Final = Path(__file__).parents[2] / "shared" / "examples" / "silverbox"
MULTISINE, ARROW = "test-multisine.csv.gz", "test-arrow.csv.gz"
HEAD: Final = 32_000
"""Samples of the arrow that stay within the amplitudes of the fit."""
TARGETS: Final = {"test-multisine": 0.195, "test-arrow": 0.25, f"test-arrow, first {HEAD}": 0.195}
"""Of the rms of simulated minus measured output [mV]."""
ELSEWHERE: Final = {
    "test-multisine": "cubic alone 0.303, with two damping terms 0.235 (a trial)",
    "test-arrow": "cubic alone 0.390, with two damping terms 0.302; neural model quoted 1.4",
    f"test-arrow, first {HEAD}": "cubic alone 0.315, with two damping terms 0.226; neural model quoted 0.32",
}
MEMORY: Final = 2000.0
"""Target [MB]."""
TIME: Final = 120.0
"""Target [s] on 2 idle cores."""

# A small process in between: the peak of a child counts from that of the process that made it.
_USED: Final = (
    "import resource, subprocess, sys; subprocess.run(sys.argv[1:], check=True, stdout=subprocess.DEVNULL); "
    "used = resource.getrusage(resource.RUSAGE_CHILDREN); print(used.ru_maxrss, used.ru_utime + used.ru_stime)"
)


def diagnosed(out: Path, jobs: int) -> dict[str, float]:
    """Runs ``gyrotwin diagnose`` as a process of its own into ``out``; its time [s], processor time [s] and peak
    memory [MB]."""
    arguments = [sys.executable, "-m", "gyrotwin", "diagnose", str(SET), "--out", str(out), "--jobs", str(jobs)]
    began = time.perf_counter()
    result = subprocess.run([sys.executable, "-c", _USED, *arguments], capture_output=True, text=True, check=False)
    wall = time.perf_counter() - began
    if result.returncode != 0:
        raise InputError(f"benchmark run failed: {result.stderr.strip()[-300:]}")
    peak, processor = result.stdout.split()
    return {"wall": wall, "processor": float(processor), "memory": int(peak) * 1.024e-3}


def improved(folder: Path) -> Model:
    """The model with the effects that a diagnosis wrote into ``folder``."""
    return load_model(*([folder / "effects"] if (folder / "effects").is_dir() else []))


def residuals(folder: Path, data: Dataset) -> dict[str, Floats]:
    """What the improved model in ``folder`` leaves of each held-out run [V], NaN in the start that gives its initial
    state."""
    model = improved(folder)
    noise = {q.name for effect in model.effects if effect.noise for q in effect.sizes}
    device = load_device(str(folder / "device.toml"), model).parameters
    parameters = {name: value for name, value in device.items() if name not in noise}
    left = {}
    with Simulator(model) as simulator:
        for run in data.held_out:
            residual, start = start_fitted(simulator, run, parameters)
            residual[:start] = np.nan
            left[run.name] = residual[:, 0]
    return left


def _parts(left: Mapping[str, Floats]) -> dict[str, Floats]:
    return dict(zip(TARGETS, (left[MULTISINE], left[ARROW], left[ARROW][:HEAD]), strict=True))


def bound_rows(left: Mapping[str, Floats]) -> list[Row]:
    """The rms of what all effects and terms at once leave."""
    runs = {"the run to fit": left[""], **_parts(left)}
    return [row(name, "mV", {"measured": 1e3 * float(np.sqrt(np.mean(part[50:] ** 2)))}) for name, part in runs.items()]


def misfit_rows(left: Mapping[str, Floats]) -> list[Row]:
    """The rms of what is left, beside the targets."""
    parts = _parts(left)
    return [
        row(
            name,
            "mV",
            {"measured": 1e3 * float(np.sqrt(np.nanmean(part**2)))},
            limit=TARGETS[name],
            note=ELSEWHERE[name],
        )
        for name, part in parts.items()
    ]


def effect_rows(effects: Sequence[Mapping[str, Any]]) -> list[Row]:
    """Each parameter of what was named, in the order of naming."""
    return [
        row(f"{place}. {effect['id']}: {name}", p["unit"], {"value": p["value"], "low": p["low"], "high": p["high"]},
            note=effect.get("force_x", "") + (f"; or {', '.join(effect['either'])}" if effect["either"] else ""))
        for place, effect in enumerate(effects, 1)
        for name, p in effect["parameters"].items()
    ]  # fmt: skip


def run(options: Options) -> Report:
    """One diagnosis. Raises InputError where the measured set is absent."""
    if not SET.is_dir():
        raise InputError(f"the measured set {SET.name} is absent: put it beside the project, in shared/examples")
    before = load()
    build()
    data = load_dataset(SET)
    with tempfile.TemporaryDirectory(prefix="gyrotwin-") as folder:
        out = Path(folder) / "out"
        used = diagnosed(out, options.jobs)
        report = json.loads((out / "report.json").read_text(encoding="utf-8"))
        left = residuals(out, data)
        bound = at_once(out, improved(out), data, report["effects"])
    order = [effect["id"] for effect in report["effects"]]
    place = order.index("cubic_stiffness") + 1 if "cubic_stiffness" in order else np.inf
    rows = [
        *misfit_rows(left),
        row("place of cubic_stiffness among the effects named", "1", {"measured": place}, limit=1),
        row("time from start to exit", "s", {"measured": used["wall"]}, limit=TIME, note="on idle cores"),
        row("processor time", "s", {"measured": used["processor"]}),
        row("peak memory", "MB", {"measured": used["memory"]}, limit=MEMORY),
    ]
    notes = [
        f"`gyrotwin diagnose` on the set as it is, verdict: {report['verdict']}; named: {', '.join(order) or NONE}.",
        "The held-out runs score from sample 50 on. Of rms(v), "
        + ", ".join(f"{stage} {significant(report['misfit'][stage])}" for stage in ("nominal", "refit", "final"))
        + ".",
        "Before: " + before,
        "After: " + load(),
    ]
    tables = [Table("rms of simulated minus measured output on held-out runs", rows),
              Table("named", effect_rows(report["effects"])),
              Table("all effects and terms at once, to first order", bound_rows(bound))]  # fmt: skip
    return Report("silverbox", "Silverbox: a measured set", tables, notes)
