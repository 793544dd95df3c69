"""The mode-matching loop on the envelope FMU: from noise alone the bias tunes f_y to f_x through a ramp."""

from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from typing import Final

import numpy as np
from numpy.typing import NDArray

from benchmarks.report import Row, row
from benchmarks.split_envelope import RAMPING, TEMPERATURE, EnvelopeRun
from benchmarks.split_fmu import FmuPoint, device
from calibration.mode_split import (
    BiasTuner,
    Envelope,
    NothingFoundError,
    Question,
    estimate,
    line_spectrum,
    split_slope,
)
from cosim.envelope import open_envelope

LOOP_RATE: Final = 500.0
"""Samples a second of the matching loop [Hz]."""
SPAN: Final = 100.0
BLOCK: Final = 10.0
MATCHED: Final = FmuPoint(1885, 20, -4.0)
"""f_y lies 4 Hz below f_x at the first bias."""
SWING: Final = 3e-6
"""Drive amplitude of the matching loop [m]: 0.3 of the gap."""
GAP, SOFTENING, FIRST_BIAS, HIGHEST_BIAS = 1e-5, 0.02, 10.0, 40.0
NULLED: Final = np.deg2rad(3.0)
"""Quadrature that a nulling electrode leaves, as a rate [rad/s]."""
TCK, TCK_SPLIT = -60e-6, 30e-6
COLD, HOT, PER_SECOND = 253.15, 333.15, 1.0 / 60.0


def matching_device(seed: int) -> dict[str, float]:
    """FMU parameters: at the first bias and temperature f_y lies 4 Hz below the drive."""
    parameters = device(MATCHED, seed)
    mass = parameters["m"]
    slope = split_slope(SOFTENING, GAP, SWING, mass, np.sqrt(parameters["kxx"] / mass) / (2 * np.pi))
    ratio = 1 + 2 * (MATCHED.split - slope * FIRST_BIAS**2) / (np.sqrt(parameters["kxx"] / mass) / (2 * np.pi))
    own = {"kyy": parameters["kxx"] * ratio, "kxy": 2 * mass * np.sqrt(parameters["kxx"] / mass) * NULLED, "dxy": 0.0}
    own |= {"softening": SOFTENING, "electrode_gap": GAP, "x_start": SWING}
    return parameters | own | {"tck": TCK, "tck_split": TCK_SPLIT, "t_ref": COLD}


def match(seed: int, minutes: float = (HOT - COLD) / PER_SECOND / 60) -> tuple[NDArray[np.float64], int]:
    """Split at the end of every block [Hz], its own truth, with the loop closed; blocks without an answer."""
    parameters = matching_device(seed)
    mass, f_x = parameters["m"], np.sqrt(parameters["kxx"] / parameters["m"]) / (2 * np.pi)
    tuner = BiasTuner(split_slope(SOFTENING, GAP, SWING, mass, f_x), 0.5, HIGHEST_BIAS)
    force = parameters["dxx"] * 2 * np.pi * f_x * SWING
    bias, splits, missed = FIRST_BIAS, [], 0
    settle = RAMPING + 12 * MATCHED.q / (np.pi * f_x)
    with open_envelope(parameters, 1 / LOOP_RATE, f_x) as plant:
        run = EnvelopeRun(plant, force, f_x, 0.0, COLD, 1 / LOOP_RATE)
        run.advance(BLOCK, bias)
        for _ in range(round(60 * minutes / BLOCK)):
            samples, carriers = run.advance(BLOCK, bias, PER_SECOND)
            drive = float(carriers[round(settle * LOOP_RATE) :].mean())
            warm = 1 + (TCK + TCK_SPLIT) * (float(run.values[TEMPERATURE]) - 0.5 * BLOCK * PER_SECOND - COLD)
            f_y = np.sqrt((parameters["kyy"] * warm - SOFTENING * bias**2) / mass) / (2 * np.pi)
            splits.append(f_y - drive)
            found = _answer(Envelope(samples, LOOP_RATE, drive, SPAN).part(settle, BLOCK))
            missed += found is None
            bias = tuner.next_bias(bias, found)
    return np.array(splits), missed


def matching_rows(seeds: int, jobs: int) -> list[Row]:
    """Split held at zero by the bias through the ramp, the first minute left out; one run a seed."""
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
        runs = list(pool.map(match, range(1, seeds + 1)))
    splits = [splits[6:] for splits, _ in runs]
    missed, blocks = sum(missed for _, missed in runs), sum(len(splits) for splits, _ in runs)
    what = f"Δf, envelope FMU, Q {MATCHED.q:g}, 10 s estimates, -20..60 °C at 1 °C/min, {seeds} runs"
    return [matching_row(what, splits, f"{missed} of {blocks} blocks without an answer")]


def matching_row(what: str, splits: list[NDArray[np.float64]], note: str) -> Row:
    """Rms over all runs, of the worst run, and the largest Δf of all [Hz]."""
    runs = [float(np.sqrt(np.mean(split**2))) for split in splits]
    values = {
        "rms": float(np.sqrt(np.mean(np.concatenate(splits) ** 2))),
        "rms of the worst run": max(runs),
        "largest Δf": float(max(np.abs(split).max() for split in splits)),
    }
    return row(what, "Hz", values, limit=0.5, judged=("rms", "rms of the worst run"), note=note)


def _answer(part: Envelope) -> float | None:
    try:
        return estimate(line_spectrum(part, part.centre), Question(q=MATCHED.q, clean_line=True)).split
    except NothingFoundError:
        return None
