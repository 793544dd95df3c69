"""Solves the device `rate-mode` for the drift of Liu et al. 2014: ``python -m benchmarks.rate_device`` prints the three
parameters."""

import sys
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import fsolve

from cosim.rate.courses import ZERO_CELSIUS
from cosim.rate.metrics import PER_HOUR
from cosim.rate.settings import settings_of
from cosim.rate.steady_state import calibrate, output_at
from gyro_model.device import Device, load_device

Floats = NDArray[np.float64]

SOAKS: Final = np.array([-20.0, 0.0, 20.0, 40.0, 60.0])
"""Temperatures of Liu et al. 2014 [°C]."""
SCALE_DRIFT: Final = 316.66e-6
"""Of the scale factor [1/K], (max - min)/range over the soaks."""
BIAS_DRIFT: Final = 366.22
"""Of the bias [°/h/K]."""
REST_BIAS: Final = 2.0
"""At t_ref [°/s]: of the order of a trimmed device."""
SIZES: Final = {"actuator_misalignment": 1e-2, "tck_split": 1e-6, "dxy": 1e-9}
"""What is solved for, and in which unit: by the drift of the bias, by that of the scale factor, by the bias."""


def solve(device: Device) -> dict[str, float]:
    """``actuator_misalignment``, ``tck_split`` and ``dxy`` with which ``device`` drifts as Liu et al. 2014 say, to six
    digits, found from those it has."""

    def missed(z: Floats) -> Floats:
        return _missed(device.with_parameters(_named(z)))

    start = np.array([device.parameters[name] / unit for name, unit in SIZES.items()])
    return {name: float(f"{value:.6g}") for name, value in _named(fsolve(missed, start)).items()}


def _named(z: Floats) -> dict[str, float]:
    return {name: float(value) * unit for value, (name, unit) in zip(z, SIZES.items(), strict=True)}


def _missed(device: Device) -> Floats:
    known = calibrate(device, settings_of(device).drive_amplitude, closed=False)
    outputs = [output_at(device, known, float(t) + ZERO_CELSIUS) for t in SOAKS]
    scale, bias = np.array([o.scale_factor for o in outputs]), np.array([o.bias for o in outputs])
    rest = np.rad2deg(output_at(device, known, device.all_parameters["t_ref"]).bias)
    span = np.ptp(SOAKS)
    return np.array(
        [PER_HOUR * np.ptp(bias) / span / BIAS_DRIFT - 1, np.ptp(scale) / span / SCALE_DRIFT - 1, rest - REST_BIAS]
    )


if __name__ == "__main__":
    for name, value in solve(load_device("rate-mode")).items():
        sys.stdout.write(f"{name} = {value:.6g}\n")
