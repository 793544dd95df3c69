"""The force's amplifier saturates: u is cut at ±1/s, a hard limit stated by its inverse so that 0 is none.

H. K. Khalil, Nonlinear Systems, 2002, section 7.1: saturation.
"""

from collections.abc import Mapping

import numpy as np

from discrepancy.defect import Distortion
from discrepancy.record import Floats
from gyro_model.quantities import size

INVERSE = size("force_saturation", "1/N", "one over the force at which the amplifier saturates", low=0.0)


def force(u: Floats, step: float, p: Mapping[str, float]) -> Floats:
    """The force within its limit."""
    limit = 1 / p["force_saturation"]
    return np.clip(u, -limit, limit)


DEFECT = Distortion(
    id="force_saturation",
    parameters=(INVERSE,),
    signature="less response at the peaks of the force",
    source="H. K. Khalil, Nonlinear Systems, 2002, section 7.1",
    force=force,
)
