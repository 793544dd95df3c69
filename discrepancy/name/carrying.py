"""A resonator that no peak shows: what a shaft carries that nothing holds and that is damped so much that no mode of it
stands out. A linear fit without it ends far off, beside which no column shows it; with one in its place it does not,
wherever in the band of the force that is."""

from collections.abc import Mapping
from contextlib import suppress
from itertools import product
from math import inf, pi, sqrt
from typing import Final

import numpy as np

from discrepancy.clock import OutOfTime
from discrepancy.data.absorbers import Absorber, Carried
from discrepancy.data.modes import band_of
from discrepancy.data.record import is_driven
from discrepancy.fit.continuation import unsprung
from discrepancy.name.accepted import Taken
from discrepancy.name.resonators import begun_with, beside, fitted_from, resonators
from discrepancy.name.search import Search

FREQUENCIES: Final = 0.03, 0.6, 6
"""Of the highest frequency of the force: where resonators are tried, and how many."""
LOADS: Final = 0.3, 1.0, 3.0
"""Of the mass, that they are tried with."""
QUALITY: Final = 10.0
"""Of a resonator that is tried."""
HOLDS: Final = 1e-2
"""Of the spring to what it carries, by which the ground holds the mass in a start where no sensor shows its place:
without any no step of a fit was right. A sensor of displacement sees what is wrong with it."""
LIKELY: Final = 3
"""Those that are nearest to begin with, from which a fit is tried: of 18 for a flexible arm on a motor eleven ended
at one and the same."""


def carrying(search: Search) -> Taken | None:
    """The model with a resonator for what a mass carries that nothing holds, as by trial leaves least, where that is
    plainly less; None where it is not."""
    whole = search.whole
    if whole.axes > 1 or not is_driven(whole.records) or not unsprung(whole, search.at):
        return None
    against = beside(search)
    near, without = against.near, against.without
    holds = HOLDS if whole.records[0].order else 0.0
    top = max(band_of(record, record.u) for record in whole.records)
    low, high, points = FREQUENCIES
    starts = []
    for frequency, load in product(np.geomspace(low * top, high * top, points).tolist(), LOADS):
        told = _carried(without.parameters, frequency, load, holds)
        taken = resonators(search, told)
        if not taken:
            return None
        starts.append(begun_with(search, near, told, taken, without, jointed=False))
    held = near.held()
    best: Taken | None = None
    for start in sorted(starts, key=lambda own: near.off(own.at))[:LIKELY]:
        # One that was fitted says what another has to reach.
        with suppress(OutOfTime):
            end = start._replace(at=fitted_from(held, start.at, best.at.cost if best else inf))
            best = end if best is None or end.at.cost < best.at.cost else best
    return against.taken(search, best)


def _carried(parameters: Mapping[str, float], frequency: float, load: float, holds: float) -> Carried:
    """A mass with a ``load`` of so many times its own, at that ``frequency`` [Hz] while the mass is held; the ground
    ``holds`` the mass by so much of the spring between them."""
    m, stiffness = parameters["m"], parameters["m"] * load * (2 * pi * frequency) ** 2
    one = Absorber(frequency, QUALITY, np.array([stiffness / sqrt(load)]), np.array([0.0]), 0.0)
    none = np.zeros(1)
    return Carried(m, np.array([[(1 + holds) * stiffness]]), np.array([[parameters["dxx"]]]), (one,), none, none)
