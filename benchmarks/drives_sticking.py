"""Dry friction that holds a shaft for a part of the time, beside loads: are both named, the friction with its value?

As ``drives_rubbing``, with a friction as strong as the force, which often exceeds it near rest.
"""

from collections.abc import Sequence
from typing import Final

import numpy as np

from benchmarks import structures
from benchmarks.drives import drawn
from benchmarks.drives_rubbing import told_of
from benchmarks.report import Options, Report
from benchmarks.rubbing import Rubbing, fading
from benchmarks.structures import Outcome, drawn_record

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
    return told_of(Rubbing(structure, friction, excess, fading(structure)), senses, hold, rng, seed)


def make_report(seeds: Sequence[int], jobs: int) -> Report:
    """Draws and diagnoses a drive for each seed."""
    title = f"Drives that stick, seeds from {seeds[0]}"
    said = "friction, to 5 %, and as many resonators as loads alone named"
    kind = "Motors that friction holds for a part of the time, with one or two elastic loads"
    return structures.reported("drives_sticking", title, kind, measure, seeds, jobs, said)


def run(options: Options) -> Report:
    """Twenty drives."""
    return make_report(range(FIRST, FIRST + options.seeds_or(SEEDS)), options.jobs)
