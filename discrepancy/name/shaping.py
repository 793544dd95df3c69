"""Shapes of an effect in the model that stand at their usual values until the data ask for others."""

from collections.abc import Sequence
from dataclasses import replace

from discrepancy.fit.continuation import nearly_settled
from discrepancy.fit.fitted import Fitted, bare
from discrepancy.name.columns import Candidate
from discrepancy.name.grids import free_shape, free_usual
from discrepancy.name.score import score
from discrepancy.name.search import Search
from gyro_model.quantities import Quantity


def movable(search: Search) -> bool:
    """Whether an effect in the model has such shapes."""
    return any(unmoved(entry.candidate) for entry in search.accepted)


def shaped(search: Search) -> Search:
    """With the shape of an effect in the model fitted that takes most, where that is more than any effect which is not
    would take: what only imitates a part of what is missing has shapes with which it imitates more. Raises
    OutOfTime."""
    others = max((result.gain for _, result in search.significant()), default=0.0)
    found = [(gain, place, q) for place in range(len(search.accepted)) for gain, q in _gains(search, place)
             if gain > others]  # fmt: skip
    if not found:
        return search
    _, place, moved = max(found, key=lambda own: own[0])
    return _fitted(search, place, moved)


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


def _gains(search: Search, place: int) -> list[tuple[float, Quantity]]:
    """What each shape of an effect that no fit has moved would take, to first order, where that is significant and
    material and its bounds let it."""
    candidate, (fitter, at), criteria = search.accepted[place].candidate, search.view, search.criteria
    usual = unmoved(candidate)
    if not usual:
        return []
    linear = fitter.with_grams(freed(at, candidate, usual))
    assert linear.grams is not None
    found = []
    for i, q in enumerate(usual, at.known):
        result, free = score(linear.grams, at.known, [i], at.count), linear.free[i]
        value = linear.parameters[q.name]
        aim = value + free.step * sum(result.amplitudes)
        sure = result.probability < criteria.effect_chance and result.share >= criteria.material
        if sure and free.bounded(value, aim) != value:
            found.append((result.gain, q))
    return found


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


def _fitted(search: Search, place: int, moved: Quantity) -> Search:
    """With that shape fitted, or what is the rest to it alone, unless it brings too little."""
    entry, at, criteria = search.accepted[place], search.at, search.criteria
    fits = [(moved, search.fitter.fit(freed(at, entry.candidate, [moved])))]
    fits += [(q, search.fitter.fit(search.fitter.evaluated(own))) for q, own in _alone(at, entry.candidate, moved)]
    moved, fitted = min(fits, key=lambda own: own[1].cost)
    search.simulator.clock.check()
    if at.cost - fitted.cost < max(criteria.simpler * fitted.variance, criteria.material * at.cost):
        return search
    search.progress(f"fitted {moved.name} of {entry.id}")
    candidate = replace(entry.candidate, searched=(*entry.candidate.searched, moved))
    search = search.changed(place, replace(entry, candidate=candidate)).fitted(fitted, nearly_settled)
    *before, (name, _) = search.stages
    return replace(search, stages=tuple(before)).staged(name)
