"""A low-order filter for a measured transfer function: two sections of second order with a zero each.

H(s) = Π (1 + l_k s)/(1 + 2 d_k s/w_k + s²/w_k²)
"""

from itertools import product
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares, minimize_scalar

from gyro_model.sensor import SensorModel

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

STARTS: Final = (0.8, 1.6)
"""Natural frequencies to begin with, over the one at which the gain falls most steeply."""
DAMPED: Final = (0.1, 0.7)
"""Damping ratios to begin with."""
SHARP: Final = (0.5, 0.05)
"""And of a resonance at the largest gain, times that over the gain at rest: as high as it, and ten times as high."""
LEAST_DAMPED: Final = SensorModel().parameter("filter_damping_1").low
"""Of the damping ratios."""
AT_REST: Final = 0.05
"""Logarithm of the gain at rest over that of the slowest line, at most."""
LARGEST: Final = 50.0
"""Of the frequencies over that one, and of the zero's time constant times it."""


class Section(NamedTuple):
    """frequency w/2π [Hz], damping d, lead l [s]."""

    frequency: float
    damping: float
    lead: float


def transfer_of(sections: "tuple[Section, ...]", frequency: Floats) -> Complexes:
    """H at ``frequency`` [Hz], shape (n,)."""
    s = np.complex128(2j * np.pi) * frequency
    gain = np.ones(len(s), complex)
    for one in sections:
        x = s / (2 * np.pi * one.frequency)
        gain = gain * (1 + one.lead * s) / (1 + 2 * one.damping * x + x**2)
    return gain


def fit_sections(frequency: Floats, gain: Complexes) -> tuple[tuple[Section, ...], float]:
    """The two sections whose transfer function is nearest to ``gain`` over that at rest, at ``frequency`` [Hz], shapes
    (n,), and their largest difference, over the gain where that exceeds the one at rest. The least of several begins.

    The gain at rest is fitted with them: the slowest line has its noise and some of the filter.
    """
    slowest = float(np.abs(gain[0]))
    size = np.abs(gain) / slowest
    # A resonance of a hundred at its top is to be right by the same share as the gain at rest.
    weight = 1 / np.maximum(size, 1.0)
    # Where half of the gain is gone for good: beyond the peak.
    middle = float(frequency[np.flatnonzero(size >= 0.5)[-1]])

    def sections(x: Floats) -> tuple[Section, ...]:
        parts = x[:-1].reshape(2, 3)
        return tuple(Section(middle * float(np.exp(w)), float(np.exp(d)), float(lead) / middle) for w, d, lead in parts)

    def off(x: Floats) -> Complexes:
        difference: Complexes = weight * (transfer_of(sections(x), frequency) - gain * np.exp(x[-1]) / slowest)
        return difference

    edge = np.log(LARGEST)
    top = int(np.argmax(size))
    # A resonance between two lines is higher than they show.
    sharp = [(float(frequency[top]) / middle, share / float(size[top])) for share in SHARP]
    places = [*product(STARTS, DAMPED), *sharp]
    begins = [
        np.array([np.log(w1), np.log(d1), 0.0, np.log(w2), np.log(0.7), 0.0, 0.0])
        for (w1, d1), w2 in product(places, STARTS)
    ]
    upper = np.array([edge, edge, LARGEST, edge, edge, LARGEST, AT_REST])
    lower = np.where(np.arange(7) % 3 == 1, np.log(LEAST_DAMPED), -upper)
    fits = [
        least_squares(lambda x: _parts(off(x)), np.clip(begin, lower, upper), bounds=(lower, upper)) for begin in begins
    ]
    best = min(fits, key=lambda fit: float(fit.cost)).x
    # The one that resonates first: noise passes it in a way of its own.
    return tuple(sorted(sections(best), key=lambda one: one.damping)), float(np.abs(off(best)).max())


def _parts(values: Complexes) -> Floats:
    return np.concatenate([values.real, values.imag])


def fit_noise_lead(sections: tuple[Section, ...], frequency: Floats, density: Floats, row: float) -> float:
    """The time constant [s] of the zero in place of the first section's by which noise has the spectral ``density`` at
    ``frequency`` [Hz], shapes (n,), of means over rows of ``row`` [s], in any unit: its shape alone counts."""
    boxcar = np.sinc(frequency * row) ** 2

    def off(lead: float) -> float:
        own = (sections[0]._replace(lead=lead), *sections[1:])
        ratio = np.log(np.abs(transfer_of(own, frequency)) ** 2 * boxcar / density)
        return float(np.var(ratio))

    longest = 10 / (2 * np.pi * sections[0].frequency)
    return float(minimize_scalar(off, bounds=(0.0, longest), method="bounded").x)
