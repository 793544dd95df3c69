"""The voltage passes an anti-alias filter before the converter: Butterworth of fourth order, τ = 1/(2π f_c).

A. V. Oppenheim, R. W. Schafer, Discrete-Time Signal Processing, 2010, section 4.8.1: the filter before a converter.
"""

from collections.abc import Mapping
from typing import Final

import numpy as np
from scipy.signal import butter, cont2discrete, lfilter, lfilter_zi

from discrepancy.defect import Distortion, Timing
from discrepancy.record import Floats
from gyro_model.quantities import size

SETTLED: Final = 30.0
"""Time constants in a sample period after which the filter is a delay to 1e-3 of what it does."""
DELAY: Final = 2.6131259
"""Of the filter at low frequency, in time constants: the sum of 2 sin(pi/8) and 2 sin(3 pi/8)."""

TIME = size("voltage_filter", "s", "1/(2 pi f_c) of the voltage's low-pass filter", low=0.0, high=1e-3)


def voltage(v: Floats, timing: Timing, p: Mapping[str, float]) -> Floats:
    """The filtered voltage; v runs straight between two samples."""
    turns = timing.period / p["voltage_filter"]
    if turns > SETTLED:
        return np.asarray(v - DELAY / turns * np.gradient(v, axis=0))
    # Two sections of second order keep the numbers in range.
    result = v
    for section in np.array_split(butter(4, 1.0, analog=True, output="sos"), 2):
        # The numerator is its last number alone.
        a = section[0, 3:] * turns ** -np.arange(2.0, -1, -1)
        b, a, _ = cont2discrete((section[0, 2:3], a), 1.0, "foh")
        b = b.ravel()
        start = lfilter_zi(b, a)
        result = np.column_stack([lfilter(b, a, column, zi=start * column[0])[0] for column in result.T])
    return np.asarray(result)


DEFECT = Distortion(
    id="voltage_filter",
    parameters=(TIME,),
    signature="a delay of the voltage, and less of it and of its noise at high frequencies",
    source="A. V. Oppenheim, R. W. Schafer, Discrete-Time Signal Processing, 2010, section 4.8.1",
    voltage=voltage,
)
