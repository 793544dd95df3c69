"""The measured spectrum around the drive line: line taken out, other lines masked, bins in groups.

The line is removed as a slow complex amplitude (a polynomial of degree 4 over the record), so that its leakage, which
falls only with the square of the distance, does not bury a hump 100 dB below it; the bins that this touches are masked.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray
from scipy.ndimage import median_filter
from scipy.signal.windows import tukey

from calibration.mode_split.record import LINE_OVER_MEDIAN, Envelope, Floats
from gyro_model.errors import InputError

DEGREE: Final = 4
LINE_BINS: Final = 4.0
"""Bins masked either side of the line: a polynomial of degree 4 takes noise out of about 2.5."""
TAPER: Final = 0.1
"""Share of the record under the cosine flanks of the window. It keeps strong lines from leaking."""
LEFT: Final = 0.01
"""Share of a moving line's power that may be left when it is taken out: the skirt of the model takes up less."""
NEIGHBOURS: Final = 8
"""Bins either side by whose median a line is told from a hump; so a hump has at least about 4 in its half-width."""


@dataclass(frozen=True)
class Spectrum:
    """Periodogram of one record.

    f (n,) [Hz], rising; power (n,) one-sided density [V²/Hz]; valid (n,): False on lines; drive_line: its frequency
    [Hz]; guard: half-width of the mask around it [Hz]; duration [s]; spread: variance of a bin's mean over many bins,
    over that of independent bins (the price of the taper).
    """

    f: Floats
    power: Floats
    valid: NDArray[np.bool_]
    drive_line: float
    guard: float
    duration: float
    spread: float

    @property
    def bin(self) -> float:
        """Distance of two bins [Hz]."""
        return 1 / self.duration

    def band(self, low: float, high: float) -> "Spectrum":
        """The bins within ``low`` .. ``high`` [Hz]."""
        inside = slice(*np.searchsorted(self.f, [low, high]))
        return Spectrum(
            self.f[inside],
            self.power[inside],
            self.valid[inside],
            self.drive_line,
            self.guard,
            self.duration,
            self.spread,
        )


@dataclass(frozen=True)
class Groups:
    """Means over groups of bins: f (n,) [Hz], power (n,) [V²/Hz], count (n,) of valid bins in each, > 0."""

    f: Floats
    power: Floats
    count: Floats


def line_spectrum(part: Envelope, drive_line: float, guard: float = 0.0) -> Spectrum:
    """The spectrum of an envelope with the line near ``drive_line`` [Hz] taken out.

    guard: half-width [Hz] of the mask around it, where the rate modulates the line; at least LINE_BINS bins. Raises
    InputError where the line wanders through the record.
    """
    line = _refined(part, drive_line)
    n = len(part.values)
    rest = _without_line(part, line)
    _check_line(part, rest, line, guard)
    window = tukey(n, TAPER)
    squares = window @ window
    density = np.abs(np.fft.fftshift(np.fft.fft(rest * window))) ** 2 / (squares * part.rate)
    f = part.centre + np.fft.fftshift(np.fft.fftfreq(n, 1 / part.rate))
    inside = np.abs(f - part.centre) <= part.band
    f, density = f[inside], 0.5 * density[inside]
    guard = max(guard, LINE_BINS / part.duration)
    valid = ~_lines(density) & (np.abs(f - line) > guard)
    spread = n * float((window**4).sum() / squares**2)
    return Spectrum(f, density, valid, line, guard, part.duration, spread)


def grouped(spectrum: Spectrum, size: int) -> Groups:
    """Means of the valid bins in groups of ``size`` neighbours."""
    starts = np.arange(0, len(spectrum.f), max(size, 1))
    count = np.add.reduceat(spectrum.valid.astype(float), starts)
    total = np.add.reduceat(np.where(spectrum.valid, spectrum.power, 0.0), starts)
    place = np.add.reduceat(np.where(spectrum.valid, spectrum.f, 0.0), starts)
    some = count > 0
    return Groups(place[some] / count[some], total[some] / count[some], count[some])


