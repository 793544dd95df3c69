"""Shapes of an effect in the model that stand at their usual values until the data ask for others, and parts of one
that were left out of it."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

from discrepancy.fit.continuation import nearly_settled
from discrepancy.fit.fitted import Fitted, bare
from discrepancy.name.columns import Candidate, Fading, left_out, with_part
from discrepancy.name.competition import most_of_part
from discrepancy.name.grids import free_shape, free_usual
from discrepancy.name.scan import Scored
from discrepancy.name.score import score
from discrepancy.name.search import Search
from gyro_model.quantities import Quantity

Gain = tuple[float, Callable[[Search], Search]]
"""What a shape or a part would take, and the search with it fitted."""


def movable(search: Search) -> bool:
    """Whether an effect in the model has such shapes or parts."""
    free = {own.name for own in search.at.free}
    return any(unmoved(entry.candidate) or left_out(entry.candidate.effect, free) for entry in search.accepted)


def shaped(search: Search) -> Search:
    """With the shape of an effect in the model fitted that takes most, or the part, where that is more than any effect
    which is not would take: what only imitates a part of what is missing has shapes with which it imitates more.
    Raises OutOfTime."""
    others = max((result.gain for _, result in search.significant()), default=0.0)
    found = [own for place in range(len(search.accepted)) for own in (*_shapes(search, place), *_part(search, place))]
    best = max(found, key=lambda own: own[0], default=None)
    return best[1](search) if best and best[0] > others else search


def unmoved(candidate: Candidate) -> list[Quantity]:
    """Its shapes that stand at their usual values, since no fit has moved them; nor does one to which another, that
    moves alone, is the rest: it would move a scale."""
    moved = {name for q in candidate.searched for name in (q.name, q.search.of if q.search else "")}
    return [q for q in candidate.effect.parameters
            if q.search is not None and q.search.kind == "usual" and q.name not in moved]  # fmt: skip


def freed(at: Fitted, candidate: Candidate, moved: Sequence[Quantity]) -> Fitted:
    """``at`` with shapes of an effect free too, the last, not fitted."""
    own = candidate.effect.parameters
    values = {q.name: at.parameters.get(q.name, q.start) for q in own}
    free = (*at.free, *(free_usual(q, own, values) for q in moved))
    return bare(replace(at, parameters={**at.parameters, **values}, free=free))


def _shapes(search: Search, place: int) -> list[Gain]:
    """What each shape of an effect that no fit has moved would take, to first order, where that is significant and
    material and its bounds let it."""
    candidate, (fitter, at), criteria = search.accepted[place].candidate, search.view, search.criteria
    usual = unmoved(candidate)
    if not usual:
        return []
    linear = fitter.with_grams(freed(at, candidate, usual))
    assert linear.grams is not None
    found: list[Gain] = []
    for i, q in enumerate(usual, at.known):
        result, free = score(linear.grams, at.known, [i], at.count), linear.free[i]
        value = linear.parameters[q.name]
        aim = value + free.step * sum(result.amplitudes)
        sure = result.probability < criteria.effect_chance and result.share >= criteria.material
        if sure and free.bounded(value, aim) != value:
            found.append((result.gain, partial(_with_shape, place=place, moved=q)))
    return found


def _part(search: Search, place: int) -> list[Gain]:
    """The same of the part that was left out of an effect: when that came in a filter may have taken for noise what
    shows now."""
    candidate, view, criteria = search.accepted[place].candidate, search.view, search.criteria
    part = left_out(candidate.effect, {free.name for free in search.at.free})
    best = most_of_part(search, view, candidate, part) if part else None
    if part is None or best is None:
        return []
    sure = best[1].probability * best[0].trials < criteria.effect_chance and best[1].share >= criteria.material
    return [(best[1].gain, partial(_with_part, place=place, part=part, best=best))] if sure else []


def _alone(at: Fitted, candidate: Candidate, moved: Quantity) -> list[tuple[Quantity, Fitted]]:
    """``at`` with a shape free that is the rest to ``moved`` and may move alone, not fitted."""
    found = []
    for q in candidate.effect.parameters:
        if q.search is not None and q.search.alone and q.search.of == moved.name:
            value = q.search.begins
            parameters = {**at.parameters, moved.name: moved.start, q.name: value}
            free = (*at.free, free_shape(q, value, 0.0, (value, value)))
            found.append((q, bare(replace(at, parameters=parameters, free=free))))
    return found


def _with_shape(search: Search, place: int, moved: Quantity) -> Search:
    """With that shape fitted, or what is the rest to it alone, unless it brings too little."""
    entry, at = search.accepted[place], search.at
    fits = [(moved, search.fitter.fit(freed(at, entry.candidate, [moved])))]
    fits += [(q, search.fitter.fit(search.fitter.evaluated(own))) for q, own in _alone(at, entry.candidate, moved)]
    moved, fitted = min(fits, key=lambda own: own[1].cost)
    candidate = replace(entry.candidate, searched=(*entry.candidate.searched, moved))
    return _changed(search, place, candidate, fitted, (moved,))


def _with_part(search: Search, place: int, part: Fading, best: Scored) -> Search:
    """With that part fitted, begun where it shows most, unless it brings too little."""
    fitted = search.fitter.fit(search.with_effect(search.fitter, search.at, *best))
    values = {name: fitted.parameters[name] for name in part.names}
    candidate = with_part(search.accepted[place].candidate, part, values)
    return _changed(search, place, candidate, fitted, (part.size, *part.shapes))


def _changed(search: Search, place: int, candidate: Candidate, fitted: Fitted, moved: Sequence[Quantity]) -> Search:
    """With that candidate for an effect in the model, ``fitted`` with what it has ``moved``, unless that brings too
    little."""
    at, criteria, entry = search.at, search.criteria, search.accepted[place]
    search.simulator.clock.check()
    if at.cost - fitted.cost < max(criteria.simpler * len(moved) * fitted.variance, criteria.material * at.cost):
        return search
    search.progress(f"fitted {moved[0].name} of {entry.id}")
    search = search.changed(place, replace(entry, candidate=candidate)).fitted(fitted, nearly_settled)
    *before, (name, _) = search.stages
    return replace(search, stages=tuple(before)).staged(name)
