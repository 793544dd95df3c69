"""Devices, or finished runs, side by side."""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from statistics import fmean, stdev
from typing import Any, Final, NamedTuple

import numpy as np
import polars as pl

from gyro_model.device import Device
from gyro_model.errors import InputError
from gyrotwin.api import DeviceSource, Progress, load_device, run
from gyrotwin.figures import Figure, Panel, line
from gyrotwin.numbers import MISSING, with_error
from gyrotwin.results import Saved, Writer, write_json

FIGURES: Final = {
    "converged_at": ("converged at", "s"),
    "angle.rms_deg": ("angle error, rms", "°"),
    "angle.max_deg": ("angle error, largest", "°"),
    "angle.drift_deg_per_s": ("angle drift", "°/s"),
    "omega.rms_error": ("rate error, rms", "rad/s"),
    "predicted.drift_sigma_now_deg_per_s": ("drift predicted by the loop, 1 σ", "°/s"),
    "valid.share": ("share of the run with a valid angle", "1"),
    "bias_deg_s": ("bias", "°/s"),
    "scale_factor": ("scale factor", "1"),
    "quadrature_deg_s": ("quadrature", "°/s"),
}
"""Performance figures by their dotted name in summary.json: words and unit."""
ROLES: Final = ("estimate", "unit-A", "unit-C", "unit-B", "error")
"""Colours of overlaid runs, in order."""


class Number(NamedTuple):
    """A mean with its standard error; NaN where one run alone can't tell it."""

    value: float
    error: float


class Row(NamedTuple):
    """A quantity of every candidate; None where it has none."""

    name: str
    unit: str
    numbers: tuple[Number | None, ...]

    def difference(self, column: int) -> Number | None:
        """Candidate ``column`` less the first, with the standard error of the difference."""
        first, other = self.numbers[0], self.numbers[column]
        if first is None or other is None:
            return None
        return Number(other.value - first.value, math.hypot(first.error, other.error))


@dataclass(frozen=True)
class Comparison(Saved):
    """Candidates side by side; see `gyrotwin.compare`."""

    names: tuple[str, ...]
    rows: tuple[Row, ...] = field(repr=False)
    traces: tuple[pl.DataFrame | None, ...] = field(repr=False)
    """Of each candidate the trace of one run."""

    @property
    def summary(self) -> Mapping[str, Any]:
        """By quantity: unit, and value and standard error of each candidate."""

        def plain(number: Number | None) -> dict[str, float | None] | None:
            if number is None:
                return None
            return {key: v if math.isfinite(v) else None for key, v in number._asdict().items()}

        quantities = {r.name: {"unit": r.unit, "values": [plain(n) for n in r.numbers]} for r in self.rows}
        return {"candidates": list(self.names), "quantities": quantities}

    def figures(self) -> list[Figure]:
        """Errors of the angle and of the rate over time, overlaid."""
        panels = []
        for title, of in (("angle error [°]", _angle_error), ("rate error [rad/s]", _rate_error)):
            lines = [
                line(name, ROLES[k % len(ROLES)], trace["t"].to_numpy(), of(trace))
                for k, (name, trace) in enumerate(zip(self.names, self.traces, strict=True))
                if trace is not None and {"angle", "angle_true", "est_omega_z", "omega_true"} <= set(trace.columns)
            ]
            if lines:
                panels.append(Panel("t [s]", title, lines, wide=True))
        key = [(ROLES[k % len(ROLES)], name) for k, name in enumerate(self.names)]
        never = [
            name
            for name, trace in zip(self.names, self.traces, strict=True)
            if trace is not None and "angle" in trace.columns and not np.isfinite(trace["angle"].to_numpy()).any()
        ]
        text = "One run of each candidate, from convergence on."
        text += f" Never converged: {', '.join(never)}." if never else ""
        return [Figure("overlaid", "Errors over time", "", text, key, panels)] if panels else []

    def headline(self) -> Sequence[tuple[str, str]]:
        """Each quantity of all candidates."""
        return [(f"{r.name} [{r.unit}]", "  ".join(shown(n) for n in r.numbers)) for r in self.rows]

    def writers(self) -> Mapping[str, Writer]:
        """summary.json, report.html."""
        from gyrotwin.report import render_page

        return {
            "summary.json": write_json(self.summary),
            "report.html": lambda path: render_page(
                "compare.html.j2", path, self.figures(), names=self.names, rows=self.rows, text=shown
            ),
        }


