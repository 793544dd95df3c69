"""The true resonance of the sense mode, for judging what was found; no loop and no tuner is told."""

from math import pi
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from cosim.rate.steady_state import parameters_at
from gyro_model.device import Device

Floats = NDArray[np.float64]

PLACES: Final = 33
"""Temperatures at which the laws are evaluated, a spline between them: laws of first order it takes exactly, an
exponential of 1 % over the range to 1e-12."""


def sense_resonance(device: Device, temperature: Floats, v_bias: Floats) -> Floats:
    """f_y = √(kyy/m)/2π [Hz] with the drive held, shape (n,): of y alone, small beside the gap, at the structure's
    ``temperature`` [K] and the bias ``v_bias`` [V], shapes (n,)."""
    low, high = float(temperature.min()), float(temperature.max())
    places = np.linspace(low, high, PLACES) if high > low else np.array([low])
    stiffness = np.array([parameters_at(device, float(place))["kyy"] for place in places])
    kyy = CubicSpline(places, stiffness)(temperature) if high > low else stiffness[0]
    p = device.all_parameters
    f_y: Floats = np.sqrt((kyy - p["softening"] * v_bias**2) / p["m"]) / (2 * pi)
    return f_y
