"""What a device can be that makes no energy: a fit keeps to it in every step."""

from collections.abc import Mapping
from typing import Final

import numpy as np

from discrepancy.fit.slow import taken
from gyro_model.model import Model

CROSS: Final = 0.999
"""Of the largest cross damping or stiffness that a passive device has: a search that reaches the bound goes on along
it."""


def passive(p: Mapping[str, float], axes: int, model: Model, duration: float) -> dict[str, float]:
    """``p`` with the cross damping and stiffness of a passive device, and with stiffnesses from which effects with
    states take no more at rest than lets the mass run away by a factor e over a ``duration`` [s]: one that nothing
    holds has none, which a fit knows to its noise alone."""
    result, own = dict(p), taken(p, model)
    for axis in "xy"[:axes]:
        stiffness, damping = f"k{axis}{axis}", f"d{axis}{axis}"
        if own[stiffness]:
            slow = p["m"] / duration**2 + max(p[damping], 0.0) / duration
            result[stiffness] = max(p[stiffness], own[stiffness] - slow)
    if axes == 2:
        for kind in "kd":
            room = CROSS * float(np.sqrt(max(result[kind + "xx"] * result[kind + "yy"], 0.0)))
            result[kind + "xy"] = float(np.clip(result[kind + "xy"], -room, room))
    return result
