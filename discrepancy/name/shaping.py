"""Shapes of an effect in the model that stand at their usual values until the data ask for others."""

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

from discrepancy.fit.continuation import nearly_settled
from discrepancy.fit.fitted import bare
from discrepancy.name.columns import Candidate
from discrepancy.name.grids import free_usual
from discrepancy.name.score import score
from gyro_model.quantities import Quantity

if TYPE_CHECKING:
    from discrepancy.name.search import Search


def shape(search: "Search") -> None:
    """Fits the shapes of all effects in the model that would make the residual significantly and materially less, one
    after the other."""
    for place, entry in enumerate(search.accepted):
        more = True
        while more and _usual(entry.candidate):
            more = bool(search.attempt(f"shapes of {entry.id}", partial(_shape_one, search, place)))
            entry = search.accepted[place]


def _usual(candidate: Candidate) -> list[Quantity]:
    """Those of its shapes that no fit has moved yet."""
    return [q for q in candidate.effect.parameters
            if q.search is not None and q.search.kind == "usual" and q not in candidate.searched]  # fmt: skip


def _shape_one(search: "Search", place: int) -> bool:
    """Fits the one that shows most; False where none is worth it."""
    entry, fitter, at, criteria = search.accepted[place], search.fitter, search.at, search.criteria
    usual = _usual(entry.candidate)
    values = {q.name: at.parameters.get(q.name, q.start) for q in entry.candidate.effect.parameters}
    free = [free_usual(q, entry.candidate.effect.parameters, values) for q in usual]
    wider = bare(replace(at, parameters={**at.parameters, **values}, free=(*at.free, *free)))
    linear = fitter.with_grams(wider)
    assert linear.grams is not None
    found = []
    for i, q in enumerate(usual):
        result, own = score(linear.grams, at.known, [at.known + i], at.count), linear.free[at.known + i]
        aim = values[q.name] + own.step * sum(result.amplitudes)
        sure = result.probability < criteria.effect_chance and result.share >= criteria.material
        if sure and own.bounded(values[q.name], aim) != values[q.name]:
            found.append((result.gain, i))
    if not found:
        return False
    best = max(found)[1]
    fitted = fitter.fit(replace(wider, free=(*at.free, free[best])))
    search.simulator.clock.check()
    if at.cost - fitted.cost < max(criteria.simpler * fitted.variance, criteria.material * at.cost):
        return False
    search.progress(f"fitted {usual[best].name} of {entry.id}")
    candidate = replace(entry.candidate, searched=(*entry.candidate.searched, usual[best]))
    search.accepted[place] = replace(entry, candidate=candidate)
    search.go_on(fitted, nearly_settled)
    return True
