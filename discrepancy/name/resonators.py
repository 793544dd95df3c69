"""Resonators that a mass carries as effects of a model: their values, and where a fit with them begins."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import inf, pi, sqrt
from typing import Final, NamedTuple

import numpy as np
from sympy import Symbol, solve

from discrepancy.data.absorbers import Absorber, Carried
from discrepancy.data.modes import ENOUGH
from discrepancy.fit.continuation import ASTRAY, beginnings, grown
from discrepancy.fit.defect import Defect
from discrepancy.fit.fitted import Fitted, bare
from discrepancy.fit.refit import Fitter
from discrepancy.name.accepted import Taken
from discrepancy.name.columns import Candidate, left_out, with_part
from discrepancy.name.cubic import cubic_sizes
from discrepancy.name.more_modes import resonator_axis
from discrepancy.name.resistance import is_friction
from discrepancy.name.resisting import steepest
from discrepancy.name.search import Search
from discrepancy.name.shaping import freed, unmoved
from gyro_model import symbols
from gyro_model.anatomy import Effect, Force

STEEPER: Final = 10.0
"""Times steeper than at the first point of its grid, that a friction may become beside resonators. Ten times more takes
ten times as long: of drives that stick no name was left where the time was over."""


class Resonator(NamedTuple):
    """An effect with its shapes, values of sizes and of shapes that nothing moves, by name, and how much of its damping
    lies along its spring."""

    candidate: Candidate
    values: Mapping[str, float]
    joint: float


class Beside(NamedTuple):
    """The plain fit of whole runs, and a fitter of those or of their openings with its fit without resonators."""

    plain: Fitted
    near: Fitter
    without: Fitted

    def taken(self, search: Search, best: Taken | None) -> Taken | None:
        """The ``best`` that was found near, over whole runs, where it leaves plainly less; else None."""
        near, whole = self.near, search.whole
        if best is None or near.off(best.at) ** 2 > ENOUGH * near.off(self.without) ** 2:
            return None
        if near is whole:
            return best
        search.simulator.forget(near.records)
        with search.simulator.clock.unhurried():
            at = whole.evaluated(replace(best.at, whiten=self.plain.whiten))
        # A friction that is too steep for whole runs is none that could be fitted.
        return Taken(at, best.taken, self.plain) if np.isfinite(at.cost) else None


def beside(search: Search) -> Beside:
    """What resonators are held against. Long runs are fitted by their openings, from where a fit of the whole goes
    on."""
    whole = search.whole
    plain = whole.fit(replace(search.at, whiten=whole.plain(search.at.parameters)))
    near = whole if search.shortest == 1 else beginnings(whole, search.shortest)
    return Beside(plain, near, plain if near is whole else near.fit(near.evaluated(plain)))


def price(search: Search, own: Taken) -> float:
    """What a fit leaves, and what its parameters have to bring, as a chi-square."""
    return own.at.count * own.at.unlikely + search.criteria.simpler * len(own.at.free)


def fitted_from(fitter: Fitter, begun: Fitted, goal: float = inf) -> Fitted:
    """The fit from there, as far as it may cost less than ``goal``; by beginnings that grow where it is not in step
    with the motion yet, unless these lead further off."""
    near = grown(fitter, begun) if fitter.off(begun) > ASTRAY else begun
    return fitter.fit(min(near, begun, key=lambda at: at.cost), goal=goal)


def with_all_shapes(fitter: Fitter, own: Taken) -> Taken:
    """The fit with those shapes of what it has taken free too that were held."""
    at = all_free(fitter, own)
    return own._replace(at=fitter.fit(at)) if at.free != own.at.free else own


def all_free(fitter: Fitter, own: Taken) -> Fitted:
    """The same, not fitted."""
    free = {known.name for known in own.at.free}
    late = [replace(c, searched=tuple(q for q in c.searched if q.name not in free)) for c in own.taken]
    held = [shape for c in late for shape in c.free(fitter.period) if shape.name not in free]
    return bare(replace(own.at, free=(*own.at.free, *held))) if held else own.at


def begun_with(search: Search, fitter: Fitter, told: Carried, resonators: Sequence[Resonator], plain: Fitted, *,
           jointed: bool) -> Taken:  # fmt: skip
    """What is ``told``, not fitted; ``jointed``: with usual shapes of the resonators free as well, since what couples
    them is no spring alone. The mass is damped as is told, or at least as in the plain fit, where less is left so."""
    now = search.at.parameters
    more = {name: max(d, now[name]) for name, d in zip(("dxx", "dyy"), np.diag(told.d), strict=False)}
    # Where no sensor shows the place of a mass that nothing holds, a fit without them may have put it anywhere.
    at = replace(
        plain, free=search.at.free, parameters={**now, "m": told.m, **_of_mass(told)}, starts=fitter.starts(now)
    )
    taken = []
    for own in resonators:
        candidate, joints = own.candidate, unmoved(own.candidate) if jointed else []
        at = replace(at, parameters={**at.parameters, **candidate.shapes, **own.values},
                     free=(*at.free, *candidate.free(fitter.period)))  # fmt: skip
        if joints:
            at = freed(at, candidate, joints)
            at = replace(at, parameters={**at.parameters, **dict.fromkeys((q.name for q in joints), own.joint)})
        taken.append(replace(candidate, searched=(*candidate.searched, *joints)))
    for made in _made(search, told):
        # A friction as steep as it is: while the rest is far off a fit would smooth it, and end there.
        at = replace(at, parameters={**at.parameters, **made.candidate.shapes, **made.values},
                     free=(*at.free, *(probe.free() for probe in made.candidate.probes)))  # fmt: skip
        taken.append(made.candidate)
    tried = [fitter.passive({**at.parameters, **own}) for own in ({}, more)]
    fits = [fitter.evaluated(replace(at, parameters=own)) for own in tried if all(own[name] > 0 for name in more)]
    return Taken(min(fits, key=lambda fit: fit.cost), taken, plain)


def _made(search: Search, told: Carried) -> list[Resonator]:
    """The effects that are the friction and the cube, if any are ``told`` and there are files for them."""
    found = []
    if told.friction.any():
        for own in steepest(search, is_friction).values():
            own = _no_steeper(own)
            own = _near_rest(own, told.near_rest) if told.near_rest else own
            sizes = {p.quantity.name: float(f) for p, f in zip(own.probes, told.friction, strict=True)}
            found.append(Resonator(own, sizes, 0.0))
    cubic = [(float(k3), 0.0) for k3 in told.cubic]
    for own in search.library.candidates(search.whole, search.at, search.present, lambda e: _bends(e, cubic)):
        sizes = cubic_sizes(own.effect, cubic)
        found.append(Resonator(own, {p.quantity.name: sizes[p.quantity.name] for p in own.probes}, 0.0))
    return found


def _no_steeper(friction: Candidate) -> Candidate:
    """``friction`` that is not to be much steeper than at the first point of its grid: of a mass that is held again and
    again little shows it, and whole runs take too long to fit."""
    ends = {}
    for q in friction.searched:
        if q.search:
            low, high = friction.ends.get(q.name, (friction.shapes[q.name],) * 2)
            ends[q.name] = (max(low, friction.shapes[q.name] * q.search.below / STEEPER), high)
    return replace(friction, ends=ends)


def _near_rest(friction: Candidate, excess: tuple[float, float]) -> Candidate:
    """``friction`` with its part that fades with speed, if it has one: by how much it exceeds the rest, and the speed
    at which that has faded, which may be elsewhere than on its grid."""
    part = left_out(friction.effect, ())
    if part is None or len(part.shapes) != 1:
        return friction
    values = dict(zip((part.size.name, part.shapes[0].name), excess, strict=True))
    ends = {name: own for name, own in friction.ends.items() if name not in values}
    return replace(with_part(friction, part, values), ends=ends)


def _bends(effect: Effect | Defect, cubic: Sequence[tuple[float, float]]) -> bool:
    return any(cubic_sizes(effect, cubic).values())


def _of_mass(told: Carried) -> dict[str, float]:
    """Stiffness and damping of the mass, by name."""
    places = [(0, 0, "xx"), (1, 1, "yy"), (0, 1, "xy")][: 2 * len(told.k) - 1]
    return {f"{kind}{axes}": float(of[i, j]) for i, j, axes in places for kind, of in (("k", told.k), ("d", told.d))}


def resonators(search: Search, told: Carried) -> list[Resonator]:
    """Effects that are the absorbers; those that are coupled least are left out where there are fewer such effects, and
    those whose damping along their spring none of these can have: no load has it, but what a friction or a loop around
    the mass makes of a tone."""
    waiting = [name for name in search.given.copies if name in search.present]
    present = [name for name in search.present if name not in waiting]
    known = search.library.candidates(search.whole, search.at, present, lambda e: resonator_axis(e) is not None)
    ready = {c.effect.id: c for c in known}
    found = []
    for absorber in told.absorbers:
        fitting = [c for c in ready.values() if resonator_axis(c.effect) == absorber.axis]
        if fitting:
            joint = float(absorber.joint[absorber.axis])
            if not all(q.low <= joint <= q.high for q in unmoved(fitting[0])):
                continue
            own = fitting[0]
            values = _as(own.effect, absorber, told.m)
            if not all(q.low <= values[q.name] <= q.high for q in own.effect.parameters if q.name in values):
                # What goes slower than any resonator may is how the sensor wanders, or how a run begins.
                continue
            del ready[own.effect.id]
            shapes = {name: values.pop(name) for name in own.shapes}
            found.append(Resonator(replace(own, shapes=shapes), values, joint))
    return found


def _as(effect: Effect | Defect, absorber: Absorber, mass: float) -> dict[str, float]:
    """The size and the shapes of such an effect with which it is the ``absorber`` of a ``mass`` [kg], by name."""
    assert isinstance(effect, Force)
    axis, of = absorber.axis, {"resonance": absorber.frequency, "quality": absorber.quality}
    shapes = {q.name: of[q.search.kind] for q in effect.parameters if q.search is not None and q.search.tried}
    given = {q.symbol: shapes.get(q.name, 1.0 if q.role == "size" else q.start) for q in effect.parameters}
    given |= dict.fromkeys((symbols.u_x, symbols.u_y, symbols.x_dot, symbols.y_dot), 0.0)
    given |= {symbols.m: mass, symbols.x: 1.0, symbols.y: 1.0}
    # At rest it takes from the stiffness of the mass, in proportion to the square of its size, which acts both ways.
    at_rest = solve([s.rate.subs(given) for s in effect.states], [s.symbol for s in effect.states])
    of_one = float(effect.force[axis].subs(given).subs(at_rest))
    coupling = float(absorber.coupling[axis])
    size = coupling / sqrt(mass * of_one) / (2 * pi * absorber.frequency)
    return {**shapes, effect.sizes[0].name: size, **_driven(effect, absorber, given | {effect.sizes[0].symbol: size})}


def _driven(effect: Force, absorber: Absorber, given: Mapping[Symbol, float]) -> dict[str, float]:
    """The shape, by name, that says how much of the drive acts on such an effect, where it has one and the ``absorber``
    is driven; it takes as much from the mass as it is."""
    command = (symbols.u_x, symbols.u_y)[absorber.axis]
    taken = -effect.force[absorber.axis].diff(command)
    shares = [q for q in effect.parameters if taken.has(q.symbol) and q.role == "shape" and q.search is None]
    if not shares or not absorber.drive:
        return {}
    return {shares[0].name: absorber.drive / float(taken.subs({**given, shares[0].symbol: 1.0}))}
