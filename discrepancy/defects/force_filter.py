"""The force passes a reconstruction filter: Butterworth of second order, F'' τ² + √2 τ F' + F = u, τ = 1/(2π f_c).

A. V. Oppenheim, R. W. Schafer, Discrete-Time Signal Processing, 2010, section 4.8.4: the filter after a converter.
"""

from collections.abc import Mapping
from typing import Final

import numpy as np
from scipy.linalg import expm
from scipy.signal import lfilter, lfilter_zi, ss2tf

from discrepancy.defect import Distortion
from discrepancy.record import Floats
from gyro_model.quantities import size

SETTLED: Final = 30.0
"""Time constants in a step after which the filter has settled to 1e-9."""

TIME = size("force_filter", "s", "1/(2 pi f_c) of the force's low-pass filter", low=0.0, high=1e-3)


def force(u: Floats, step: float, p: Mapping[str, float]) -> Floats:
    """The mean of the filtered force over each step."""
    turns = step / p["force_filter"]
    if turns > SETTLED:
        # What a step of u lacks until the filter has settled is sqrt(2) tau of it.
        return np.asarray(u - np.vstack((np.zeros_like(u[:1]), np.diff(u, axis=0))) * 2**0.5 / turns)
    # States F, F', the integral of F, and u, in units of tau.
    rate = np.array([[0.0, 1, 0, 0], [-1, -(2**0.5), 0, 1], [1, 0, 0, 0], [0, 0, 0, 0]])
    moved = expm(rate * turns)
    b, a = ss2tf(moved[:2, :2], moved[:2, 3:], moved[2:3, :2] / turns, moved[2:3, 3:] / turns)
    b = b.ravel()
    start = lfilter_zi(b, a)
    return np.column_stack([lfilter(b, a, column, zi=start * column[0])[0] for column in u.T])


DEFECT = Distortion(
    id="force_filter",
    parameters=(TIME,),
    signature="a delay of the force, and less of it at high frequencies",
    source="A. V. Oppenheim, R. W. Schafer, Discrete-Time Signal Processing, 2010, section 4.8.4",
    force=force,
    split=True,
)
