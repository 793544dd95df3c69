"""A low-order filter for a measured transfer function: two sections of second order with a zero each.

H(s) = Π (1 + l_k s)/(1 + 2 d_k s/w_k + s²/w_k²)
"""

from itertools import product
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares, minimize_scalar

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

STARTS: Final = (0.8, 1.6)
"""Natural frequencies to begin with, over the one at which the gain falls most steeply."""
DAMPED: Final = (0.1, 0.7)
"""Damping ratios to begin with."""
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
    """The two sections whose transfer function is nearest to ``gain`` at ``frequency`` [Hz], shapes (n,), and the
    largest difference, over the gain at the lowest frequency. The least of several begins."""
    own = gain / np.abs(gain[0])
    # Where half of the gain is gone for good: beyond the peak.
    above = np.flatnonzero(np.abs(own) >= 0.5)
    middle = float(frequency[above[-1]])

    def sections(x: Floats) -> tuple[Section, ...]:
        parts = x.reshape(2, 3)
        return tuple(Section(middle * float(np.exp(w)), float(np.exp(d)), float(lead) / middle) for w, d, lead in parts)

    def residual(x: Floats) -> Floats:
        off = transfer_of(sections(x), frequency) - own
        return np.concatenate([off.real, off.imag])

    edge = np.log(LARGEST)
    bounds = np.tile([edge, edge, LARGEST], 2)
    begins = [
        np.array([np.log(w1), np.log(d1), 0.0, np.log(w2), np.log(0.7), 0.0])
        for w1, d1, w2 in product(STARTS, DAMPED, STARTS)
    ]
    fits = [least_squares(residual, begin, bounds=(-bounds, bounds)) for begin in begins]
    best = sections(min(fits, key=lambda fit: float(fit.cost)).x)
    # The one that resonates first: noise passes it in a way of its own.
    ordered = tuple(sorted(best, key=lambda one: one.damping))
    return ordered, float(np.abs(transfer_of(ordered, frequency) - own).max())


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
