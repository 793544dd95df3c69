"""The transfer function from the rate to the output of rate mode, as loops and filters are designed.

The sense axis answers with 1/D(s), D(s) = m (s + iω)² + dyy (s + iω) + kyy in the frame of the drive at ω; a rate that
moves mixes from both sides of it:

    open:    H(s) = ½ [D(0)/D(s) + D*(0)/D*(s)],   D*(s) = conj D(conj s)
    closed:  H(s) = ω_b L(s)/(s + ω_b L(s))   with the demodulator L inside the loop

For s, Δ = ω_y - ω and γ = dyy/2m far below ω the open loop is (Δ² + γ² + γs)/(s² + 2γs + Δ² + γ²): it peaks at the
split.
Demodulator and output filter follow, each two sections, as sampled.
"""

from math import pi

import numpy as np
from numpy.typing import NDArray

from cosim.rate.filters import LowPass
from cosim.rate.run import RateRun
from cosim.rate.steady_state import output_at, parameters_at
from gyro_model.device import Device

Complexes = NDArray[np.complex128]


def expected_transfer(device: Device, run: RateRun, frequency: NDArray[np.float64]) -> Complexes:
    """H at ``frequency`` [Hz], shape (n,), over its value at rest."""
    s: Complexes = np.complex128(2j * pi) * frequency
    # The envelope FMU gives what a demodulator would.
    demodulator = np.ones_like(s) if run.envelope else _filter(s, run.settings.demodulator_bandwidth, run.period)
    if run.closed:
        inside = 2 * pi * run.settings.sense_bandwidth * demodulator
        gain = inside / (s + inside)
    else:
        gain = _open(device, run, s)
        gain = gain * demodulator
    # A sample shows the rate before it, and the rate is held after it: half a sample on average.
    return np.asarray(np.exp(-s * run.period / 2) * gain * _filter(s, run.settings.output_bandwidth, run.period))


def _open(device: Device, run: RateRun, s: Complexes) -> Complexes:
    p = parameters_at(device, t_ref := device.all_parameters["t_ref"])
    omega = 2 * pi * output_at(device, run.nominal.calibration, t_ref).drive_frequency

    def side(s: Complexes, sign: int) -> Complexes:
        fast = s + sign * 1j * omega
        return np.asarray(p["m"] * fast**2 + p["dyy"] * fast + p["kyy"])

    zero = np.zeros(1, complex)
    return np.asarray(0.5 * (side(zero, 1) / side(s, 1) + side(zero, -1) / side(s, -1)))


def _filter(s: Complexes, bandwidth: float, period: float) -> Complexes:
    """Two sections a_k = a_{k-1} + g (s_k - a_{k-1}) at the sample ``period`` [s]."""
    g = LowPass.design(bandwidth, period).gain
    return np.asarray((g / (1 - (1 - g) * np.exp(-s * period))) ** 2)
