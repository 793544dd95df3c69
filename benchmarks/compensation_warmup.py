"""A measured warm-up: what compensation leaves of it, and whether any function of its temperatures would leave less."""

from collections.abc import Iterator
from itertools import combinations, product
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.report import Table, row
from calibration.compensation.cycles import MEMORY, covered, hold_outs, last_cycle, memory_of
from calibration.compensation.methods.method import Asked
from calibration.compensation.record import CIRCUIT, RATE_OF, STRUCTURE, Blocks, Floats, make_blocks
from calibration.compensation.trial import trial
from gyrotwin.compensate_record import read_test

Chosen = NDArray[np.bool_]

WARMUP: Final = Path(__file__).parents[2] / "shared" / "data" / "warmup" / "Tempdata01-02-14.csv.gz"
MAPS: Final = ("t=Time", "sensor_structure=dTemp", "sensor_circuit=Temp")
SCALES: Final = ("t=ms", "rate=counts", "sensor_structure=0.00294117647,309.68", "sensor_circuit=degC")
BLOCK: Final = 10.2
"""300 samples [s]."""
PLATEAU: Final = 1500.0
"""The end of the warm-up, over which the die moves by 0.2 °C in 100 s [s]."""
WANDER: Final = 10
"""Blocks averaged where white noise no longer counts: 100 s."""
REACH: Final = {"Gx": 0.05, "Gz": 0.05}
"""What is asked for [counts]: about the white noise of a block."""
DEGREES: Final = (1, 2, 3, 4)
LAGS: Final = (30.0, 60.0, 120.0, 240.0, 480.0, 900.0)
"""First-order lags of the board's temperature [s]."""
RIDGES: Final = (1e-8, 1e-4, 1e-2)
"""Of the variance of a column."""
NEIGHBOURS: Final = 2

NOTES: Final = (
    "Measured: white noise σ_w of a block, by the scatter within it; wander σ_b: Hadamard deviation "
    "√(<(b₂ - 2b₁ + b₀)²>/6) of means over 100 s of the last 25 min, where the die moves evenly by 0.2 °C in 100 s. No "
    "function of temperature removes either: the bound is √(σ_w² + σ_b²), and 0.05 counts is below it.",
    "Wide search: ridge regressions on polynomials of die, board or both, their rates, up to two lags of the board, "
    "chosen by cross-validation on the parts fitted; its least: the best of them on the held-out parts, which "
    "flatters. Neighbours: means of two blocks on either side after a cubic in the die's temperature; no compensation, "
    "but it says how much of the bias lasts 50 s.",
)


def warmup_table() -> Table:
    """One row an axis."""
    rows = []
    for axis in ("Gx", "Gy", "Gz"):
        blocks = make_blocks(read_test(WARMUP, (*MAPS, f"rate={axis}"), SCALES), BLOCK, 0.0)
        values = {}
        for name, sensor in (("die", STRUCTURE), ("board", CIRCUIT)):
            asked = Asked("piecewise", sensor=sensor, sampling_time=BLOCK)
            values[name] = trial(blocks, None, asked, "clamp").judged[0].held_out.rms
        for name in ("spline", "history"):
            asked = Asked(name, sampling_time=BLOCK)
            values[f"both, {name}"] = trial(blocks, None, asked, "clamp").judged[0].held_out.rms
        searched = widest_search(blocks)
        values |= {"wide search": searched.chosen, "its least": searched.least}
        values["neighbours in time"] = _neighbours(blocks)
        white, wander = float(np.sqrt(np.mean(blocks.noise**2))), _wander(blocks)
        values |= {"white noise": white, "wander": wander, "bound": float(np.hypot(white, wander))}
        note = f"{len(blocks)} blocks; search over {searched.models} models"
        rows.append(
            row(f"{axis}, rms of what remains", "counts", values, limit=REACH.get(axis), judged=("die",), note=note)
        )
    return Table("Measured warm-up, one cycle: contiguous parts held out, blocks of 300 samples", rows)


