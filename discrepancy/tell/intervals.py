"""95 % intervals of what was fitted, which count what was not: a part that was left out of an effect, and shapes that
no fit has moved.

Both are mixtures over what was not fitted (J. A. Hoeting et al., Bayesian model averaging: a tutorial, Statistical
Science 14, 1999). An interval holds that of the fit and those of the mixtures.
"""

from functools import partial
from math import inf
from typing import Final

import numpy as np
from scipy.stats import norm

from discrepancy.fit.defect import quantity_of
from discrepancy.name.accepted import Accepted
from discrepancy.name.search import Search, asked
from discrepancy.tell.answer import Value
from discrepancy.tell.left_out import beside_left_out
from discrepancy.tell.mixture import TAIL, Mixture
from discrepancy.tell.unmoved import beside_unmoved

WIDTH: Final = float(norm.isf(TAIL))


def intervals(search: Search) -> tuple[Search, dict[str, Value]]:
    """Every fitted parameter with its interval, within what its fit could reach; the search notes what these do not
    count since time was over."""
    at, result = search.at, {}
    reach = {free.name: free for free in at.free}
    mixed: dict[str, list[Mixture]] = {}
    search.beyond()
    for entry in search.accepted:
        search, found = asked(search, f"{entry.id} beside what was not fitted", partial(_beside, entry=entry))
        for name, own in found or ():
            mixed.setdefault(name, []).append(own)
    search.until(inf)
    for name, deviation in search.fitter.deviations(at).items():
        value, quantity = at.parameters[name], quantity_of(search.simulator.model, name)
        bounds = max(quantity.low, reach[name].low), min(quantity.high, reach[name].high)
        ends = [value - WIDTH * deviation, value + WIDTH * deviation]
        ends += [end for own in mixed.get(name, ()) for end in own.ends]
        low, high = (float(np.clip(end, *bounds)) for end in (min(ends), max(ends)))
        result[name] = Value(value, low, high, quantity.unit)
        if reach[name].against:
            rest = at.parameters[reach[name].against]
            result[reach[name].against] = Value(rest, rest + value - high, rest + value - low, quantity.unit)
    return search, result


def _beside(search: Search, entry: Accepted) -> list[tuple[str, Mixture]]:
    found = [*beside_left_out(search, entry).items(), *beside_unmoved(search, entry)]
    search.simulator.clock.check()
    return found
