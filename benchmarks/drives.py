"""Drives that no spring holds, drawn by seed: does the diagnosis name what their shaft carries, to the noise?

As ``structures``: a motor with one or two elastic loads, forced at the shaft, simulated exactly between samples.
"""

from collections.abc import Sequence
from typing import Final

import numpy as np
from scipy.linalg import eigh

from benchmarks import structures
from benchmarks.report import Options, Report
from benchmarks.structures import NOISE, Outcome, Structure, drawn_record, motion, outcome, runs_of, told
from discrepancy.data.record import Floats

SEEDS: Final = 20
FIRST: Final = 6001
"""The first seed, of which nothing was chosen."""
LOWEST: Final = (5.0, 40.0)
"""Hz, of the lowest mode of what swings."""
BEGINS: Final = 0.1
"""Of that, where the force begins."""


def drawn(rng: np.random.Generator) -> Structure:
    """Two or three masses in a row, the first damped most against the ground; sensed anywhere."""
    n = int(rng.integers(2, 4))
    mass, k = np.exp(rng.uniform(np.log(0.3), np.log(3.0), n)), np.exp(rng.uniform(np.log(0.5), np.log(2.0), n - 1))
    between = np.diff(np.eye(n), axis=0)
    stiffness = between.T @ np.diag(k) @ between
    lowest = 2 * np.pi * np.exp(rng.uniform(*np.log(LOWEST)))
    stiffness *= lowest**2 / eigh(stiffness, np.diag(mass), eigvals_only=True)[1]
    grounded = rng.uniform(1e-2, 1e-1) * lowest * mass * np.where(np.arange(n) == 0, 1.0, 0.2)
    damping = np.diag(grounded) + rng.uniform(5e-3, 3e-2) / lowest * stiffness
    return Structure(np.diag(mass), damping, stiffness, 0, int(rng.integers(n)))


def band(structure: Structure) -> Floats:
    """Frequencies [Hz] that the force reaches, of which the first says where it begins."""
    modes = structure.modes[1:]
    return np.concatenate(([2 * BEGINS * modes[0]], modes))


def measure(seed: int) -> Outcome:
    """The diagnosis of one drive. Whatever goes wrong is an outcome."""
    rng = np.random.default_rng(seed)
    own = drawn(rng)
    senses, hold = drawn_record(rng)
    records = runs_of(band(own), rng, senses, hold, NOISE, lambda u, step: motion(own, u, step, hold))
    return outcome(own, f"{told(own, senses, hold)}, seed {seed}", records)


def make_report(seeds: Sequence[int], jobs: int) -> Report:
    """Draws and diagnoses a drive for each seed."""
    title = f"Drives that no spring holds, seeds from {seeds[0]}"
    return structures.reported("drives", title, "Drives with one or two elastic loads", measure, seeds, jobs)


def run(options: Options) -> Report:
    """Twenty drives."""
    return make_report(range(FIRST, FIRST + options.seeds_or(SEEDS)), options.jobs)
