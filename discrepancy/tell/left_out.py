"""What parameters of an effect may be beside a part of it that was left out.

A part that does not earn its parameters, as the Stribeck part of a weak dry friction, is left out, and the others make
up for it. What they may be with it in is a mixture: its parameters, over a decade about where the effect's file has a
search begin, are as probable beforehand everywhere on a logarithmic scale, and weighed by the likelihood of the model
linearised at the fit.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from discrepancy.data.algebra import inverse_scaled
from discrepancy.data.record import Floats
from discrepancy.fit.fitted import Fitted
from discrepancy.fit.refit import Fitter
from discrepancy.name.accepted import Accepted
from discrepancy.name.columns import Candidate, Fading, Probe, left_out
from discrepancy.name.competition import PART
from discrepancy.name.grids import ABOUT, Grids
from discrepancy.name.scan import scanned
from discrepancy.name.search import Search
from discrepancy.tell.mixture import PLACES, Mixture, joined


class _Beside(NamedTuple):
    """The model beside a part at one place of its shapes, by names of what can move, the part's size last: ``change``
    from the fit, ``slopes``: how far each goes with the part's size, and covariance, SI; gain: what it takes from the
    sum of squares, in variances of an innovation."""

    names: Sequence[str]
    change: Floats
    slopes: Floats
    covariance: Floats
    gain: float

    @property
    def shows(self) -> bool:
        """Whether the part changes anything that the others do not."""
        return bool(self.covariance[-1, -1] > 0)

    @property
    def deviations(self) -> Floats:
        """Of each parameter where the part's size is known."""
        taken = self.covariance[:, -1] ** 2 / self.covariance[-1, -1]
        return np.asarray(np.sqrt(np.maximum(np.diag(self.covariance) - taken, 0.0)))

    def changes(self, amounts: Floats) -> Floats:
        """The most likely change of each parameter (n, p) with the part at each of ``amounts`` (n)."""
        return self.change + np.outer(amounts - self.change[-1], self.slopes)

    def likelihood(self, amounts: Floats) -> Floats:
        """Of the part at each of ``amounts``, as a logarithm."""
        return np.asarray(self.gain - (amounts - self.change[-1]) ** 2 / self.covariance[-1, -1]) / 2


def _grids(search: Search) -> Grids:
    """Those on the runs, or pieces, of the final fit: it may have ended while openings were searched."""
    return Grids(search.fitter.records, search.fitter.period)


def beside_left_out(search: Search, entry: Accepted) -> dict[str, Mixture]:
    """What each parameter of an effect may be beside a part of the effect that was left out."""
    part = left_out(entry.candidate.effect, {free.name for free in search.at.free})
    if part is None:
        return {}
    now, effect = search.at.parameters, entry.candidate.effect
    grid = _grids(search).of([part.size, *part.shapes], search.at)
    sizes = np.clip(grid.middle[part.size.name] * np.geomspace(1 / ABOUT, ABOUT, PLACES), 0.0, part.size.high)
    # A record of one axis has no parameters of y.
    scales = {q.name: now[q.name] for q in effect.sizes if now.get(q.name, 0.0) != 0.0}
    fits = _fits(search, entry, part, grid.middle, scales, sizes)
    parts: dict[str, list[Mixture]] = {}
    for fit in fits:
        amounts = _amounts(fit, scales, sizes)
        likelihood, changes = fit.likelihood(amounts), fit.changes(amounts)
        for i, (name, deviation) in enumerate(zip(fit.names[:-1], fit.deviations, strict=False)):
            if name in {q.name for q in effect.parameters} and deviation > 0 and len(amounts):
                own = Mixture(likelihood, now[name] + changes[:, i], np.full(len(amounts), deviation))
                parts.setdefault(name, []).append(own)
    return {name: joined(own) for name, own in parts.items()}


def _amounts(fit: _Beside, scales: Mapping[str, float], sizes: Floats) -> Floats:
    """The part at each of ``sizes`` in units of the fit's. What shows is the product of the part's size and those of
    the effect, which are ``scales`` at the fit: a friction with a large Stribeck part is itself smaller."""
    places = [i for i, name in enumerate(fit.names) if name in scales]
    if not places:
        return sizes
    own = np.array([scales[fit.names[i]] for i in places])
    slope = float(np.mean(fit.slopes[places] / own))
    none = 1 + float(np.mean((fit.change[places] - fit.slopes[places] * fit.change[-1]) / own))
    # The effect's sizes are none + slope * amount of those at the fit, and the amount is that times the part's size.
    room = 1 - sizes * slope
    return sizes[room > 0] * none / room[room > 0]


def _fits(search: Search, entry: Accepted, part: Fading, middle: Mapping[str, float], scales: Mapping[str, float],
          sizes: Floats) -> list[_Beside]:  # fmt: skip
    """The model beside the part at places of its shapes about their ``middle``."""
    probe = Probe(part.size, part.size.typical * PART, 1)
    points = search.library.grids.wider(part.shapes, middle)
    columns = [Candidate(entry.candidate.effect, (probe,), point) for point in points]
    found = []
    for at, batch in scanned(search.fitter, search.at, [], columns).batches:
        for number in range(len(batch)):
            fit, held = _solved(search.fitter, at, at.known + number, probe), set[str]()
            while fit.shows and (out := _out(fit, at, sizes) - scales.keys()):
                held |= out
                fit = _solved(search.fitter, at, at.known + number, probe, held)
            found += [fit] if fit.shows else []
    return found


def _solved(fitter: Fitter, at: Fitted, column: int, probe: Probe, held: Collection[str] = ()) -> _Beside:
    """The minimum of the linearised model with one further ``column``, the parameters ``held`` where they are."""
    assert at.grams is not None
    own = [i for i, free in enumerate(at.free) if free.name not in held]
    chosen = [*own, column, at.grams.shape[1] - 1]
    part = replace(probe.free(), step=probe.step)
    one = replace(at, free=(*(at.free[i] for i in own), part), grams=at.grams[:, chosen][:, :, chosen])
    total = at.grams.sum(axis=0)[np.ix_(chosen, chosen)]
    inverse, units = inverse_scaled(total[:-1, :-1]), np.array([free.step for free in one.free])
    steps = inverse @ total[:-1, -1]
    slopes = inverse[:, -1] / max(float(inverse[-1, -1]), 1e-300) * units / probe.step
    gain = float(steps @ total[:-1, -1]) / at.variance
    return _Beside([free.name for free in one.free], steps * units, slopes, fitter.covariance(one), gain)


def _out(fit: _Beside, at: Fitted, sizes: Floats) -> set[str]:
    """What would leave its bounds with the best of ``sizes`` of the part."""
    best = np.clip(fit.change[-1:], sizes[0], sizes[-1])
    change = dict(zip(fit.names, fit.changes(best)[0], strict=True))
    return {f.name for f in at.free if not f.low <= at.parameters[f.name] + change.get(f.name, 0.0) <= f.high}
