"""The pole of the sense mode from its answers to a force above and below the drive (docs/theory/matching.md, eqs. 4-7).

z_{k+1} = a z_k + b u_k is the sense axis in the frame of the drive, u the whole force that the controller gave, its own
share included, so that it makes no difference whether the sense loop is closed.
"""

from cmath import exp, log
from math import pi, sqrt
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from calibration.matching.known import Sensed
from gyro_model.errors import InputError

Complexes = NDArray[np.complex128]

NEAREST: Final = 3
"""Bins between the tone and those that tell the noise: a Hann window's line is 4 bins wide."""
FARTHEST: Final = 14
ITERATIONS: Final = 8
"""Of the pole; each leaves ν/2ω, one percent, of the error."""


class Pole(NamedTuple):
    """The pole p of the sense mode in the frame of the drive [1/s], and the deviation of its imaginary part [1/s]."""

    value: complex
    deviation: float

    def split(self, frequency: float) -> float:
        """f_y - f_x [Hz] by undamped f_y, the drive being at ``frequency`` [Hz]."""
        omega = 2 * pi * frequency
        return (abs(complex(self.value.real, self.value.imag + omega)) - omega) / (2 * pi)


def find_pole(sensed: Sensed, tone: float) -> Pole:
    """The pole from a record with a dither at ``tone`` [Hz].

    Raises InputError for a record too short to tell the noise beside the tone.
    """
    omega = 2 * pi * float(sensed.frequency.mean())
    # The dither leaks to the drive and the loop that follows its phase follows it: a wobble of the oscillator at the
    # tone, which a strong drive line would carry to both sides. A frame of constant frequency has none.
    frame = np.exp(1j * np.cumsum(2 * pi * sensed.frequency - omega) * sensed.period)
    voltage, force = sensed.voltage * frame, sensed.force * frame
    turns = tone * sensed.period * len(sensed.voltage)
    if turns < 2 * FARTHEST:
        raise InputError(f"a block of {turns:.3g} periods of the dither: make it {2 * FARTHEST} or more")
    resolution = 1 / (sensed.period * len(sensed.voltage))
    beside = resolution * np.r_[-FARTHEST : -NEAREST + 1, NEAREST : FARTHEST + 1]
    noise = []
    pole = complex(-1.0)
    z = [_at(voltage, side * tone, sensed.period) for side in (1, -1)]
    u = [_at(force, side * tone, sensed.period) for side in (1, -1)]
    answers = [voltage / force for voltage, force in zip(z, u, strict=True)]
    ratio = answers[0] / answers[1]
    for _ in range(ITERATIONS):
        pole = _balanced(ratio, pole, 2 * pi * tone, sensed.period, omega)
    for side, answer in zip((1, -1), answers, strict=True):
        unit = answer / _shape(pole, side * 2 * pi * tone, sensed.period, omega)
        for offset in beside:
            f = side * tone + float(offset)
            left = _at(voltage, f, sensed.period)
            left -= unit * _shape(pole, 2 * pi * f, sensed.period, omega) * _at(force, f, sensed.period)
            noise.append(abs(left / z[0 if side > 0 else 1]) ** 2)
    # |dp| = |iν - p|/2 |dρ/ρ|, of which the imaginary part has half; ρ has the noise of both sides.
    relative = float(np.mean(noise))
    return Pole(pole, 0.5 * abs(2j * pi * tone - pole) * sqrt(2 * relative / 2))


def _at(values: Complexes, frequency: float, period: float) -> complex:
    """The complex amplitude of ``values`` at ``frequency`` [Hz] under a Hann window."""
    window = np.hanning(len(values) + 1)[:-1]
    return complex((window * values) @ np.exp(-2j * pi * frequency * period * np.arange(len(values))) / window.sum())


def _shape(pole: complex, nu: float, period: float, omega: float) -> complex:
    """The answer at the distance ``nu`` [rad/s] to a force held over ``period`` [s], but for a factor: the resonance
    and its image at minus the frequency, far away."""
    held = (exp(pole * period) - 1) / pole if pole else complex(period)
    return held / (exp(1j * nu * period) - exp(pole * period)) - _image(pole, nu, period, omega)


def _image(pole: complex, nu: float, period: float, omega: float) -> complex:
    return exp(-1j * nu * period) / (1j * (2 * omega + nu) - pole.conjugate())


def _balanced(ratio: complex, pole: complex, nu: float, period: float, omega: float) -> complex:
    """The pole at which the answers have the ``ratio``, the shares of their images being those at ``pole``."""
    above, below = (1 + _image(pole, s * nu, period, omega) / _shape(pole, s * nu, period, omega) for s in (1, -1))
    alone = ratio * above / below
    return log((alone * exp(1j * nu * period) - exp(-1j * nu * period)) / (alone - 1)) / period
