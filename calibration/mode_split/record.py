"""A record of one voltage, and its slow complex envelope around the drive line."""

from dataclasses import dataclass
from math import isfinite
from typing import Final

import numpy as np
from numpy.typing import NDArray

from cosim.decimation import FLAT, Decimator
from gyro_model.errors import InputError

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

BLOCK: Final = 1 << 18
"""Samples mixed at a time: what is in memory beside the record stays below 20 MB."""
LINE_OVER_MEDIAN: Final = 30.0
"""A bin this many times the median around it is a line: noise alone gives one in 2**30 bins."""
LONGEST_SEARCHED: Final = 1 << 22
"""Samples in which the drive line is looked for."""


@dataclass(frozen=True)
class VoltageRecord:
    """Samples of one voltage at ``rate`` [Hz]: real (n,) [V], or complex (n,) around ``carrier`` [Hz].

    Complex samples z mean v(t) = Re z exp(i 2 π carrier t). Raises InputError where the samples make no record.
    """

    values: Floats | Complexes
    rate: float
    carrier: float = 0.0

    def __post_init__(self) -> None:
        if not (isfinite(self.rate) and self.rate > 0):
            raise InputError(f"sample rate {self.rate:g} Hz: give a positive number")
        if self.is_complex and not self.carrier > 0:
            raise InputError("two columns are I and Q around a carrier: give its frequency by --carrier")
        if len(self.values) < 256:
            raise InputError(f"{len(self.values)} samples: a spectrum needs at least 256")
        finite = np.isfinite(self.values)
        if not finite.all():
            raise InputError(f"the voltage is no finite number in data row {int(np.argmin(finite)) + 1}: mend the row")
        if np.ptp(np.abs(self.values)) == 0 and np.ptp(self.values.real) == 0:
            raise InputError("the voltage never changes: the record holds no signal; name another column by --column")

    @property
    def is_complex(self) -> bool:
        """Whether the samples are an envelope around the carrier."""
        return bool(np.iscomplexobj(self.values))

    @property
    def duration(self) -> float:
        """Length [s]."""
        return len(self.values) / self.rate


@dataclass(frozen=True)
class Envelope:
    """Complex samples z (n,) at ``rate`` [Hz]: v(t) = Re z exp(i 2 π centre t), true within centre ± ``band`` [Hz]."""

    values: Complexes
    rate: float
    centre: float
    band: float

    @property
    def duration(self) -> float:
        """Length [s]."""
        return len(self.values) / self.rate

    def part(self, start: float, stop: float) -> "Envelope":
        """The envelope from ``start`` to ``stop`` [s]."""
        return Envelope(
            self.values[round(start * self.rate) : round(stop * self.rate)], self.rate, self.centre, self.band
        )


def envelope(record: VoltageRecord, centre: float, span: float) -> Envelope:
    """The envelope of ``record`` around ``centre`` [Hz], true within ±``span`` [Hz] or as far as the record is.

    Mixed down and decimated by a whole number through a linear-phase low-pass (Kaiser window).
    """
    shift = centre - record.carrier
    edge = record.rate / 2
    if not (0 < shift < edge if not record.is_complex else abs(shift) < edge):
        low, high = (record.carrier - edge, record.carrier + edge) if record.is_complex else (0.0, edge)
        raise InputError(f"frequency {centre:g} Hz: the record reaches from {low:g} to {high:g} Hz")
    # An envelope given comes through a decimation filter of its own; a real voltage ends at zero frequency.
    reach = 2 * FLAT * edge - abs(shift) if record.is_complex else 0.95 * min(edge - shift, shift)
    if reach <= 0:
        raise InputError(f"frequency {centre:g} Hz: too near the edge of the record's band, {record.rate:g} Hz wide")
    band = min(span, reach)
    factor = max(int(FLAT * record.rate / band), 1)
    if factor == 1:
        return Envelope(_mixed(record, shift, 0, len(record.values)), record.rate, centre, band)
    decimator = Decimator(factor)
    if len(record.values) < 4 * decimator.taps:
        raise InputError(
            f"{len(record.values)} samples: a band of ±{band:.4g} Hz needs at least {4 * decimator.taps}, "
            f"{4 * decimator.taps / record.rate:.3g} s"
        )
    parts = [
        decimator.feed(_mixed(record, shift, first, first + BLOCK)) for first in range(0, len(record.values), BLOCK)
    ]
    return Envelope(np.concatenate(parts), record.rate / factor, centre, band)


def find_line(record: VoltageRecord) -> float:
    """Frequency [Hz] of the strongest line, by the peak of a Hann-windowed spectrum.

    Raises InputError where no bin stands out of the noise around it.
    """
    values = record.values[:LONGEST_SEARCHED]
    n = len(values)
    spectrum = np.fft.fft(values * np.hanning(n)) if record.is_complex else np.fft.rfft(values * np.hanning(n))
    power = np.abs(spectrum) ** 2
    if not record.is_complex:
        # Offset and drift of the amplifier: the lowest 0.5 % of the band.
        power[: max(len(power) // 200, 8)] = 0.0
    best = int(np.argmax(power))
    around = power[np.r_[best - 24 : best - 4, best + 5 : best + 25] % len(power)]
    if not power[best] > LINE_OVER_MEDIAN * np.median(around):
        raise InputError("no drive line stands out of the noise: give the drive frequency by --drive-frequency")
    left, peak, right = np.log(power[[best - 1, best, (best + 1) % len(power)]] + np.finfo(float).tiny)
    place = (best + 0.5 * (left - right) / (left - 2 * peak + right)) / n
    return float(record.carrier + record.rate * (place - (place > 0.5)))


def _mixed(record: VoltageRecord, shift: float, first: int, last: int) -> Complexes:
    """Samples first .. last - 1 around the shifted frequency, as an envelope: a real record counts twice."""
    inside = record.values[first:last]
    turns = shift / record.rate * np.arange(first, first + len(inside))
    mixed: Complexes = (1 if record.is_complex else 2) * inside * np.exp(-2j * np.pi * (turns % 1))
    return mixed
