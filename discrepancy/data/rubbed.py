"""Dry friction beside modes: its course as a further force, in which the motion is linear.

The sign of the speed where the sensors are is known from what they measured, so that a friction is an input of unknown
size of a linear structure (S. Marchesiello, L. Garibaldi, A time domain approach for identifying nonlinear vibrating
structures by subspace methods, Mechanical Systems and Signal Processing 22, 2008).
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from scipy.signal import butter, sosfiltfilt

from discrepancy.data.record import Floats, Record

AT_REST: Final = 0.02
"""Of the highest speed, over which its sign changes: below, a smoothed speed is as well at rest."""
SLOWEST: Final = 8.0
"""Periods of a run below which what is integrated is no motion."""


def rubbed(records: Sequence[Record]) -> list[Record]:
    """The records with the course of a friction at the sensors."""
    return [replace(record, rubs=-sign(_speed(record))) for record in records]


def sign(speed: Floats) -> Floats:
    """That of a speed (n,) or (n, axes), which fades at rest."""
    return np.asarray(np.tanh(speed / np.maximum(AT_REST * np.abs(speed).max(axis=0), 1e-300)))


def _speed(record: Record) -> Floats:
    """The speed (n, axes), without unit."""
    if record.order == 1:
        return record.v
    if record.order == 0:
        return np.asarray(np.gradient(record.v, axis=0))
    slow = butter(2, 2 * SLOWEST / len(record.v), "highpass", output="sos")
    return np.asarray(sosfiltfilt(slow, np.cumsum(record.v - record.v.mean(axis=0), axis=0), axis=0))
