"""The holds of a sampled run: over each, an input has one value, the mean of its course."""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

ROUNDING: Final = 1e-12
"""Instants that differ by less than this, relative, are one: k * period rounds to 2e-16, a sum of decimals to several
times that. At 1000 s it is 1e-9 s, a five-thousandth of a hold."""


class Spans(NamedTuple):
    """Adjoining spans of time of one length.

    borders [s], shape (n + 1,), rising; middle [s], shape (n,); length [s].
    """

    borders: Floats
    middle: Floats
    length: float

    @classmethod
    def of_samples(cls, first: int, count: int, period: float) -> "Spans":
        """The holds of the samples first .. first + count - 1 at ``period`` [s]."""
        # From the count, not by addition: rounding would add up.
        borders: Floats = np.arange(first, first + count + 1) * np.float64(period)
        middle: Floats = (np.arange(first, first + count) + 0.5) * np.float64(period)
        return cls(borders, middle, period)

    @classmethod
    def single(cls, begin: float, end: float) -> "Spans":
        """One span [s]."""
        return cls(np.array([begin, end]), np.array([0.5 * (begin + end)]), end - begin)

    def part(self, low: int, high: int) -> "Spans":
        """The spans low .. high - 1."""
        return Spans(self.borders[low : high + 1], self.middle[low:high], self.length)

    def moved(self, by: float) -> "Spans":
        """All of them later by ``by`` [s]."""
        return Spans(self.borders + by, self.middle + by, self.length)


def snapped(t: Floats, edges: Floats) -> Floats:
    """``t`` [s] with every instant that is an edge but for rounding moved onto it. edges: shape (m,), rising."""
    if not len(edges):
        return t
    above = np.clip(np.searchsorted(edges, t), 0, len(edges) - 1)
    below = np.maximum(above - 1, 0)
    near = np.where(np.abs(edges[above] - t) < np.abs(edges[below] - t), edges[above], edges[below])
    return np.where(np.abs(near - t) <= ROUNDING * np.abs(near), near, t)
