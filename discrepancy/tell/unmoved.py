"""What parameters may be beside shapes of an effect that no fit has moved, since the data ask for no others.

A hysteresis whose sharpness shows too little stands at its usual one, and its force and its way make up for another.
Such a shape, over a decade about its value, is as probable beforehand everywhere on a logarithmic scale, and weighed by
the likelihood of the model fitted with it there.
"""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Final

import numpy as np

from discrepancy.data.record import Floats
from discrepancy.fit.fitted import Fitted, bare
from discrepancy.name.accepted import Accepted
from discrepancy.name.grids import ABOUT, WIDER
from discrepancy.name.search import Search
from discrepancy.name.shaping import freed, unmoved
from discrepancy.tell.mixture import PLACES, Mixture, joined

UNLIKELY: Final = 20.0
"""Variances of an innovation that a fit takes more than the best, from which its place has no weight: exp(-10)."""
ROUNDS: Final = 4
"""Steps of a fit: one from a place beside it is linear but for the curvature between."""


def beside_unmoved(search: Search, entry: Accepted) -> Iterator[tuple[str, Mixture]]:
    """What each parameter may be beside each shape of an effect that no fit has moved, by the parameter's name."""
    for q in unmoved(entry.candidate):
        at = freed(search.at, entry.candidate, [q])
        if at.parameters[q.name] > 0:
            yield from _over(search, at)


def _over(search: Search, at: Fitted) -> Iterator[tuple[str, Mixture]]:
    """The same over the last of the free parameters of ``at``."""
    fits = _fits(search, at)
    values = np.array(list(fits))
    costs = np.array([fit.cost for fit in fits.values()]) / at.variance
    # The root of what a place costs is linear where the cost is a parabola.
    best = int(costs.argmin())
    apart = np.sign(np.arange(len(costs)) - best) * np.sqrt(costs - costs[best])
    places = np.geomspace(values[0], values[-1], PLACES)

    def between(column: Floats) -> Floats:
        return np.interp(np.log(places), np.log(values), column)

    weights = -(between(apart) ** 2) / 2
    deviations = [search.fitter.deviations(fit) for fit in fits.values()]
    for free in at.free[:-1]:
        means = np.array([fit.parameters[free.name] for fit in fits.values()])
        spread = np.array([own[free.name] for own in deviations])
        if np.isfinite(spread).all():
            yield free.name, joined([Mixture(weights, between(means), between(spread))])


def _fits(search: Search, at: Fitted) -> Mapping[float, Fitted]:
    """The model fitted at places of the last of its free parameters, in order: where it stands, where it fits best, and
    over a decade on both sides as far as that is likely."""
    shape, fitter = at.free[-1], search.fitter
    now = at.parameters[shape.name]
    found = {now: replace(at, free=at.free[:-1])}
    best = fitter.fit(at, ROUNDS)
    found[best.parameters[shape.name]] = bare(replace(best, free=at.free[:-1]))
    likely = min(fit.cost for fit in found.values()) + UNLIKELY * at.variance
    ends = min(found), max(found)
    decade = now * np.geomspace(1 / ABOUT, ABOUT, WIDER)
    within = [float(v) for v in decade if shape.low <= v <= shape.high]
    for side in ([v for v in within[::-1] if v < ends[0]], [v for v in within if v > ends[1]]):
        for value in side:
            # Places go outwards: the outermost found so far is the nearest.
            beside = found[max(found) if value > now else min(found)]
            begun = replace(beside, parameters={**beside.parameters, **shape.at(value, beside.parameters)})
            fit = fitter.fit(fitter.evaluated(begun), ROUNDS, likely)
            if not np.isfinite(fit.cost):
                # There the motion leaves all bounds.
                break
            found[value] = fit
            if fit.cost > likely:
                break
    return dict(sorted(found.items()))
