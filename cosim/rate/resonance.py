"""The true resonance of the sense mode, for judging what was found; no loop and no tuner is told."""

from math import pi, sqrt

from cosim.rate.steady_state import parameters_at
from gyro_model.device import Device


def sense_resonance(device: Device, temperature: float, v_bias: float) -> float:
    """f_y = √(kyy/m)/2π [Hz] with the drive held: of y alone, small beside the gap, at the structure's ``temperature``
    [K] and the bias ``v_bias`` [V]."""
    p = parameters_at(device, temperature)
    return sqrt((p["kyy"] - p["softening"] * v_bias**2) / p["m"]) / (2 * pi)
