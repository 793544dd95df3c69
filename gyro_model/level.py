"""Where forces that bend the motion do not: regions of the states in which each stays as it is, as a dry friction does
away from rest, and a stop that does not touch."""

from collections.abc import Iterator
from functools import lru_cache
from typing import Final, NamedTuple

from sympy import Abs, Add, Dummy, Expr, Max, Min, Symbol, diff, exp, sqrt, sympify, tanh

from gyro_model import symbols
from gyro_model.anatomy import Force
from gyro_model.linear_forces import bends
from gyro_model.model import Model

STEEP: Final = 19.0
"""Beyond, a tanh is 1 to 2 e^-38 = 6e-17, which is rounding."""
FADED: Final = 37.0
"""exp(-37) is 9e-17, likewise."""


class Side(NamedTuple):
    """A side of a region: how far ``state`` is within it, in its unit, and a number that is positive where the region
    ends below the state, negative where it ends above."""

    state: Symbol
    distance: Expr
    direction: Expr


class Region(NamedTuple):
    """Where terms of a force do not go with the states: within all ``sides``, or anywhere while all their ``factors``
    are zero."""

    sides: tuple[Side, ...]
    factors: tuple[Expr, ...]


def regions(effect: Force, model: Model) -> tuple[Region, ...]:
    """Regions of all terms of a force that bends the motion; none where a term has none, and where the force does not
    bend it or may change without it."""
    return _all(model).get(effect.id, ())


@lru_cache(maxsize=8)
def _all(model: Model) -> dict[str, tuple[Region, ...]]:
    own = [e for e in model.forces if bends(e, model) and not (e.states or e.memories or symbols.t in e.symbols)]
    return {e.id: found for e in own if (found := _of(e, frozenset(model.state_symbols)))}


def _of(effect: Force, states: frozenset[Symbol]) -> tuple[Region, ...]:
    found: dict[tuple[Side, ...], list[Expr]] = {}
    for term in (own for force in effect.force for own in _terms(sympify(force))):
        factor, rest = term.as_independent(*states, as_Add=False)
        sides = _sides(rest, states)
        if sides is None:
            return ()
        if sides:
            found.setdefault(sides, []).append(factor)
    return tuple(Region(sides, tuple(factors)) for sides, factors in found.items())


def _terms(force: Expr) -> Iterator[Expr]:
    for term in Add.make_args(force):
        yield from Add.make_args(term.expand(deep=False))


def _sides(term: Expr, states: frozenset[Symbol]) -> tuple[Side, ...] | None:
    """Within which ``term`` has no state; None where there is no such region."""
    calls = [call for call in term.atoms(tanh, exp, Max, Min) if call.free_symbols & states]
    inner = sorted((own for own in calls if not any(own.has(other) for other in calls if other != own)), key=str)
    if not inner:
        return None if term.free_symbols & states else ()
    for stays, side in _stays(inner[0], states):
        rest = _sides(term.xreplace({inner[0]: stays}), states)
        if rest is not None:
            return side, *rest
    return None


def _stays(call: Expr, states: frozenset[Symbol]) -> Iterator[tuple[Expr, Side]]:
    """What ``call`` can be replaced by, and on which side of what."""
    if isinstance(call, Max | Min):
        larger = isinstance(call, Max)
        for own in call.args:
            rest = call.func(*(other for other in call.args if other != own))
            within = own - rest if larger else rest - own
            for state, slope in _straight(within, states):
                yield own, Side(state, within / Abs(slope), slope)
    elif isinstance(call, tanh):
        for state, slope in _straight(call.args[0], states):
            # From where it turns over, without a quotient at each step.
            place = (call.args[0] / slope).expand()
            yield Dummy(real=True), Side(state, Abs(place) - STEEP * Abs(1 / slope), place)
    else:
        power = call.args[0]
        for state in sorted(power.free_symbols & states, key=str):
            # That of a hump around zero.
            if sympify(diff(power / state**2, state)).simplify() == 0:
                faded = sqrt(-FADED * state**2 / power).simplify()
                yield sympify(0), Side(state, Abs(state) - faded, state)


def _straight(expr: Expr, states: frozenset[Symbol]) -> Iterator[tuple[Symbol, Expr]]:
    """The state that ``expr`` goes with on a line, and its slope."""
    own = expr.free_symbols & states
    if len(own) == 1:
        (state,) = own
        slope = sympify(diff(expr, state))
        if state not in slope.free_symbols:
            yield state, slope
