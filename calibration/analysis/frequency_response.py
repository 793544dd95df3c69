"""Frequency response from the response to sines, and what is read off it."""

from typing import NamedTuple

import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import NDArray
from scipy.optimize import brentq

from gyro_model.errors import InputError

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

HALF_POWER = 0.5**0.5


class Response(NamedTuple):
    """frequency [Hz], gain (complex) and its standard error, shapes (n,)."""

    frequency: Floats
    gain: Complexes
    error: Floats


def frequency_response(given: Floats, output: Floats, interval: float, frequency: Floats, base: float) -> Response:
    """Of whole periods 1/``base`` [s] of a periodic input ``given`` and the settled ``output``, shapes (n,), at
    harmonics ``frequency`` [Hz] of ``base`` [Hz]. The error is by the scatter from period to period.

    Raises InputError where the record holds fewer than two periods.
    """
    rows = round(1 / (base * interval))
    periods = len(given) // rows
    if periods < 2:
        raise InputError(f"{len(given) * interval:.4g} s hold no two periods of {1 / base:.4g} s: give a longer record")
    lines = np.rint(frequency / base).astype(int)
    spectra = [np.fft.rfft(values[: periods * rows].reshape(periods, rows))[:, lines] for values in (given, output)]
    source, answer = spectra[0].mean(axis=0), spectra[1]
    scatter = answer.std(axis=0, ddof=1) / periods**0.5
    return Response(frequency, answer.mean(axis=0) / source, scatter / np.abs(source))


def bandwidth(frequency: Floats, size: Floats) -> float | None:
    """The lowest frequency [Hz] from which on the ``size`` of the gain, over that at the lowest frequency, is below
    -3 dB; a cubic in dB over log f through the four points around it: straight lines between sines 7 % apart would be
    0.1 % off beside a resonance. None where it does not fall so far."""
    level = np.log(size / size[0]) - np.log(HALF_POWER)
    below = np.flatnonzero(level < 0)
    if not len(below):
        return None
    i = int(below[0])
    cubic = _cubic(frequency, level, i)
    return float(frequency[i] * np.exp(brentq(cubic, np.log(frequency[i - 1] / frequency[i]), 0.0)))


def between(frequency: Floats, values: Floats, at: float) -> float:
    """The values at a frequency ``at`` [Hz] between the points, by a cubic over log f through the four around it."""
    i = int(np.clip(np.searchsorted(frequency, at), 1, len(frequency) - 1))
    return float(_cubic(frequency, values, i)(np.log(at / frequency[i])))


def _cubic(frequency: Floats, values: Floats, i: int) -> Polynomial:
    """Through points i - 2 to i + 1, as far as there are, in log(f/frequency[i])."""
    around = slice(max(i - 2, 0), i + 2)
    place = np.log(frequency[around] / frequency[i])
    return Polynomial.fit(place, values[around], len(place) - 1)


def group_delay(response: Response, highest: float) -> tuple[float, float]:
    """-dφ/dω [s] with its standard error, from the phases up to ``highest`` [Hz], by a line through zero weighted by
    their errors: phase = -ω·delay of a filter far below its corner."""
    used = response.frequency <= highest
    if not used.any():
        used = response.frequency == response.frequency.min()
    turn = 2 * np.pi * response.frequency[used]
    gain = response.gain[used]
    phase = np.angle(gain)
    weight = np.abs(gain) / np.maximum(response.error[used], 1e-12 * np.abs(gain))
    norm = float(((turn * weight) ** 2).sum())
    return float(-(turn * phase * weight**2).sum() / norm), norm**-0.5
