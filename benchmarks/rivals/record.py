"""A blind trial's data as regressions on equations of motion need them: states, forces and rate on a uniform grid."""

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
import polars as pl
from scipy.signal import savgol_filter

SIGNALS: Final = ("x", "y", "x_dot", "y_dot", "u_x", "u_y", "omega_z")
WINDOW, DEGREE = 17, 7
"""Savitzky–Golay: 17 samples of 5 µs are a quarter of a period at 3 kHz, the seventh degree follows it to 1e-6."""


class Run(NamedTuple):
    """t (n,) [s]; z (n, 7): SIGNALS, SI; acceleration (n, 2) [m/s²], by the same smoothing."""

    t: np.ndarray
    z: np.ndarray
    acceleration: np.ndarray


class Record(NamedTuple):
    """The runs that a model is fitted to, and those it is judged by."""

    fitted: tuple[Run, ...]
    held_out: tuple[Run, ...]

    @property
    def units(self) -> np.ndarray:
        """The rms of each signal in the fitted runs (7,), 1 where there is none."""
        rms = np.sqrt(np.mean(np.concatenate([run.z for run in self.fitted]) ** 2, axis=0))
        return np.where(rms > 0, rms, 1.0)


def read(data: Path) -> Record:
    """The trial in the folder ``data``, its voltages smoothed."""
    content = tomllib.loads((data / "dataset.toml").read_text(encoding="utf-8"))
    parts: dict[bool, list[Run]] = {False: [], True: []}
    for run in content["run"]:
        parts[run.get("role") == "held-out"].append(_run(data, run, content["nominal"]))
    return Record(tuple(parts[False]), tuple(parts[True]))


def _run(data: Path, run: Mapping[str, Any], nominal: Mapping[str, float]) -> Run:
    table = pl.read_parquet(data / run["file"])
    q = np.stack([table[f"v_{a}"].to_numpy() / nominal[f"sense_gain_{a}"] for a in "xy"], axis=1)
    rate = float(run["sample_rate"])
    d = [savgol_filter(q, WINDOW, DEGREE, deriv=k, delta=1 / rate, axis=0) for k in range(3)]
    u = np.stack([table["u_x"].to_numpy(), table["u_y"].to_numpy()], axis=1)
    # A force is held from each sample to the next: at the sample the mean of both sides is right to second order.
    u[1:] = 0.5 * (u[1:] + u[:-1])
    omega = table["omega_z"].to_numpy() if "omega_z" in table.columns else np.zeros(len(q))
    use = slice(WINDOW, -WINDOW)
    return Run(np.arange(len(q))[use] / rate, np.column_stack([d[0], d[1], u, omega])[use], d[2][use])
