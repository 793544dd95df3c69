"""Dry friction on a shaft that no spring holds and that carries others: are both named, the friction with its value?

The drives of ``drives``, whose motor rubs and is what is forced and sensed, moved as in ``rubbing``.
"""

from collections.abc import Sequence
from typing import Final

import numpy as np

from benchmarks import structures
from benchmarks.drives import band, drawn
from benchmarks.report import Options, Report
from benchmarks.rubbing import Rubbing, motion, outcome
from benchmarks.structures import NOISE, Outcome, drawn_record, runs_of
from discrepancy.data.record import Hold, Senses

SEEDS: Final = 20
FIRST: Final = 5721
"""The first seed, of which nothing was chosen."""
FRICTION: Final = (0.05, 0.5)
"""Of the force, rms."""


def measure(seed: int) -> Outcome:
    """The diagnosis of one. Whatever goes wrong is an outcome."""
    rng = np.random.default_rng(seed)
    structure = drawn(rng)._replace(sensed=0)
    senses, hold = drawn_record(rng)
    own = Rubbing(structure, float(np.exp(rng.uniform(*np.log(FRICTION)))), 0.0, 1.0)
    return told_of(own, senses, hold, rng, seed)


def told_of(own: Rubbing, senses: Senses, hold: Hold, rng: np.random.Generator, seed: int) -> Outcome:
    """The diagnosis of a drive that rubs so."""
    more = f"excess {own.excess:g}, " if own.excess else ""
    what = f"{len(own.structure.mass)} masses, {own.friction:.3f} N, {more}{senses}, hold {hold}, seed {seed}"
    records = runs_of(band(own.structure), rng, senses, hold, NOISE, lambda u, step: motion(own, u, step, hold))
    return outcome(own, what, records, NOISE)


def make_report(seeds: Sequence[int], jobs: int) -> Report:
    """Draws and diagnoses a drive for each seed."""
    title = f"Drives that rub, seeds from {seeds[0]}"
    said = "friction, to 5 %, and as many resonators as loads alone named"
    kind = "Motors that rub, with one or two elastic loads"
    return structures.reported("drives_rubbing", title, kind, measure, seeds, jobs, said)


def run(options: Options) -> Report:
    """Twenty drives."""
    return make_report(range(FIRST, FIRST + options.seeds_or(SEEDS)), options.jobs)