def line_reach(part: Envelope, drive_line: float) -> float:
    """How far from ``drive_line`` [Hz] the line is looked for [Hz]: 5 bins or 1e-5 of it."""
    return max(5 / part.duration, 1e-5 * drive_line)


def _refined(part: Envelope, drive_line: float) -> float:
    """The frequency of the line [Hz]: the peak within ``line_reach`` of ``drive_line``, to a hundredth of a bin."""
    n = len(part.values)
    reach = line_reach(part, drive_line)
    time = np.arange(n) / part.rate
    windowed = part.values * np.hanning(n)
    f = part.centre + np.fft.fftfreq(n, 1 / part.rate)
    power = np.where(np.abs(f - drive_line) <= reach, np.abs(np.fft.fft(windowed)) ** 2, 0.0)
    best = f[int(np.argmax(power))]
    around = best + np.array([-0.5, 0.0, 0.5]) / part.duration
    left, peak, right = (
        np.log(abs(windowed @ np.exp(-2j * np.pi * (g - part.centre) * time)) ** 2 + np.finfo(float).tiny)
        for g in around
    )
    curvature = left - 2 * peak + right
    return float(best + (0.25 * (left - right) / curvature / part.duration if curvature < 0 else 0.0))


def _without_line(part: Envelope, line: float) -> NDArray[np.complex128]:
    n = len(part.values)
    turn = np.exp(-2j * np.pi * (((line - part.centre) / part.rate * np.arange(n)) % 1))
    still = part.values * turn
    basis = legendre.legvander(np.linspace(-1, 1, n), DEGREE)
    amplitude = np.linalg.solve(basis.T @ basis, basis.T @ still)
    rest: NDArray[np.complex128] = (still - basis @ amplitude) * turn.conj()
    return rest


def _check_line(part: Envelope, rest: NDArray[np.complex128], line: float, guard: float) -> None:
    """Raises InputError where the line moves in frequency by more than the polynomial follows and ``guard`` [Hz] masks.

    Near the line a tone with a share e of noise has <|z|>²/<|z|²> = 1 - e/2, and e is left of it. One that moves keeps
    its modulus, and more is left.
    """
    n = len(rest)
    away = np.abs(part.centre + np.fft.fftfreq(n, 1 / part.rate) - line)
    near = away <= max(64 / part.duration, 1e-3 * line, 2 * guard)
    whole = np.abs(np.fft.ifft(np.where(near, np.fft.fft(part.values), 0.0)))
    left = np.abs(np.fft.ifft(np.where(near & (away >= guard), np.fft.fft(rest), 0.0)))
    # The band cuts off the ends of a tone that it was not given.
    inner = slice(n // 10, n - n // 10)
    power = np.mean(whole[inner] ** 2)
    unsteady = 1 - np.mean(whole[inner]) ** 2 / power
    if np.mean(left[inner] ** 2) > max(LEFT, 8 * unsteady) * power:
        raise InputError(
            f"the drive line near {line:.6g} Hz wanders within the record of {part.duration:.4g} s, by more than its "
            "resolution: cut the record into shorter ones, give I and Q of a demodulator that follows the drive, or, "
            "where the rate of turn moves the line, --guard with the rate's bandwidth"
        )


def _lines(density: Floats) -> NDArray[np.bool_]:
    """Bins on a line, or so near that its leakage through the taper exceeds a tenth of the floor."""
    high = density > LINE_OVER_MEDIAN * median_filter(density, 2 * NEIGHBOURS + 1, mode="nearest")
    floor = float(np.median(density))
    away = np.arange(1, len(density))
    # Envelope of the taper's transform: 1/(π u), times 1/(TAPER u)² beyond the reach of its flanks.
    leakage = 1 / ((np.pi * away) ** 2 * np.maximum(TAPER * away, 1.0) ** 4)
    masked = np.zeros(len(density), dtype=bool)
    for place in np.flatnonzero(high):
        reach = 2 + int(np.searchsorted(-leakage, -0.1 * floor / density[place]))
        masked[max(place - reach, 0) : place + reach + 1] = True
    return masked
