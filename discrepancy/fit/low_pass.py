"""Butterworth filters between a converter and the device, of order 1, 2 or 4 (S. Butterworth, Experimental Wireless 7,
1930)."""

from collections.abc import Sequence
from functools import lru_cache
from math import factorial
from typing import Final

import numpy as np
from scipy.linalg import expm
from scipy.signal import butter, cont2discrete, lfilter, lfilter_zi, ss2tf, tf2ss

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
    mean = _filtered(*_held(turns, number), u)
    return _curved(mean) if turns < 1 else mean


def sampled(v: Floats, turns: float, number: int) -> Floats:
    """What comes out at each step of a smooth ``v`` (n, axes); turns: time constants a step."""
    if turns > QUICK:
        return _along(v, [c / turns**k for k, c in enumerate(_series(number))], 0.0)
    between = np.empty((FINE * (len(v) - 1) + 1, v.shape[1]))
    for part in range(FINE):
        own = between[part::FINE]
        own[:] = _along(v, [1.0], part / FINE)[: len(own)]
    return _filtered(*_straight(turns / FINE, number), _curved(between))[::FINE]


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


def _filtered(b: Floats, a: Floats, signal: Floats) -> Floats:
    start = lfilter_zi(b, a)
    return np.column_stack([lfilter(b, a, column, zi=start * column[0])[0] for column in signal.T])


@lru_cache
def _series(number: int) -> tuple[float, ...]:
    """What a slow signal and its derivatives, in time constants, add to what comes out."""
    above = butter(number, 1.0, analog=True)[1][::-1]
    made = [1.0]
    for k in range(1, DERIVATIVES):
        made.append(-sum(float(above[i]) * made[k - i] for i in range(1, min(k, number) + 1)))
    return tuple(made)


@lru_cache(64)
def _held(turns: float, number: int) -> tuple[Floats, Floats]:
    own, into, out, _ = tf2ss(*butter(number, 1.0, analog=True))
    # States, the integral of what comes out, and u, in time constants.
    rate = np.zeros((number + 2, number + 2))
    rate[:number, :number], rate[:number, -1:], rate[number, :number] = own, into, out
    moved = expm(rate * turns)
    mean, direct = moved[number : number + 1, :number] / turns, moved[number : number + 1, -1:] / turns
    b, a = ss2tf(moved[:number, :number], moved[:number, -1:], mean, direct)
    return b.ravel(), a


@lru_cache(64)
def _straight(turns: float, number: int) -> tuple[Floats, Floats]:
    own, into, out, direct = tf2ss(*butter(number, 1.0, analog=True))
    b, a = ss2tf(*cont2discrete((own, into, out, direct), turns, "foh")[:4])
    return b.ravel(), a
