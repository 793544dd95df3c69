"""The method of CN 111272193: the theoretical noise spectrum slides along the measured one.

    N(f) = S_m |G_y0(f)|²,  S_m = 2 k_B T c_y (two-sided),  R(λ) = ∫ N(f) M(f + λ) df

R has a peak at λ = f_x - f0, where N meets the line of Coriolis force and quadrature, and one at λ = f_y - f0, where it
meets the thermal hump. f_x is known, so the other is f_y (eqs. 4, 10; steps 3 and 4). As printed the line stays in M,
and its peak in R has the flanks of N: P_x (w/Δf)² at the hump, P_x the power of the line and w the half-width. That
hides the hump of power P_y, twice as wide in R, unless Δf > w √(2 P_x/P_y); with the line taken out it does not.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.signal import fftconvolve, find_peaks

from calibration.mode_split.model import SplitModel, response
from calibration.mode_split.record import Envelope, Floats
from calibration.mode_split.spectrum import Spectrum
from gyro_model.symbols import BOLTZMANN

ROOM_TEMPERATURE: Final = 298.15
STANDS_OUT: Final = 0.05
"""Prominence of a peak of R, of its own height: below it is ripple."""


@dataclass(frozen=True)
class Correlation:
    """lag (n,) [Hz]; r (n,) [V⁴/Hz]; preset f0 [Hz]; q of N; line_lag: peak at f_x - f0; hump_lag: the largest other
    [Hz], or None where R has no such peak."""

    lag: Floats
    r: Floats
    preset: float
    q: float
    line_lag: float | None
    hump_lag: float | None

    @property
    def f_y(self) -> float | None:
        """f0 + λ of the hump [Hz]."""
        return None if self.hump_lag is None else self.preset + self.hump_lag


def theoretical_spectrum(
    f: Floats, preset: float, q: float, *, mass: float = 1.0, gain: float = 1.0, temperature: float = ROOM_TEMPERATURE
) -> Floats:
    """N(f) [V²/Hz], two-sided (CN 111272193, eq. 4), shape of ``f`` [Hz].

    preset: f0 [Hz]; mass [kg] and gain K_xv [V/m] scale it and move no peak; temperature [K].
    """
    w0 = 2 * np.pi * preset
    damping = mass * w0 / q
    at_top = gain / (damping * w0)
    return 2 * float(BOLTZMANN) * temperature * damping * at_top**2 * response(f, preset, q)


def measured_spectrum(part: Envelope) -> tuple[Floats, Floats]:
    """Frequencies (n,) [Hz] and M (n,) [V²/Hz]: the periodogram with its line, two-sided as in CN 111272193."""
    n = len(part.values)
    density = np.abs(np.fft.fftshift(np.fft.fft(part.values))) ** 2 / (n * part.rate)
    f = part.centre + np.fft.fftshift(np.fft.fftfreq(n, 1 / part.rate))
    inside = np.abs(f - part.centre) <= part.band
    # A quarter of the envelope's density: |z|² is twice the power of v, and half of that lies at negative frequencies.
    return f[inside], 0.25 * density[inside]


def correlate(f: Floats, m: Floats, drive_line: float, q: float, preset: float) -> Correlation:
    """R over the lags at which f0 + λ lies on ``f`` (n,), with its two peaks."""
    step, n = (f[-1] - f[0]) / (len(f) - 1), len(f)
    # N as far as it can meet M at any lag: cut shorter, it would hide the flanks that a line gives R.
    shape = theoretical_spectrum(preset + step * np.arange(-n + 1, n), preset, q)
    # Correlation is convolution with the shape turned round.
    r = fftconvolve(m, shape[::-1])[n - 1 : 2 * n - 1] * step
    lag = f - preset
    peaks, found = find_peaks(r, prominence=0.0)
    peaks = peaks[found["prominences"] > STANDS_OUT * r[peaks]]
    if len(peaks) == 0:
        return Correlation(lag, r, preset, q, None, None)
    line = int(peaks[np.argmin(np.abs(lag[peaks] - (drive_line - preset)))])
    at_line = abs(lag[line] - (drive_line - preset)) <= max(0.5 * preset / q, 2 * step)
    others = peaks[peaks != line] if at_line else peaks
    hump = float(lag[others[np.argmax(r[others])]]) if len(others) else None
    return Correlation(lag, r, preset, q, float(lag[line]) if at_line else None, hump)


def correlate_without_line(spectrum: Spectrum, q: float, preset: float) -> Correlation:
    """The same with every line in M replaced by the median around it: not in the patent, but then the method works."""
    filled = np.interp(spectrum.f, spectrum.f[spectrum.valid], spectrum.power[spectrum.valid])
    found = correlate(spectrum.f, 0.5 * filled, spectrum.drive_line, q, preset)
    best = int(np.argmax(found.r))
    return Correlation(found.lag, found.r, preset, q, None, float(found.lag[best]))


def peak_uncertainty(found: Correlation, model: SplitModel, spectrum: Spectrum, line_power: float) -> float:
    """Half-width [Hz] of the 95 % interval of the hump's peak, with the shift by the flank of a line left in M.

    model: what M is; line_power: two-sided [V²]. R' = -∫ N' M has the variance Σ N'² M² df² over the bins; the peak
    moves by R' over R''.
    """
    if found.f_y is None:
        return np.inf
    step = spectrum.bin
    f = spectrum.f
    shape = theoretical_spectrum(f, found.f_y, found.q)
    slope, m = np.gradient(shape, step), 0.5 * model.density(f)
    curvature = float(np.gradient(slope, step) @ m) * step
    scatter = float(np.sqrt(spectrum.spread * np.sum((slope * m) ** 2))) * step
    flank = line_power * float(np.interp(spectrum.drive_line, f, slope))
    return (1.96 * scatter + abs(flank)) / abs(curvature)