def shown(number: Number | None) -> str:
    """A number with its standard error, or a dash."""
    if number is None:
        return MISSING
    return with_error(number.value, number.error)


def compare(
    *candidates: DeviceSource,
    scenario: str = "constant",
    seeds: int = 3,
    duration: float | None = None,
    progress: Progress | None = None,
) -> Comparison:
    """Put devices, or finished runs, side by side.

    Parameters
    ----------
    *candidates : str, Path or Device
        Devices, each run ``seeds`` times; or folders of finished runs, whose summary.json is read.
    scenario : str
        What devices go through.
    seeds : int
        Runs of a device, with seeds 1, 2, ...: their scatter is the noise of the differences.
    duration : float
        Seconds of a run; None: the scenario's.
    progress : callable
        Called with the runs done and all runs.

    Returns
    -------
    Comparison
        With ``rows``, ``summary``, ``figures()``, ``save(folder)``.

    Raises
    ------
    InputError
        If there are fewer than two candidates, or one is neither a device nor a folder of results.

    """
    if len(candidates) < 2:
        raise InputError(f"compare: {len(candidates)} candidate; name at least two devices or result folders")
    if not 1 <= seeds <= 1000:
        raise InputError(f"seeds = {seeds}: give 1 to 1000")
    names, tables, traces = [], [], []
    for k, candidate in enumerate(candidates):
        if not isinstance(candidate, Device) and Path(candidate).is_dir():
            folder = Path(candidate)
            names.append(folder.name)
            tables.append({name: Number(value, math.nan) for name, value in _finished(folder).items()})
            traces.append(pl.read_parquet(folder / "trace.parquet") if (folder / "trace.parquet").is_file() else None)
            continue
        device = load_device(candidate)
        results = []
        for seed in range(1, seeds + 1):
            results.append(run(scenario, device=device, seed=seed, duration=duration))
            if progress is not None:
                progress(k * seeds + seed, len(candidates) * seeds)
        names.append(device.name)
        tables.append(_device_rows(device) | _scattered([_figures(result.summary) for result in results]))
        traces.append(results[0].trace)
    order = [name for table in tables for name in table]
    units = {name: unit for name, unit in (*FIGURES.values(), *_DEVICE.items())}
    rows = [Row(n, units[n], tuple(table.get(n) for table in tables)) for n in dict.fromkeys(order)]
    return Comparison(tuple(names), tuple(rows), tuple(traces))


_DEVICE: Final = {
    "lower mode": "Hz",
    "upper mode": "Hz",
    "frequency split": "Hz",
    "Q of the lower mode": "1",
    "Q of the upper mode": "1",
    "mass": "kg",
    "pickoff gain": "V/m",
    "noise of the pickoff": "V",
}


def _device_rows(device: Device) -> dict[str, Number]:
    low, high = device.frequencies
    p = device.all_parameters
    values = (low, high, high - low, *device.quality_factors, p["m"], p["sense_gain_x"], p["sense_noise"])
    return {name: Number(float(value), 0.0) for name, value in zip(_DEVICE, values, strict=True)}


def _finished(folder: Path) -> dict[str, float]:
    path = folder / "summary.json"
    try:
        return _figures(json.loads(path.read_text(encoding="utf-8")))
    except (OSError, ValueError, RecursionError):
        raise InputError(f"result folder {folder}: no readable summary.json; name a folder that a run wrote") from None


def _figures(summary: Mapping[str, Any]) -> dict[str, float]:
    """The performance figures that a summary holds, by their words."""
    found = {}
    for dotted, (words, _) in FIGURES.items():
        value: Any = summary
        for key in dotted.split("."):
            value = value.get(key) if isinstance(value, Mapping) else None
        if isinstance(value, (int, float)):
            found[words] = float(value)
    return found


def _scattered(tables: Sequence[Mapping[str, float]]) -> dict[str, Number]:
    numbers = {}
    for name in dict.fromkeys(name for table in tables for name in table):
        values = [table[name] for table in tables if name in table]
        error = stdev(values) / math.sqrt(len(values)) if len(values) > 1 else math.nan
        numbers[name] = Number(fmean(values), error)
    return numbers


def _angle_error(trace: pl.DataFrame) -> Any:
    return np.rad2deg(trace["angle"].to_numpy() - trace["angle_true"].to_numpy())


def _rate_error(trace: pl.DataFrame) -> Any:
    error = trace["est_omega_z"].to_numpy() - trace["omega_true"].to_numpy()
    return np.where(np.isnan(trace["angle"].to_numpy()), np.nan, error)
