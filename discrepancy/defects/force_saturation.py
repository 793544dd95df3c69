"""The force's amplifier saturates: u is cut at ±1/s, a hard limit stated by its inverse so that 0 is none.

H. K. Khalil, Nonlinear Systems, 2002, section 7.1: saturation.
"""

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np

from discrepancy.data.record import Floats, Record
from discrepancy.fit.defect import Distortion
from gyro_model.quantities import size

SHARES: Final = (0.97, 0.93, 0.87, 0.8, 0.72, 0.64, 0.56, 0.48, 0.4)
"""Of the largest force: below the last an experimenter sees it."""

INVERSE = size("force_saturation", "1/N", "one over the force at which the amplifier saturates", low=0.0)


def force(u: Floats, step: float, p: Mapping[str, float]) -> Floats:
    """The force within its limit."""
    limit = 1 / p["force_saturation"]
    return np.clip(u, -limit, limit)


def levels(records: Sequence[Record]) -> list[float]:
    """Limits below the largest force."""
    peak = max(float(np.abs(r.u).max()) for r in records)
    return [1 / (share * peak) for share in SHARES] if peak > 0 else []


DEFECT = Distortion(
    id="force_saturation",
    parameters=(INVERSE,),
    signature="less response at the peaks of the force",
    source="H. K. Khalil, Nonlinear Systems, 2002, section 7.1",
    force=force,
    levels=levels,
)
