"""A mass on a spring that friction holds for a sixth to a half of the time: does the diagnosis name it, with its value?

As ``rubbing``, by no line of the FMU, but one mass, sensed by its place, under friction of half the force and more.
"""

from collections.abc import Sequence
from typing import Final

import numpy as np

from benchmarks.loop_runs import in_processes
from benchmarks.report import Options, Report
from benchmarks.rubbing import NOISES, Rubbing, motion, outcome, report_of
from benchmarks.structures import Outcome, chain, runs_of
from discrepancy.data.record import Floats, Hold

SEEDS: Final = 20
FIRST: Final = 9201
"""The first seed, of which nothing was chosen."""
FRICTION: Final = (0.5, 1.1)
"""Of the force, rms."""
REST: Final = 0.02
"""Of the highest speed, below which the mass rests."""


def drawn(rng: np.random.Generator) -> Rubbing:
    """A mass and its friction."""
    structure = chain(rng, 1)
    return Rubbing(structure, float(np.exp(rng.uniform(*np.log(FRICTION)))), 0.0, 1.0)


def measure(seed: int) -> Outcome:
    """The diagnosis of one. Whatever goes wrong is an outcome."""
    rng = np.random.default_rng(seed)
    own = drawn(rng)
    hold: Hold = ("zero", "first")[int(rng.integers(2))]
    noise = float(np.exp(rng.uniform(*np.log(NOISES))))
    rests: list[float] = []

    def moved(u: Floats, step: float) -> Floats:
        found = motion(own, u, step, hold)
        speed = np.abs(found[:, 1])
        rests.append(float(np.mean(speed < REST * speed.max())))
        return found

    records = runs_of(own.structure.modes, rng, "position", hold, noise, moved)
    what = f"{own.friction:.3f} N, at rest for {np.mean(rests):.2f}, hold {hold}, noise {noise:.1e}, seed {seed}"
    return outcome(own, what, records, noise)


def make_report(seeds: Sequence[int], jobs: int) -> Report:
    """Draws and diagnoses a mass for each seed."""
    outcomes = in_processes(measure, list(seeds), jobs)
    note = "Two runs to fit, one held out, 8,000 samples each, from rest. Final: misfit on the held-out run."
    return report_of("resting", f"A mass that mostly rests, seeds from {seeds[0]}", outcomes, note)


def run(options: Options) -> Report:
    """Twenty masses."""
    return make_report(range(FIRST, FIRST + options.seeds_or(SEEDS)), options.jobs)
