"""How a device moves slowly: what effects with states, as a resonator, take of stiffness, damping and mass then.

In slow motion the states of an effect that is linear in them and in the motion are sums of place, speed and
acceleration, q = q0 x + q1 x' + q2 x''. So is its force, and each part of it takes from a stiffness, a damping or the
mass. What is left of these moves a mass that nothing holds, and far.
"""

from collections.abc import Callable, Collection, Mapping
from functools import lru_cache
from math import isfinite
from typing import Final, NamedTuple

import numpy as np
from sympy import Expr, Matrix, lambdify, simplify

from gyro_model import symbols
from gyro_model.anatomy import Force
from gyro_model.model import Model

NEARBY: Final = 1e-6
"""Of a step, for its slope: errors of rounding and of second order are both below 1e-6 of it."""
ADRIFT: Final = 0.4
"""Stiffness over mass, times the square of a run, up to which the spring does not show: (2π/10)², of a run that is a
tenth of a period long."""
AXES: Final = (
    (symbols.x, symbols.x_dot, ("kxx", "dxx", "m")),
    (symbols.y, symbols.y_dot, ("kyy", "dyy", "")),
)
"""Place and speed of each axis, and what parts of a force take from; of the mass those on x."""


class _Formula(NamedTuple):
    """Of parameters."""

    of: Callable[..., float]
    names: tuple[str, ...]

    def at(self, p: Mapping[str, float]) -> float:
        """At parameters ``p``; of an effect that is not in the model no value is known, and it takes nothing."""
        if not p.keys() >= set(self.names):
            return 0.0
        # At a bound, as a quality of zero, it may be beyond all numbers.
        with np.errstate(all="ignore"):
            return float(self.of(*(np.float64(p[name]) for name in self.names)))


class _Slow(NamedTuple):
    """What an effect takes, by what of; by the name of the initial value of a state, how that follows the place at
    rest."""

    place: str
    taken: Mapping[str, _Formula]
    follows: Mapping[str, _Formula]


def taken(p: Mapping[str, float], model: Model) -> dict[str, float]:
    """What effects with states take from stiffnesses, dampings and the mass in slow motion [SI]."""
    found = dict.fromkeys((name for _, _, names in AXES for name in names), 0.0)
    for slow in _all(model):
        for name, formula in slow.taken.items():
            found[name] += formula.at(p)
    return found


def as_slow(
    before: Mapping[str, float], after: Mapping[str, float], free: Collection[str], model: Model
) -> dict[str, float]:
    """``after``, a straight step from ``before``, with those ``free`` of dampings and stiffnesses by which slow motion
    changes as it does to first order. To second order a straight step leaves far more of a spring than samples allow
    where nothing holds the mass."""
    result = dict(after)
    nearby = {name: value + NEARBY * (after.get(name, value) - value) for name, value in before.items()}
    then, near = taken(before, model), taken(nearby, model)
    now = taken(after, model)
    for name in ("kxx", "dxx", "kyy", "dyy"):
        if name in free and then[name]:
            bend = now[name] - then[name] - (near[name] - then[name]) / NEARBY
            result[name] += bend if isfinite(bend) else 0.0
    return result


def adrift(p: Mapping[str, float], axes: int, model: Model, duration: float) -> tuple[str, ...]:
    """Names of the initial displacements of those axes on which nothing that shows over a ``duration`` [s] holds the
    mass: no force says where it begins."""
    own = taken(p, model)
    mass = p["m"] - own["m"]
    held = {axis: p[f"k{axis}{axis}"] - own[f"k{axis}{axis}"] for axis in "xy"[:axes]}
    return tuple(f"{axis}_start" for axis, stiffness in held.items() if abs(stiffness) * duration**2 < ADRIFT * mass)


def moved_along(start: Mapping[str, float], place: str, p: Mapping[str, float], model: Model) -> dict[str, float]:
    """Initial states from which the mass goes the same way, but from zero: with the displacement ``place`` goes what
    follows it at rest."""
    way = -start.get(place, 0.0)
    result = {**start, place: 0.0}
    for slow in _all(model):
        if slow.place == place:
            result |= {name: start[name] + own.at(p) * way for name, own in slow.follows.items() if name in start}
    return result


@lru_cache(maxsize=8)
def _all(model: Model) -> list[_Slow]:
    return [slow for effect in model.forces if effect.states for slow in _of(effect, model)]


def _of(effect: Force, model: Model) -> list[_Slow]:
    states = [state.symbol for state in effect.states]
    rates = Matrix([state.rate for state in effect.states])
    found = []
    for axis, (place, speed, names) in enumerate(AXES):
        force = Matrix([effect.force[axis]])
        pushed, slopes, own_rates = rates.diff(place), force.jacobian(states), rates.jacobian(states)
        if pushed.is_zero_matrix or slopes.is_zero_matrix:
            continue
        # The rate of each sum is the same sum a derivative on.
        by_place = -own_rates.LUsolve(pushed)
        by_speed = own_rates.LUsolve(by_place - rates.diff(speed))
        by_acceleration = own_rates.LUsolve(by_speed)
        forces = [force.diff(place)[0] + (slopes * by_place)[0], force.diff(speed)[0] + (slopes * by_speed)[0],
                  (slopes * by_acceleration)[0]]  # fmt: skip
        own = {name: _formula(simplify(part), model) for name, part in zip(names, forces, strict=True)}
        starts = {
            state.start.name: simplify(by) for state, by in zip(effect.states, by_place, strict=True) if state.start
        }
        follows = {name: _formula(by, model) for name, by in starts.items()}
        known_own = {name: formula for name, formula in own.items() if formula}
        # What goes with the motion is no stiffness.
        if len(known_own) == len(own):
            known = {name: formula for name, formula in follows.items() if formula}
            found.append(_Slow(f"{place}_start", known_own, known))
    return found


def _formula(expression: Expr, model: Model) -> _Formula | None:
    """None where it has more than parameters."""
    names = {q.symbol: q.name for q in model.quantities if q.role != "input"}
    own = sorted(expression.free_symbols, key=str)
    return _Formula(lambdify(own, expression), tuple(names[s] for s in own)) if names.keys() >= set(own) else None
