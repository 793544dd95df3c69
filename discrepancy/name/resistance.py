"""Forces that do not grow with the motion, by their formula: what resists a mass that no spring holds."""

from enum import Enum
from typing import Final

from discrepancy.fit.defect import Defect
from gyro_model.anatomy import Effect, Force
from gyro_model.symbols import x_dot

FAST: Final = 1e3, 1e6
"""Speeds [m/s] at which a friction is one and the same, and anything that grows is not."""
SAME: Final = 1e-3
"""Relative."""


class Resistance(Enum):
    """What a force is: none of them, against the speed and no larger at a larger one, or always the same."""

    NONE = ""
    FRICTION = "friction"
    CONSTANT = "constant"

    def __bool__(self) -> bool:
        return self is not Resistance.NONE


def is_friction(effect: Effect | Defect) -> bool:
    """Whether it is one."""
    return resistance(effect) is Resistance.FRICTION


def resistance(effect: Effect | Defect) -> Resistance:
    """What the force of an effect on x is by its formula, at the usual sizes of its parameters."""
    if not isinstance(effect, Force) or effect.states or effect.impulse:
        return Resistance.NONE
    usual = {q.symbol: q.typical for q in effect.parameters}
    force = effect.force[0].subs(usual)
    if not force.free_symbols and force != 0:
        return Resistance.CONSTANT
    if force.free_symbols != {x_dot}:
        return Resistance.NONE
    slow, fast = (float(force.subs(x_dot, speed)) for speed in FAST)
    return Resistance.FRICTION if slow < 0 and abs(fast / slow - 1) < SAME else Resistance.NONE
