"""The course of a dry friction: the sign of the speed where the sensors are."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from scipy.ndimage import uniform_filter1d
from scipy.signal import butter, sosfiltfilt, welch

from discrepancy.data.modal import TINY
from discrepancy.data.record import Floats, Record

AT_REST: Final = 0.02
"""Of the highest speed, over which its sign changes: below, a smoothed speed is as well at rest."""
WINDOWS: Final = 8
"""Of a run, for its spectrum."""
TOP: Final = 0.25
"""Of the sample rate, from which a voltage is noise."""
BINS: Final = 5
"""Of a spectrum, over which what is no noise is smoothed."""
SLOWEST: Final = 8.0
"""Periods of a run below which what is integrated is no motion."""


def rubbed(records: Sequence[Record]) -> list[Record]:
    """The records with the course of a friction of 1 N at the sensors."""
    return [replace(record, courses={**record.courses, "friction": -sign(speed_of(record))}) for record in records]


def sign(speed: Floats) -> Floats:
    """That of a speed (n,) or (n, axes), which fades at rest."""
    return np.asarray(np.tanh(speed / np.maximum(AT_REST * np.abs(speed).max(axis=0), 1e-300)))


def speed_of(record: Record) -> Floats:
    """The speed (n, axes), as what is measured by the sample and as far as noise lets see it."""
    if record.order == 0:
        speed = np.gradient(record.v, axis=0)
    elif record.order == 1:
        speed = record.v
    else:
        slow = butter(2, 2 * SLOWEST / len(record.v), "highpass", output="sos")
        speed = sosfiltfilt(slow, integral(record), axis=0)
    return np.column_stack([_quiet(own, v) for own, v in zip(speed.T, record.v.T, strict=True)])


def integral(record: Record) -> Floats:
    """Of what is measured (n, axes), by the sample."""
    v = record.v - record.v.mean(axis=0)
    if record.hold != "zero" or record.order != 2:
        return summed(v)
    # A held force jumps after a sample, and the acceleration with it: what it makes at once is a sum.
    jumps = np.diff(record.u, axis=0)[:-1]
    at_once = np.linalg.lstsq(jumps, np.diff(v, axis=0)[1:], rcond=None)[0]
    before = np.vstack((record.u[:1], record.u[:-1]))
    held = (record.u @ at_once)[:-1]
    return summed(v - before @ at_once) + np.concatenate((np.zeros((1, v.shape[1])), np.cumsum(held, axis=0)))


def summed(v: Floats) -> Floats:
    """Of v (n, axes) the integral by the sample, by the cubic through four neighbours: a sum has it half a sample late,
    which turns the sign of one in twenty at the end of a band, and means of neighbours have it 3 % too small at ten
    samples a period."""
    steps = 0.5 * (v[:-1] + v[1:])
    if len(v) > 3:
        steps[1:-1] -= (v[3:] - v[2:-1] - v[1:-2] + v[:-3]) / 24
    return np.concatenate((np.zeros((1, v.shape[1])), np.cumsum(steps, axis=0)))


def _quiet(speed: Floats, v: Floats) -> Floats:
    """A speed (n,) without what the white noise of the voltage (n,) makes of it (N. Wiener, Extrapolation,
    Interpolation, and Smoothing of Stationary Time Series, 1949, chapter III)."""
    # With its mean: without, the slowest speeds pass for noise, and a shaft that turns one way for one at rest.
    f, power = welch(v, nperseg=len(v) // WINDOWS, detrend=False)
    noise = float(np.median(power[f > TOP]))
    share = uniform_filter1d(1 - noise / np.maximum(power, max(noise, TINY)), BINS)
    both = np.concatenate((speed, speed[::-1]))
    spectrum = np.fft.rfft(both) * np.interp(np.fft.rfftfreq(len(both)), f, share)
    return np.asarray(np.fft.irfft(spectrum, len(both))[: len(speed)])
