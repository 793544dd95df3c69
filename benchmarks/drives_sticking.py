"""Dry friction that holds a shaft for a part of the time, beside loads: are both named, the friction with its value?

As ``drives_rubbing``, with a friction as strong as the force, which often exceeds it near rest.
"""

from collections.abc import Sequence
from typing import Final

import numpy as np

from benchmarks import structures
from benchmarks.drives import band, drawn
from benchmarks.report import Options, Report
from benchmarks.rubbing import FADED, Rubbing, motion, outcome
from benchmarks.structures import NOISE, Outcome, drawn_record, runs_of

SEEDS: Final = 20
FIRST: Final = 8301
"""The first seed, of which nothing was chosen."""
FRICTION: Final = (0.3, 1.2)
"""Of the force, rms."""
BREAKAWAY: Final = (0.0, 0.3, 0.6)
"""By which friction at rest exceeds that at speed."""


def measure(seed: int) -> Outcome:
    """The diagnosis of one. Whatever goes wrong is an outcome."""
    rng = np.random.default_rng(seed)
    structure = drawn(rng)._replace(sensed=0)
    senses, hold = drawn_record(rng)
    friction, excess = float(np.exp(rng.uniform(*np.log(FRICTION)))), float(rng.choice(BREAKAWAY))
    speed = FADED / float(np.sqrt(4 * structure.damping[0, 0] * structure.mass[0, 0] * structure.modes[-1]))
    own = Rubbing(structure, friction, excess, speed)
    what = (f"{len(structure.mass)} masses, {own.friction:.3f} N, excess {excess:g}, {senses}, hold {hold}, "
            f"seed {seed}")  # fmt: skip
    records = runs_of(band(structure), rng, senses, hold, NOISE, lambda u, step: motion(own, u, step, hold))
    return outcome(own, what, records, NOISE)


def make_report(seeds: Sequence[int], jobs: int) -> Report:
    """Draws and diagnoses a drive for each seed."""
    title = f"Drives that stick, seeds from {seeds[0]}"
    said = "friction, to 5 %, and as many resonators as loads alone named"
    kind = "Motors that friction holds for a part of the time, with one or two elastic loads"
    return structures.reported("drives_sticking", title, kind, measure, seeds, jobs, said)


def run(options: Options) -> Report:
    """Twenty drives."""
    return make_report(range(FIRST, FIRST + options.seeds_or(SEEDS)), options.jobs)