class Searched(NamedTuple):
    """Rms of what remains of the held-out blocks [unit of the rate]: of the model chosen by cross-validation on the
    others, and the least of any; how many models there were."""

    chosen: float
    least: float
    models: int


def widest_search(blocks: Blocks) -> Searched:
    """Every model, fitted without the parts that `gyrotwin compensate` holds out, and judged there."""
    held = last_cycle(blocks, MEMORY * memory_of(blocks))
    seen, judged = held.fitted, covered(blocks, held)
    part = blocks.part(seen)
    folds = [(fold.fitted, fold.left_out) for fold in hold_outs(part, MEMORY * memory_of(part))]
    found = []
    for columns, ridge in product(_models(blocks), RIDGES):
        inside, rate = columns[seen], blocks.rate[seen]
        score = sum(_left_over(inside, rate, *fold, ridge) ** 2 for fold in folds)
        found.append((score, _left_over(columns, blocks.rate, seen, judged, ridge)))
    return Searched(min(found)[1], min(left for _, left in found), len(found))


def _models(blocks: Blocks) -> Iterator[Floats]:
    """Columns (n, k) of each model."""
    die, board = blocks.inputs[STRUCTURE], blocks.inputs[CIRCUIT]
    rates = [blocks.inputs[name + RATE_OF] for name in (STRUCTURE, CIRCUIT)]
    lagged = {lag: _lagged(blocks.t, board, lag) for lag in LAGS}
    lag_sets = [(), *((lag,) for lag in LAGS), *combinations(LAGS, 2)]
    for signals, degree, slopes, lags in product(((die,), (board,), (die, board)), DEGREES, ([], rates), lag_sets):
        powers = [((s - s.mean()) / np.ptp(s) * 2) ** d for s in signals for d in range(1, degree + 1)]
        yield np.stack([*powers, *slopes, *(lagged[lag] for lag in lags)], axis=1)


def _lagged(t: Floats, values: Floats, lag: float) -> Floats:
    """First-order lag, exact for a mean held between two blocks."""
    result = values.copy()
    for k in range(1, len(t)):
        share = -np.expm1(-(t[k] - t[k - 1]) / lag)
        result[k] = result[k - 1] + share * (0.5 * (values[k] + values[k - 1]) - result[k - 1])
    return result


def _left_over(columns: Floats, rate: Floats, fitted: Chosen, judged: Chosen, ridge: float) -> float:
    """Rms of what a ridge regression on the blocks ``fitted`` leaves of those ``judged``."""
    middle, size, level = columns[fitted].mean(axis=0), columns[fitted].std(axis=0), rate[fitted].mean()
    design = (columns[fitted] - middle) / size
    gram = design.T @ design + ridge * len(design) * np.eye(design.shape[1])
    weights = np.linalg.solve(gram, design.T @ (rate[fitted] - level))
    left = rate[judged] - level - (columns[judged] - middle) / size @ weights
    return float(np.sqrt(np.mean(left**2)))


def _neighbours(blocks: Blocks) -> float:
    die = blocks.inputs[STRUCTURE]
    left = blocks.rate - np.polyval(np.polyfit(die - die.mean(), blocks.rate, 3), die - die.mean())
    weights = np.ones(2 * NEIGHBOURS + 1)
    weights[NEIGHBOURS] = 0
    around = np.convolve(left, weights / weights.sum(), "valid")
    return float(np.sqrt(np.mean((left[NEIGHBOURS:-NEIGHBOURS] - around) ** 2)))


def _wander(blocks: Blocks) -> float:
    """Hadamard deviation at 100 s of the bias at the end: a drift with the slow temperature drops out."""
    rate = blocks.rate[blocks.t > blocks.t[-1] - PLATEAU]
    means = rate[: len(rate) // WANDER * WANDER].reshape(-1, WANDER).mean(axis=1)
    return float(np.sqrt(np.mean(np.diff(means, 2) ** 2) / 6))
