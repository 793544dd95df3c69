"""Friction and constant forces of a mass that no spring holds: in its model before anything else is scored, and each in
the place of the other."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

from discrepancy.data.resisted import PLAINLY, Resisted, alternatives, fewest, one_way
from discrepancy.fit.continuation import unsprung
from discrepancy.fit.fitted import Fitted
from discrepancy.name.accepted import Accepted, Taken
from discrepancy.name.columns import Candidate, Kind, fading, nameable, without_part
from discrepancy.name.resistance import Resistance, resistance
from discrepancy.name.scan import Scored
from discrepancy.name.search import Search


def resisting(search: Search) -> Taken | None:
    """The model with those of friction and a constant force that fit best, where integrals of the motion plainly show
    that there is such a force; None where they do not."""
    whole = search.whole
    found = alternatives(search.dataset.fit, search.nominal["sense_gain_x"])
    told = fewest(found)
    if told is None or not (told.friction or told.constant):
        return None
    plain = whole.fit(replace(search.at, whiten=whole.plain(search.at.parameters)))
    forces = steepest(search, lambda e: bool(resistance(e)))
    # Integrals smooth the speed, so that they do not tell where the mass sets out; a simulation does.
    if one_way(search.dataset.fit):
        found = [told for told in found if not (told.friction and told.constant)]
    ends = [end for told in found if (end := _fitted(search, forces, told, plain)) is not None]
    best = min(ends, key=lambda end: end.price(search.criteria), default=None)
    return best if best and whole.off(best.at) <= PLAINLY * whole.off(plain) else None


def steepest(search: Search, among: Kind) -> dict[Resistance, Candidate]:
    """Of each kind of resistance one ``among`` those of the files."""
    return steepest_of(search.library.candidates(search.whole, search.at, search.present, among))


def steepest_of(known: Sequence[Candidate]) -> dict[Resistance, Candidate]:
    """The same of candidates that are ``known``."""
    # The first point of a grid is the steepest friction, which no damping imitates.
    return {resistance(c.effect): _whole(c) for c in reversed(known)}


def alike(search: Search, ids: Collection[str]) -> list[str]:
    """Ids of what no sample tells from a friction or a constant force that is among ``ids``, but where it sets out: of
    a mass that no spring holds, and that moves one way."""
    found = [e.id for e in nameable(search.simulator.model) if resistance(e)]
    told = any(name in ids for name in found) and unsprung(search.whole, search.at)
    return found if told and one_way(search.dataset.fit) else []


def other_resistances(search: Search, entry: Accepted, scored: Sequence[Scored]) -> list[Scored]:
    """Of a mass that no spring holds the friction that may stand for a constant force, and the other way round, as
    large: no sample of a motion one way tells them apart but where it sets out, where no column is linear."""
    if not unsprung(search.whole, search.at):
        return []
    known = {entry.id: search.at.parameters, **entry.rivals}
    sizes = [
        abs(known[e.id][e.sizes[0].name]) for e in nameable(search.simulator.model) if resistance(e) and e.id in known
    ]
    if not sizes:
        return []
    others: dict[str, Scored] = {}
    for candidate, result in scored:
        if resistance(candidate.effect) and len(result.amplitudes) == 1:
            sign = 1 if result.amplitudes[0] > 0 else -1
            own = replace(result, amplitudes=(sign * sizes[0] / abs(candidate.probes[0].step),), moves={})
            others.setdefault(candidate.effect.id, (_whole(candidate), own))
    return list(others.values())


def _fitted(search: Search, forces: Mapping[Resistance, Candidate], told: Resisted, plain: Fitted) -> Taken | None:
    """The fit that begins with the forces of ``told``; None where it has none, or no file has one."""
    sizes = {Resistance.FRICTION: told.friction, Resistance.CONSTANT: told.constant}
    wanted = {kind: size for kind, size in sizes.items() if size}
    if not wanted or not wanted.keys() <= forces.keys():
        return None
    taken, values, free = [forces[kind] for kind in wanted], dict(search.at.parameters), [*search.at.free]
    for own, size in zip(taken, wanted.values(), strict=True):
        values |= {**own.shapes, own.probes[0].quantity.name: size}
        free += own.free(search.whole.period)
    values |= {"m": told.m, "dxx": told.d}
    begun = replace(search.at, parameters=values, free=tuple(free), whiten=plain.whiten)
    return Taken(search.whole.fit(search.whole.evaluated(begun)), taken, plain)


def _whole(candidate: Candidate) -> Candidate:
    """``candidate`` without a part of it that may vanish."""
    part = fading(candidate)
    return without_part(candidate, part) if part else candidate
