"""Fourier series on the instants of a period."""

from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]


class Harmonics(NamedTuple):
    """Series a_0 + Σ a_k cos kθ + b_k sin kθ, coefficients in that order, on instants θ: values = ``series`` @
    coefficients, coefficients = ``parts`` @ values; ``slope`` @ coefficients are those of d/dθ. ``first`` @ values is
    the complex first harmonic."""

    theta: Floats
    series: Floats
    parts: Floats
    slope: Floats
    first: Complexes


@cache
def harmonics(count: int, instants: int) -> Harmonics:
    """``count`` harmonics on so many instants."""
    theta = 2 * np.pi * np.arange(instants) / instants
    angle = theta[:, None] * np.arange(1, count + 1)
    series = np.ones((instants, 2 * count + 1))
    series[:, 1::2], series[:, 2::2] = np.cos(angle), np.sin(angle)
    parts = 2 / instants * series.T
    parts[0] = 1 / instants
    slope = np.zeros((2 * count + 1, 2 * count + 1))
    for k in range(1, count + 1):
        slope[2 * k - 1, 2 * k], slope[2 * k, 2 * k - 1] = k, -k
    return Harmonics(theta, series, parts, slope, 2 / instants * np.exp(-1j * theta))
