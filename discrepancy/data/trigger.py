"""By how many samples a voltage was recorded later than the force, where two instruments were not triggered together.

A spring, a mass and a damper answer at once: the force is k - m w² + i w d times the motion. Where the voltage is moved
in time against it no such numbers come near, and among all moves one stands out.
"""

from typing import Final

import numpy as np
from scipy.signal import csd, welch

from discrepancy.data.record import Floats

WINDOWS: Final = 8
"""Of a run, for its spectra."""
FARTHEST: Final = 0.25
"""Of a window, by which the voltage may be moved: the spectra then still hold three quarters of what goes together."""
LEAST, LOST, DECISIVE = 0.3, 0.5, 3.0
"""Periods of a move, which less are a delay of the device's; share of the force that is left unexplained as it was
recorded, and how many times less that is moved."""
APART: Final = 0.5
"""Periods from the best move, from which any other must leave DECISIVE times as much: to one tone all are alike."""
FEWEST, LINES = 64, 8
"""Samples of a window, and frequencies at which it is driven: three numbers are fitted to them."""
HELD: Final = 0.25
"""Of a sample, by which each move is tried later: a force that is held over a sample acts half of one later, one that
runs on at once, and both then come out at the same move."""


def late_by(u: Floats, v: Floats, order: int) -> int:
    """Samples by which ``v`` (n,) came later than ``u`` (n,), negative: earlier; 0 where the response shows none.
    order: of the derivative of the motion that v is."""
    length = len(u) // WINDOWS
    if length < FEWEST or not (np.isfinite(u).all() and np.isfinite(v).all()) or np.ptp(u) == 0 or np.ptp(v) == 0:
        return 0
    f, power = welch(u, nperseg=length)
    _, crossed = csd(u, v, nperseg=length)
    own = power[1:] > 1e-3 * power[1:].max()
    w, power, crossed = 2 * np.pi * f[1:][own], power[1:][own], crossed[1:][own]
    if len(w) < LINES:
        return 0
    reach = int(FARTHEST * length)
    moves = np.arange(-reach, reach + 1)
    left = np.array([_left(w, power, crossed * np.exp(1j * w * (n + HELD)) / (1j * w) ** order) for n in moves])
    best = int(np.argmin(left))
    period = 2 * np.pi / w[np.argmax(np.abs(crossed) / w**order)]
    others = left[np.abs(moves - moves[best]) > APART * period]
    clear = len(others) and min(left[reach], others.min()) > DECISIVE * left[best]
    return int(moves[best]) if clear and left[reach] > LOST and abs(moves[best]) > LEAST * period else 0


def _left(w: Floats, power: Floats, crossed: Floats) -> float:
    """Share of the force (its spectrum ``power``) that no passive k - m w² + i w d times the motion explains."""
    real = np.stack((crossed, -(w**2) * crossed, 1j * w * crossed), axis=1)
    rows = np.concatenate((real.real, real.imag))
    aim = np.concatenate((power, np.zeros_like(power)))
    size = np.linalg.norm(rows, axis=0)
    numbers = np.linalg.lstsq(rows / size, aim, rcond=None)[0]
    if numbers[2] < 0 or numbers[0] * numbers[1] < 0:
        return 1.0
    return float(np.sum((rows / size @ numbers - aim) ** 2) / np.sum(aim**2))
