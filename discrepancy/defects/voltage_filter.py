"""The voltage passes an anti-alias filter before the converter: Butterworth, τ = 1/(2π f_c).

A. V. Oppenheim, R. W. Schafer, Discrete-Time Signal Processing, 2010, section 4.8.1: the filter before a converter.
"""

from collections.abc import Mapping

from discrepancy.data.record import Floats
from discrepancy.fit.defect import Distortion, Timing
from discrepancy.fit.low_pass import delay, order, sampled
from gyro_model.quantities import size

TIME = size("voltage_filter", "s", "1/(2 pi f_c) of the voltage's low-pass filter", low=0.0, high=1e-3)
ORDER = order("voltage", 4)


def voltage(v: Floats, timing: Timing, p: Mapping[str, float]) -> Floats:
    """The filtered voltage."""
    columns = v.reshape(len(v), -1)
    return sampled(columns, timing.period / p["voltage_filter"], int(p["voltage_filter_order"])).reshape(v.shape)


def late(p: Mapping[str, float]) -> float:
    """The group delay at rest [s]."""
    return p["voltage_filter"] * delay(int(p["voltage_filter_order"]))


DEFECT = Distortion(
    id="voltage_filter",
    parameters=(TIME, ORDER),
    signature="a delay of the voltage, and less of it and of its noise at high frequencies",
    source="A. V. Oppenheim, R. W. Schafer, Discrete-Time Signal Processing, 2010, section 4.8.1",
    voltage=voltage,
    within=True,
    late=late,
)
