"""Butterworth filters between a converter and the device, of order 1, 2 or 4 (S. Butterworth, Experimental Wireless 7,
1930)."""

from collections.abc import Sequence
from functools import lru_cache
from math import factorial
from typing import Final

import numpy as np
from scipy.signal import butter, lfilter

from discrepancy.data.record import Floats
from gyro_model.quantities import Grid, Quantity, shape

SETTLED: Final = 30.0
"""Time constants in a step after which the slowest of these filters has settled to 1e-5 of what it lacks at first."""

FINE, DERIVATIVES, POINTS = 2, 5, 9
"""Points a step through which a voltage is followed; how many of its derivatives, itself the first, say what a filter
makes of it; and points of the curve that gives them: a sine of 24 steps a period is right to 1e-9."""
QUICK: Final = 2.5
"""Time constants in a step from which a series in derivatives of the voltage says what a filter makes of it: at 50
steps a period both ways are right to 1e-5 there."""


def order(of: str, start: float) -> Quantity:
    """The shape that says the order of the filter ``of`` something."""
    text = f"order of the filter of the {of}"
    return shape(f"{of}_filter_order", "1", start, text, low=1, high=4, search=Grid.log(1, 4, "1", 3), integer=True)


def delay(number: int) -> float:
    """Of a slow signal by a filter of that order, in time constants 1/(2π f_c)."""
    return 1 / float(np.sin(np.pi / (2 * number)))


def held(u: Floats, turns: float, number: int) -> Floats:
    """What to hold over each step in place of what comes out where ``u`` (n, axes) is held; turns: time constants a
    step."""
    if turns > SETTLED:
        # What a step of u lacks until the filter has settled.
        return np.asarray(u - np.vstack((np.zeros_like(u[:1]), np.diff(u, axis=0))) * delay(number) / turns)
    mean = _filtered(u, turns, number, held=True)
    return _curved(mean) if turns < 1 else mean


def sampled(v: Floats, turns: float, number: int) -> Floats:
    """What comes out at each step of a smooth ``v`` (n, axes); turns: time constants a step."""
    if turns > QUICK:
        return _along(v, [c / turns**k for k, c in enumerate(_series(number))], 0.0)
    between = np.empty((FINE * (len(v) - 1) + 1, v.shape[1]))
    for part in range(FINE):
        own = between[part::FINE]
        own[:] = _along(v, [1.0], part / FINE)[: len(own)]
    return _filtered(_curved(between), turns / FINE, number, held=False)[::FINE]


def _along(v: Floats, factors: Sequence[float], ahead: float) -> Floats:
    """The sum of the derivatives of v (n, axes) by the step, itself the first, each times its factor, so much of a step
    ahead of each point."""
    width = min(POINTS, len(v))
    middle = width // 2
    kernel = np.array([_weights(width, i + ahead, len(factors)) @ factors for i in range(width)])
    found = np.column_stack([np.convolve(column, kernel[middle][::-1], "same") for column in v.T])
    # At the ends the curve through the last points goes on.
    found[:middle] = kernel[:middle] @ v[:width]
    found[len(v) - middle :] = kernel[width - middle :] @ v[len(v) - width :]
    return found


@lru_cache(256)
def _weights(width: int, place: float, derivatives: int) -> Floats:
    """Of so many points the weights (width, derivatives) that give those of the polynomial through them."""
    powers = np.vander(np.arange(width) - place, width, increasing=True).T
    return np.linalg.solve(powers, np.diag([float(factorial(k)) for k in range(width)]))[:, :derivatives]


def _curved(signal: Floats) -> Floats:
    """``signal`` (n, axes) with 1/12 of its second difference more of what curves: so much is lost by straight lines
    from point to point, and by means that are held."""
    more = signal.copy()
    more[1:-1] -= np.diff(signal, 2, axis=0) / 12
    return more


def _filtered(signal: Floats, turns: float, number: int, *, held: bool) -> Floats:
    """What comes out at each step of straight lines from one point of ``signal`` (n, axes) to the next, or the mean
    over it of what comes out where it is held; at rest before. By partial fractions: a recursion of all poles at once
    rounds by 1e-16 over turns to the number of poles."""
    found = np.zeros_like(signal)
    for pole, share in _fractions(number):
        z = pole * turns
        passed, first = np.exp(z), np.expm1(z) / z
        # What the point at the end of a step adds, and that at its start; or the force of the step, and that before.
        second = (first - 1) / z
        b = turns * np.array([second, first**2 - passed * second if held else first - second])
        for own, column in zip(found.T, signal.T, strict=True):
            start = (-1 / pole - b[0]) * column[:1]
            own += (share * lfilter(b, [1, -passed], column, zi=start)[0]).real
    return found


@lru_cache
def _series(number: int) -> tuple[float, ...]:
    """What a slow signal and its derivatives, in time constants, add to what comes out."""
    above = butter(number, 1.0, analog=True)[1][::-1]
    made = [1.0]
    for k in range(1, DERIVATIVES):
        made.append(-sum(float(above[i]) * made[k - i] for i in range(1, min(k, number) + 1)))
    return tuple(made)


@lru_cache
def _fractions(number: int) -> list[tuple[complex, complex]]:
    """Poles in time constants, of two that are conjugate one, and their residues; the real part of all is the whole."""
    _, poles, gain = butter(number, 1.0, analog=True, output="zpk")
    shares = [gain / np.prod([pole - other for other in poles if other != pole]) for pole in poles]
    return [(p, s * (2 if p.imag > 0 else 1)) for p, s in zip(poles, shares, strict=True) if p.imag >= 0]
