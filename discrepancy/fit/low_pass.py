"""Butterworth filters between a converter and the device, of order 1, 2 or 4 (S. Butterworth, Experimental Wireless 7,
1930)."""

from functools import lru_cache
from typing import Final

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.linalg import expm
from scipy.signal import butter, cont2discrete, lfilter, lfilter_zi, ss2tf, tf2ss

from discrepancy.data.record import Floats
from gyro_model.quantities import Grid, Quantity, shape

SETTLED: Final = 30.0
"""Time constants in a step after which the slowest of these filters has settled to 1e-5 of what it lacks at first."""

FINE: Final = 4
"""Points a sample period through which a voltage is followed: at 60 samples a period it is right to 1e-7."""


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
    """What comes out at each sample of a smooth ``v`` (n, axes)."""
    if turns > SETTLED:
        return np.asarray(v - delay(number) / turns * np.gradient(v, axis=0))
    k = np.arange(FINE * (len(v) - 1) + 1) / FINE
    between = CubicSpline(np.arange(len(v)), v)(k)
    return _filtered(*_straight(turns / FINE, number), _curved(between))[::FINE]


def _curved(signal: Floats) -> Floats:
    """``signal`` (n, axes) with 1/12 of its second difference more of what curves: so much is lost by straight lines
    from point to point, and by means that are held."""
    more = signal.copy()
    more[1:-1] -= np.diff(signal, 2, axis=0) / 12
    return more


def _filtered(b: Floats, a: Floats, signal: Floats) -> Floats:
    start = lfilter_zi(b, a)
    return np.column_stack([lfilter(b, a, column, zi=start * column[0])[0] for column in signal.T])


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
