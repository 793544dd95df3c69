"""Drives whose motor is damped so much that no peak shows what it carries: does the diagnosis name that, to the noise?

A motor with one elastic load, forced and sensed at the motor, simulated exactly between samples.
"""

from collections.abc import Sequence
from typing import Final

import numpy as np

from benchmarks import structures
from benchmarks.report import Options, Report
from benchmarks.structures import NOISE, Outcome, Structure, drawn_record, motion, outcome, runs_of, told
from discrepancy.data.record import Floats

SEEDS: Final = 20
FIRST: Final = 6001
"""The first seed, of which nothing was chosen."""
ALONE: Final = (2.0, 20.0)
"""Hz, of the load while the motor is held."""
LOAD: Final = (0.3, 3.0)
"""Of the motor."""
DAMPED: Final = (0.7, 3.0)
"""Rate at which the motor alone forgets its speed, over that of the load's swing [rad/s]."""
BAND: Final = (0.1, 3.0)
"""Of the load's frequency, where the force begins and ends."""


def drawn(rng: np.random.Generator) -> tuple[Structure, float]:
    """The drive, and the frequency [Hz] of its load while the motor is held."""
    motor, share = np.exp(rng.uniform(np.log(0.5), np.log(2.0))), np.exp(rng.uniform(*np.log(LOAD)))
    frequency = float(np.exp(rng.uniform(*np.log(ALONE))))
    w, load = 2 * np.pi * frequency, motor * share
    between = np.array([[1.0, -1.0], [-1.0, 1.0]])
    damping = np.diag([motor * w * rng.uniform(*DAMPED), 0.0]) + load * w * rng.uniform(0.01, 0.06) * between
    return Structure(np.diag([motor, load]), damping, load * w**2 * between, 0, 0), frequency


def band(frequency: float) -> Floats:
    """Frequencies [Hz] by which the force's band is said."""
    return frequency * np.array([2 * BAND[0], BAND[1] / 1.2])


def measure(seed: int) -> Outcome:
    """The diagnosis of one drive. Whatever goes wrong is an outcome."""
    rng = np.random.default_rng(seed)
    own, frequency = drawn(rng)
    senses, hold = drawn_record(rng)
    records = runs_of(band(frequency), rng, senses, hold, NOISE, lambda u, step: motion(own, u, step, hold))
    return outcome(own, f"{told(own, senses, hold)}, seed {seed}", records)


def make_report(seeds: Sequence[int], jobs: int) -> Report:
    """Draws and diagnoses a drive for each seed."""
    title = f"Drives that are damped heavily, seeds from {seeds[0]}"
    return structures.reported("drives_damped", title, "A motor with one elastic load", measure, seeds, jobs)


def run(options: Options) -> Report:
    """Twenty drives."""
    return make_report(range(FIRST, FIRST + options.seeds_or(SEEDS)), options.jobs)
