"""What a device can be that makes no energy: a fit keeps to it in every step."""

from collections.abc import Callable, Mapping
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
Pull = tuple[str, Callable[..., float], tuple[str, ...]]
"""Name of a stiffness, what an effect takes from it at rest [N/m], and the parameters that this is of."""


def passive(p: Mapping[str, float], axes: int, model: Model, duration: float) -> dict[str, float]:
    """``p`` with the cross damping and stiffness of a passive device, and with stiffnesses from which effects with
    states take no more at rest than lets the mass run away by a factor e over a ``duration`` [s]: one that nothing
    holds has none, which a fit knows to its noise alone."""
    result = dict(p)
    taken = {"kxx": 0.0, "kyy": 0.0}
    for name, of, known in _pulls(model):
        # Of an effect that is not in the model no value is known.
        taken[name] += of(*(p[own] for own in known)) if p.keys() >= set(known) else 0.0
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


@lru_cache(maxsize=8)
def _pulls(model: Model) -> list[Pull]:
    """Of the forces with states that are linear in them and in the place, what each takes from a stiffness."""
    return [pull for effect in model.forces if effect.states for pull in _pulls_of(effect, model)]


def _pulls_of(effect: Force, model: Model) -> list[Pull]:
    own = [state.symbol for state in effect.states]
    found = []
    for axis, (place, name) in enumerate(((symbols.x, "kxx"), (symbols.y, "kyy"))):
        rates = Matrix([state.rate for state in effect.states])
        pushed, slopes = rates.diff(place), Matrix([effect.force[axis]]).jacobian(own)
        if pushed.is_zero_matrix or slopes.is_zero_matrix:
            continue
        followed = rates.jacobian(own).LUsolve(pushed)
        pull = simplify(Matrix([effect.force[axis]]).diff(place)[0] - (slopes * followed)[0])
        names = {q.symbol: q.name for q in model.quantities if q.role != "input" and q.symbol in pull.free_symbols}
        # What goes with the motion is no stiffness.
        if names.keys() == pull.free_symbols:
            found.append((name, lambdify(list(names), pull), tuple(names.values())))
    return found
