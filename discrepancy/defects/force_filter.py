"""The force passes a reconstruction filter: Butterworth of second order, F'' τ² + √2 τ F' + F = u, τ = 1/(2π f_c).

A. V. Oppenheim, R. W. Schafer, Discrete-Time Signal Processing, 2010, section 4.8.4: the filter after a converter.
"""

from collections.abc import Mapping

import numpy as np
from scipy.signal import cont2discrete, lfilter, lfilter_zi

from discrepancy.defect import Distortion
from discrepancy.record import Floats
from gyro_model.quantities import size

TIME = size("force_filter", "s", "1/(2 pi f_c) of the force's low-pass filter", low=0.0, high=1e-3)


def force(u: Floats, step: float, p: Mapping[str, float]) -> Floats:
    """The mean of the filtered force over each step."""
    tau = p["force_filter"]
    b, a, _ = cont2discrete(([1.0], [tau**2, 2**0.5 * tau, 1.0]), step, "zoh")
    b = b.ravel()
    start = lfilter_zi(b, a)
    held = np.column_stack([lfilter(b, a, column, zi=start * column[0])[0] for column in u.T])
    return np.asarray(0.5 * (held + np.vstack((held[1:], held[-1:]))))


DEFECT = Distortion(
    id="force_filter",
    parameters=(TIME,),
    signature="a delay of the force, and less of it at high frequencies",
    source="A. V. Oppenheim, R. W. Schafer, Discrete-Time Signal Processing, 2010, section 4.8.4",
    force=force,
    split=True,
)
