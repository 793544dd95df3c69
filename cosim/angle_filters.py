"""The two filters of the angle units: band-pass (TW 201137310, fig. 6) and low-pass (fig. 9).

Both bands are printed for a device at 3 kHz and scale with the oscillation frequency.

The patent claims an angle without lag, yet a causal filter delays: a Butterworth band-pass of
this band and order by 0.83 ms, which turns the sign changes of a +-5 rad/s rate into steps of
0.48 deg; the low-pass by 2.1 ms. For a steady rate only the group delay at the oscillation
frequency matters, and that one number can be made zero at the price of 3 dB more gain near the
edges of the pass band. The low-pass prototype is

    H(s) = (1 + 4 s) / (1 + s)^4 = 1 - 6 s^2 + 20 s^3 - ...

so that a steady rate is followed without lag, an edge of the rate passes as a short transient, and
a swing of 20 Hz is read 1.7 % too large and 23 us late by A, 9.4 % and 0.32 ms by B (Butterworth:
0.83 and 2.1 ms late, an error of 10 % and 26 % of the swing).

The change to a band-pass and the bilinear map keep the delay at the centre zero, provided that
the centre is the oscillation frequency itself: the band 2.5 to 3.5 kHz keeps its width and moves
to 2.541 to 3.541 kHz, whose geometric mean is 3 kHz. Shape "butterworth" is the textbook filter.
"""

from typing import Final, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from gyro_model.errors import InputError

Shape = Literal["lag_free", "butterworth"]
Floats = NDArray[np.float64]

ORDER: Final = 4
"""Poles of the prototype: the beat of tones and pattern (2.5 kHz) leaves 0.005 deg rms in A and
0.011 deg in B; with three poles it would be 0.054 and 0.092 deg."""
PRINTED_FREQUENCY_HZ: Final = 3000.0
BAND_PASS_WIDTH_HZ: Final = 1000.0
LOW_PASS_EDGE_HZ: Final = 200.0


class Filter(NamedTuple):
    """A causal digital filter.

    sos: second-order sections, shape (n, 6); band_hz: half-power edges (low edge 0: low-pass);
    centre_hz: the frequency that carries the angle; group_delay: there [s].
    """

    name: str
    shape: Shape
    sos: Floats
    band_hz: tuple[float, float]
    centre_hz: float
    sample_rate: float
    group_delay: float

    def response(self, frequency_hz: Floats) -> tuple[Floats, Floats]:
        """Return magnitude [dB] and unwrapped phase [deg] at `frequency_hz`, shape (n,), rising.

        The phase is within half a turn of zero at the centre.
        """
        _, response = signal.sosfreqz(self.sos, worN=frequency_hz, fs=self.sample_rate)
        # The floor keeps the logarithm finite on the zeros of the filter.
        magnitude = 20 * np.log10(np.maximum(np.abs(response), 1e-12))
        phase = np.unwrap(np.angle(response))
        turns = np.round(np.interp(self.centre_hz, frequency_hz, phase) / (2 * np.pi))
        return magnitude, np.rad2deg(phase - 2 * np.pi * turns)

    def swing(self, frequency_hz: float) -> complex:
        """Return what the filter does to a small swing of the angle: gain and phase as a complex.

        A swing of the pattern puts side bands at +-`frequency_hz` about the centre; the ratio of
        the angle out to the angle in is the mean of what the two receive.
        """
        sides = self.centre_hz + frequency_hz * np.array([-1.0, 0.0, 1.0])
        _, h = signal.sosfreqz(self.sos, worN=sides, fs=self.sample_rate)
        return complex((h[2] / h[1] + np.conj(h[0] / h[1])) / 2)

    def swing_lag(self, frequency_hz: float = 20.0) -> float:
        """Return by how much [s] a small swing of the angle comes out late."""
        return float(-np.angle(self.swing(frequency_hz)) / (2 * np.pi * frequency_hz))


def band_pass(sample_rate: float, frequency_hz: float, shape: Shape = "lag_free") -> Filter:
    """Band-pass of unit A for an oscillation at `frequency_hz` (TW 201137310, eq. 8, fig. 6).

    Raises InputError where the band does not fit below half of `sample_rate` [Hz].
    """
    width = BAND_PASS_WIDTH_HZ * frequency_hz / PRINTED_FREQUENCY_HZ
    low = np.hypot(frequency_hz, width / 2) - width / 2
    return _design("band-pass", shape, sample_rate, (low, low + width), frequency_hz)


def low_pass(sample_rate: float, frequency_hz: float, shape: Shape = "lag_free") -> Filter:
    """Low-pass of unit B for an oscillation at `frequency_hz` (TW 201137310, eq. 11, fig. 9).

    Raises InputError where the band does not fit below half of `sample_rate` [Hz].
    """
    edge = LOW_PASS_EDGE_HZ * frequency_hz / PRINTED_FREQUENCY_HZ
    return _design("low-pass", shape, sample_rate, (0.0, edge), 0.0)


def _design(name: str, shape: Shape, sample_rate: float, band_hz: tuple[float, float], centre_hz: float) -> Filter:
    if not 0 < band_hz[1] < sample_rate / 2:
        raise InputError(
            f"sample rate {sample_rate:g} Hz is too low for the {name} of the angle unit: "
            f"it must be above {2 * band_hz[1]:g} Hz"
        )
    prototype = _lag_free_prototype() if shape == "lag_free" else signal.buttap(ORDER)
    # The bilinear map compresses the frequency axis; edges and centre are placed beforehand so
    # that they land where they are asked (the low edge follows from centre and high edge).
    centre, edge = 2 * sample_rate * np.tan(np.pi * np.array([centre_hz, band_hz[1]]) / sample_rate)
    if centre_hz > 0:
        width = edge - centre**2 / edge
        zpk = signal.lp2bp_zpk(*prototype, wo=centre, bw=width)
    else:
        zpk = signal.lp2lp_zpk(*prototype, wo=edge)
    sos = signal.zpk2sos(*signal.bilinear_zpk(*zpk, fs=sample_rate))
    delay = _group_delay(sos, centre_hz, sample_rate)
    return Filter(name, shape, sos, band_hz, centre_hz, sample_rate, delay)


def _lag_free_prototype() -> tuple[Floats, Floats, float]:
    """Zeros, poles and gain of (1 + 4 s)/(1 + s)^4, scaled to half power at 1 rad/s."""
    # |H|^2 = 1/2 is (1 + u)^4 = 2 (1 + 16 u) with u the squared frequency.
    squared = np.polynomial.Polynomial([1, 1]) ** ORDER - 2 * np.polynomial.Polynomial([1, ORDER**2])
    roots = squared.roots()
    edge = np.sqrt(roots[np.isreal(roots)].real.max())
    pole = -1 / edge
    return np.array([pole / ORDER]), np.full(ORDER, pole), float(-ORDER * pole ** (ORDER - 1))


def _group_delay(sos: Floats, frequency_hz: float, sample_rate: float) -> float:
    """Group delay [s] at one frequency: the sum over the polynomials of the sections."""
    powers = np.exp(-2j * np.pi * frequency_hz / sample_rate * np.arange(3))

    def delay(coefficients: Floats) -> float:
        terms = coefficients * powers
        return float(np.real(np.dot(np.arange(3), terms) / np.sum(terms)))

    return sum(delay(section[:3]) - delay(section[3:]) for section in sos) / sample_rate
