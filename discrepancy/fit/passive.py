"""What a device can be that makes no energy, and how it moves slowly: a fit keeps to both in every step."""

from collections.abc import Callable, Collection, Mapping
from functools import lru_cache
from typing import Final

import numpy as np
from sympy import Matrix, lambdify, simplify

from gyro_model import symbols
from gyro_model.anatomy import Force
from gyro_model.model import Model

CROSS: Final = 0.999
"""Of the largest cross damping or stiffness that a passive device has: a search that reaches the bound goes on along
it."""
NEARBY: Final = 1e-6
"""Of a step, for its slope: errors of rounding and of second order are both below 1e-6 of it."""
SLOW: Final = (("kxx", "dxx", "m"), ("kyy", "dyy", ""))
"""Of each axis, what a force in proportion to place, speed and acceleration takes from; of the mass that on x."""
Share = tuple[str, Callable[..., float], tuple[str, ...]]
"""Name of a stiffness, a damping or the mass, what an effect takes from it in slow motion [SI], and the parameters that
this is of."""


def passive(p: Mapping[str, float], axes: int, model: Model, duration: float) -> dict[str, float]:
    """``p`` with the cross damping and stiffness of a passive device, and with stiffnesses from which effects with
    states take no more at rest than lets the mass run away by a factor e over a ``duration`` [s]: one that nothing
    holds has none, which a fit knows to its noise alone."""
    result, taken = dict(p), _taken(p, model)
    for axis in "xy"[:axes]:
        stiffness, damping = f"k{axis}{axis}", f"d{axis}{axis}"
        if taken[stiffness]:
            slow = p["m"] / duration**2 + max(p[damping], 0.0) / duration
            result[stiffness] = max(p[stiffness], taken[stiffness] - slow)
    if axes == 2:
        for kind in "kd":
            room = CROSS * float(np.sqrt(max(result[kind + "xx"] * result[kind + "yy"], 0.0)))
            result[kind + "xy"] = float(np.clip(result[kind + "xy"], -room, room))
    return result


def as_slow(
    before: Mapping[str, float], after: Mapping[str, float], free: Collection[str], model: Model
) -> dict[str, float]:
    """``after``, a straight step from ``before``, with those ``free`` of mass, dampings and stiffnesses by which slow
    motion changes as it does to first order. What is left of a spring beside that of a resonator, of a damper or a mass
    moves a mass that nothing holds far, and to second order a straight step leaves much more of it than samples
    allow."""
    result = dict(after)
    nearby = {name: value + NEARBY * (after.get(name, value) - value) for name, value in before.items()}
    then, near = _taken(before, model), _taken(nearby, model)
    # The mass comes first: what is taken at rest and from a damping depends on it.
    for name in ("m", "kxx", "dxx", "kyy", "dyy"):
        if name in free and then[name]:
            result[name] += _taken(result, model)[name] - then[name] - (near[name] - then[name]) / NEARBY
    return result


def _taken(p: Mapping[str, float], model: Model) -> dict[str, float]:
    """What effects with states take from stiffnesses, dampings and the mass in slow motion [SI]."""
    taken = dict.fromkeys((name for names in SLOW for name in names), 0.0)
    for name, of, known in _shares(model):
        # Of an effect that is not in the model no value is known.
        taken[name] += of(*(p[own] for own in known)) if p.keys() >= set(known) else 0.0
    return taken


@lru_cache(maxsize=8)
def _shares(model: Model) -> list[Share]:
    """Of the forces with states that are linear in them and in the motion."""
    return [share for effect in model.forces if effect.states for share in _shares_of(effect, model)]


def _shares_of(effect: Force, model: Model) -> list[Share]:
    own = [state.symbol for state in effect.states]
    rates = Matrix([state.rate for state in effect.states])
    found = []
    motions = (symbols.x, symbols.x_dot), (symbols.y, symbols.y_dot)
    for axis, ((place, speed), names) in enumerate(zip(motions, SLOW, strict=True)):
        force = Matrix([effect.force[axis]])
        pushed, slopes, own_rates = rates.diff(place), force.jacobian(own), rates.jacobian(own)
        if pushed.is_zero_matrix or slopes.is_zero_matrix:
            continue
        # In slow motion the states are sums of place, speed and acceleration: their rates are the same a derivative on.
        by_place = -own_rates.LUsolve(pushed)
        by_speed = own_rates.LUsolve(by_place - rates.diff(speed))
        by_acceleration = own_rates.LUsolve(by_speed)
        forces = (force.diff(place) + slopes * by_place, force.diff(speed) + slopes * by_speed,
                  slopes * by_acceleration)  # fmt: skip
        taken = [simplify(own[0]) for own in forces]
        known = {q.symbol: q.name for q in model.quantities if q.role != "input"}
        # What goes with the motion is no stiffness.
        if all(own.free_symbols <= known.keys() for own in taken):
            for name, formula in zip(names, taken, strict=True):
                arguments = sorted(formula.free_symbols, key=str)
                found.append((name, lambdify(arguments, formula), tuple(known[s] for s in arguments)))
    return found
