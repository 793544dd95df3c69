"""The pole of the sense mode from its answers to a force above and below the drive (docs/theory/matching.md, eqs. 4-7).

z_{k+1} = a z_k + b u_k is the sense axis in the frame of the drive, u the whole force that the controller gave, its own
share included, so that it makes no difference whether the sense loop is closed.
"""

from cmath import exp, log
from math import pi, sin, sqrt
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from calibration.matching.known import Sensed
from gyro_model.errors import InputError

Complexes = NDArray[np.complex128]

NEAREST: Final = 3
"""Bins between the tone and those that tell the noise: a Hann window's line is 4 bins wide."""
FARTHEST: Final = 14
SIDES: Final = (1, -1)
"""Above and below the drive."""
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
    """The pole from a record with a dither at ``tone`` [Hz], of which it holds whole periods.

    Raises InputError for a record too short to tell the noise beside the tone.
    """
    turns = round(tone * sensed.period * len(sensed.voltage))
    if turns <= FARTHEST:
        raise InputError(f"a block of {turns} periods of the dither: make it more than {FARTHEST}")
    omega = 2 * pi * float(sensed.frequency.mean())
    # The dither leaks to the drive, and the oscillator follows the drive's phase: a wobble at the tone, which a strong
    # drive line would carry to both sides. A frame of constant frequency has none.
    step = (2 * pi * sensed.frequency - omega) * sensed.period
    frame = np.exp(1j * (np.cumsum(step) - step))
    voltage, force = (_spectrum(values * frame) for values in (sensed.voltage, sensed.force))
    bin_ = 2 * pi / (sensed.period * len(sensed.voltage))

    def given(place: int) -> complex:
        # A force held over T is less by sinc(ωT/2), which falls from one side to the other.
        half = (omega + place * bin_) * sensed.hold / 2
        return complex(force[place]) * (sin(half) / half if half else 1.0)

    answers = [complex(voltage[side * turns]) / given(side * turns) for side in SIDES]
    pole = complex(-1.0)
    for _ in range(ITERATIONS):
        pole = _balanced(answers[0] / answers[1], pole, turns * bin_, sensed.period, omega)
    noise = []
    for side, answer in zip(SIDES, answers, strict=True):
        level = answer / _shape(pole, side * turns * bin_, sensed.period, omega)
        for place in (*range(-FARTHEST, 1 - NEAREST), *range(NEAREST, FARTHEST + 1)):
            expected = level * _shape(pole, (side * turns + place) * bin_, sensed.period, omega)
            left = voltage[side * turns + place] - expected * given(side * turns + place)
            noise.append(abs(left / voltage[side * turns]) ** 2)
    # |dp| = |iν - p|/2 |dρ/ρ|, half of it in the imaginary part; ρ has the noise of both sides.
    return Pole(pole, 0.5 * abs(1j * turns * bin_ - pole) * sqrt(float(np.mean(noise))))


def _spectrum(values: Complexes) -> Complexes:
    """Complex amplitudes by bin under a Hann window; a negative frequency has a negative place."""
    window = np.hanning(len(values) + 1)[:-1]
    spectrum: Complexes = np.fft.fft(window * values) / window.sum()
    return spectrum


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
