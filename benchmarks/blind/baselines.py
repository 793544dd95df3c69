"""What others would do with the same data: a sparse regression on smoothed derivatives (SINDy). The refit of the
nominal model alone stands in every result as its own misfit."""

import importlib
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
import polars as pl
from scipy.signal import savgol_filter

from benchmarks.blind.runner import data_folder
from benchmarks.report import Row, Table
from gyro_model.errors import InputError

NOMINAL: Final = ("x", "y", "x_dot", "y_dot", "u_x", "u_y")
"""Columns of the linear device, which are no missing effect."""
THRESHOLDS: Final = tuple(10.0**e for e in range(-6, -1))
"""Where STLSQ cuts, all columns of rms 1; of these the one with the fewest terms whose error on the held-out run is
within NEAR of the best: as favourable as one can be without knowing the answer."""
NEAR: Final = 1.01
WINDOW, ORDER = 9, 5
"""Savitzky–Golay: 9 samples of 5 µs are an eighth of a period at 3 kHz."""
EVERY: Final = 4
"""Samples used of the derivatives' grid."""
AS_TERM: Final = {
    "cubic_stiffness": {"x x x", "y y y"},
    "quadratic_stiffness": {"x x", "y y"},
    "nonlinear_damping": {"x x x_dot", "y y y_dot"},
}
"""The effects that are products of states, and could be read off the terms; no other has a column at all."""


def sparse_regression(results: Sequence[Mapping[str, Any]], folder: Path, count: int) -> Table:
    """SINDy with products of states and forces up to the third degree on ``count`` of the trials; singles first, one
    an effect. Raises InputError where pysindy is not installed."""
    try:
        pysindy = importlib.import_module("pysindy")
    except ImportError:
        raise InputError("the baseline needs pysindy: install it, or leave --baselines away") from None
    chosen = [r for r in results if "label" in r and r["kind"] in ("single", "null", "unknown")]
    chosen = sorted(chosen, key=lambda r: (r["id"].rpartition("-")[2], r["id"]))[:count]
    rows = []
    for result in chosen:
        data = data_folder(folder, result["id"])
        if list(data.glob("*.parquet")):
            rows.append(_row(result, _terms(pysindy, data)))
    return Table("baseline: SINDy on smoothed derivatives", rows)


def _row(result: Mapping[str, Any], terms: set[str]) -> Row:
    truth = result["label"]["effects"]
    wanted = AS_TERM.get(truth[0], set()) if len(truth) == 1 else set()
    named = bool(wanted) and bool(terms) and terms <= wanted
    note = "the name follows" if named else "nothing, as is right" if not truth and not terms else "no name follows"
    return Row(result["id"], "1", {"terms": float(len(terms))}, note=note)


def _terms(pysindy: Any, data: Path) -> set[str]:
    """Terms beside those of the linear device in either equation of motion, from all fitted runs."""
    content = tomllib.loads((data / "dataset.toml").read_text(encoding="utf-8"))
    parts: dict[bool, list[tuple[np.ndarray, np.ndarray]]] = {False: [], True: []}
    for run in content["run"]:
        held_out = run.get("role") == "held-out"
        parts[held_out].append(_derivatives(data / run["file"], float(run["sample_rate"]), content["nominal"]))
    (z, target), (z_test, target_test) = ([np.concatenate(p) for p in zip(*parts[h], strict=True)] for h in parts)
    library = pysindy.PolynomialLibrary(degree=3, include_bias=True)
    unit = np.sqrt(np.mean(z**2, axis=0))
    columns, test = (np.asarray(library.fit_transform(part / unit)) for part in (z, z_test))
    names = library.get_feature_names(list(NOMINAL))
    length, size = np.sqrt(np.mean(columns**2, axis=0)), np.sqrt(np.mean(target**2, axis=0))
    found = []
    for threshold in THRESHOLDS:
        optimizer = pysindy.STLSQ(threshold=threshold, alpha=1e-12)
        coefficients = np.atleast_2d(optimizer.fit(columns / length, target / size).coef_)
        error = float(np.linalg.norm(test / length @ coefficients.T - target_test / size))
        active = np.abs(coefficients).max(axis=0) > 0
        terms = {_product(name) for name, on in zip(names, active, strict=True) if on and name not in NOMINAL}
        found.append((error, terms))
    best = min(error for error, _ in found)
    return min((terms for error, terms in found if error <= NEAR * best), key=len)


def _product(name: str) -> str:
    """``x^2 x_dot`` as ``x x x_dot``."""
    factors = []
    for part in name.split():
        base, _, power = part.partition("^")
        factors += [base] * int(power or 1)
    return " ".join(sorted(factors))


def _derivatives(file: Path, rate: float, nominal: Mapping[str, float]) -> tuple[np.ndarray, np.ndarray]:
    """Smoothed x, y, x', y', u_x, u_y and x'', y'' of a run; u between two samples is the mean of what was held."""
    table = pl.read_parquet(file)
    q = np.stack([table[f"v_{a}"].to_numpy() / nominal[f"sense_gain_{a}"] for a in "xy"], axis=1)
    d = [savgol_filter(q, WINDOW, ORDER, deriv=k, delta=1 / rate, axis=0) for k in range(3)]
    u = np.stack([table["u_x"].to_numpy(), table["u_y"].to_numpy()], axis=1)
    u[1:] = 0.5 * (u[1:] + u[:-1])
    use = slice(WINDOW, -WINDOW, EVERY)
    return np.hstack([d[0], d[1], u])[use], d[2][use]
