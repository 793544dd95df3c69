"""The clock of the voltage runs faster than that of the force: v_k = v(t_k + s t_k) where both start together.

Two crystals differ by up to 100 ppm (IEEE Std 1057-2017, section 9, treats the frequency error of a sampling clock).
"""

from collections.abc import Mapping
from math import ceil

import numpy as np

from discrepancy.data.record import Floats
from discrepancy.fit.between import between
from discrepancy.fit.defect import Distortion, Timing
from gyro_model.quantities import size

SKEW = size("clock_skew", "1", "relative lag of the voltage's sampling clock", low=-1e-3, high=1e-3)


def voltage(v: Floats, timing: Timing, p: Mapping[str, float]) -> Floats:
    """The voltage at the instants of the other clock."""
    k = np.arange(len(v), dtype=np.float64)
    return between(v, k + p["clock_skew"] * (timing.first + k))


def beyond(n: int, timing: Timing, p: Mapping[str, float]) -> int:
    """Samples by which the last one comes later."""
    return max(ceil(p["clock_skew"] * (timing.first + n)) + 2, 0)


DEFECT = Distortion(
    id="clock_skew",
    parameters=(SKEW,),
    signature="a phase of the response that grows with time",
    source="IEEE Std 1057-2017, section 9",
    voltage=voltage,
    beyond=beyond,
)
