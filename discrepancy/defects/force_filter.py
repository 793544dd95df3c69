"""The force passes a reconstruction filter: Butterworth, τ = 1/(2π f_c).

A. V. Oppenheim, R. W. Schafer, Discrete-Time Signal Processing, 2010, section 4.8.4: the filter after a converter.
"""

from collections.abc import Mapping

from discrepancy.data.record import Floats
from discrepancy.fit.defect import Distortion
from discrepancy.fit.low_pass import delay, held, order
from gyro_model.quantities import size

TIME = size("force_filter", "s", "1/(2 pi f_c) of the force's low-pass filter", low=0.0, high=1e-3)
ORDER = order("force", 2)


def force(u: Floats, step: float, p: Mapping[str, float]) -> Floats:
    """The mean of the filtered force over each step."""
    return held(u, step / p["force_filter"], int(p["force_filter_order"]))


def late(p: Mapping[str, float]) -> float:
    """The group delay at rest [s]."""
    return p["force_filter"] * delay(int(p["force_filter_order"]))


DEFECT = Distortion(
    id="force_filter",
    parameters=(TIME, ORDER),
    signature="a delay of the force, and less of it at high frequencies",
    source="A. V. Oppenheim, R. W. Schafer, Discrete-Time Signal Processing, 2010, section 4.8.4",
    force=force,
    split=True,
    late=late,
)
