"""Records of a sense voltage from a slow generator of its own: exact, and independent of the estimator's formulas.

    y'' + (ω/Q) y' + ω² y = n(t) + F cos(ω_x t)

n is the thermal force. The modal amplitude ζ' = s ζ + n, s = -ω/(2Q) + iω√(1 - 1/(4Q²)), y = Im ζ/Im s, is stepped by
its exact solution over a sample period with the exact covariance of its noise; the line is the steady state of the
transfer function. White and flicker noise are added per sample. Where the resonance is narrow the analytic signal ζ is
stepped at a slow rate around the drive line instead: what folds back is below 1e-6 of the hump.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from calibration.mode_split import VoltageRecord

THERMAL_RMS: Final = 8e-6
"""Thermal motion in volts: 8 pm, √(k_B T/k) for 64 N/m, at 1e6 V/m."""
LINE_PER_HZ: Final = 0.8 / 300
"""Amplitude of the line [V] times the split [Hz], per °/s of quadrature at 1 µm of drive: Ω A/(2π Δf) at 1e6 V/m."""


@dataclass(frozen=True)
class SenseAxis:
    """f_x, f_y [Hz]; q; hump_db: height over the white floor at f_y; flicker: density at f_x over the white one;
    line_deg: rate [°/s] that the line at f_x is worth."""

    f_x: float = 3000.0
    f_y: float = 3050.0
    q: float = 1885.0
    hump_db: float = 20.0
    flicker: float = 0.1
    line_deg: float = 300.0

    @property
    def half_width(self) -> float:
        """Of the hump [Hz]."""
        return 0.5 * self.f_y / self.q

    @property
    def decay(self) -> float:
        """Decay rate Γ = π f_y/Q [1/s]."""
        return np.pi * self.f_y / self.q

    @property
    def hump(self) -> float:
        """Density at f_y [V²/Hz], one-sided: a Lorentzian of that power and half-width."""
        return THERMAL_RMS**2 / (np.pi * self.half_width)

    @property
    def white(self) -> float:
        """Density of the white floor [V²/Hz], one-sided."""
        return self.hump / 10 ** (self.hump_db / 10)

    @property
    def line_amplitude(self) -> float:
        """Of the steady state at f_x [V]: force over the distance in frequency, line width included."""
        return LINE_PER_HZ * self.line_deg / float(np.hypot(self.f_y - self.f_x, self.half_width))


def thermal(axis: SenseAxis, rate: float, count: int, rng: np.random.Generator) -> NDArray[np.float64]:
    """Thermal motion [V], (count,), at ``rate`` [Hz], stationary from the first sample."""
    w = 2 * np.pi * axis.f_y
    s = complex(-0.5 * w / axis.q, w * np.sqrt(1 - 0.25 / axis.q**2))
    dt = 1 / rate
    # White n of unit strength: E|ζ|² and E ζ² gained over a step, and at rest.
    own, pseudo = np.expm1(2 * s.real * dt) / (2 * s.real), np.expm1(2 * s * dt) / (2 * s)
    noise = _complex(own, pseudo, count, rng)
    noise[0] = _complex(-1 / (2 * s.real), -1 / (2 * s), 1, rng)[0]
    motion = lfilter([1.0], [1.0, -np.exp(s * dt)], noise).imag / s.imag
    # E y² = 1/(4 Γ ω²) for unit strength.
    result: NDArray[np.float64] = THERMAL_RMS * motion * np.sqrt(-4 * s.real) * w
    return result


def make_record(axis: SenseAxis, duration: float, seed: int, rate: float = 12000.0, hot: bool = True) -> VoltageRecord:
    """A record of ``duration`` [s]; hot: with thermal motion."""
    rng = np.random.default_rng(seed)
    count = round(duration * rate)
    v = thermal(axis, rate, count, rng) if hot else np.zeros(count)
    v += np.sqrt(0.5 * axis.white * rate) * rng.standard_normal(count)
    if axis.flicker:
        v += _flicker(axis.flicker * axis.white * axis.f_x, rate, count, rng)
    v += axis.line_amplitude * np.cos(2 * np.pi * ((axis.f_x / rate * np.arange(count)) % 1) + rng.uniform(0, 6.28))
    return VoltageRecord(v, rate)


def make_envelope(axis: SenseAxis, duration: float, seed: int, hot: bool = True) -> VoltageRecord:
    """The same as a complex record around f_x, 3300 half-widths wide: for Q of 5000 and more."""
    rng = np.random.default_rng(seed)
    rate = 3300 * axis.half_width
    count = round(duration * rate)
    z = (
        ornstein_uhlenbeck(np.full(count, axis.f_y - axis.f_x), axis.decay, rate, rng)
        if hot
        else np.zeros(count, complex)
    )
    z *= np.sqrt(2) * THERMAL_RMS
    # Over a band this narrow beside f_x flicker noise is white.
    z += np.sqrt(2 * axis.white * (1 + axis.flicker) * rate) * complex_normal(count, rng)
    z += axis.line_amplitude * np.exp(1j * rng.uniform(0, 6.28))
    return VoltageRecord(z, rate, axis.f_x)


def ornstein_uhlenbeck(
    offset: NDArray[np.float64], decay: float, rate: float, rng: np.random.Generator
) -> NDArray[np.complex128]:
    """Y' = (-Γ + i 2 π offset(t)) Y + n with E|Y|² = 1, (count,) as ``offset`` [Hz]; Γ = ``decay`` [1/s].

    In the frame that turns with the offset it is a plain first-order process, and white noise stays white.
    """
    count = len(offset)
    turn = np.exp(2j * np.pi * np.cumsum(offset) / rate)
    noise = np.sqrt(-np.expm1(-2 * decay / rate)) * complex_normal(count, rng)
    noise[0] = complex_normal(1, rng)[0]
    result: NDArray[np.complex128] = turn * lfilter([1.0], [1.0, -np.exp(-decay / rate)], noise)
    return result


def complex_normal(count: int, rng: np.random.Generator) -> NDArray[np.complex128]:
    """Complex white noise with E|z|² = 1."""
    result: NDArray[np.complex128] = (rng.standard_normal((count, 2)) @ [1, 1j]) / np.sqrt(2)
    return result


def _complex(own: float, pseudo: complex, count: int, rng: np.random.Generator) -> NDArray[np.complex128]:
    """Complex normal numbers with E|z|² = own, E z² = pseudo."""
    covariance = 0.5 * np.array([[own + pseudo.real, pseudo.imag], [pseudo.imag, own - pseudo.real]])
    root = np.linalg.cholesky(covariance)
    pair = root @ rng.standard_normal((2, count))
    result: NDArray[np.complex128] = pair[0] + 1j * pair[1]
    return result


def _flicker(strength: float, rate: float, count: int, rng: np.random.Generator) -> NDArray[np.float64]:
    """Noise of one-sided density strength/f [V²/Hz]."""
    f = np.maximum(np.fft.rfftfreq(count, 1 / rate), 1.0)
    spectrum = np.fft.rfft(rng.standard_normal(count)) * np.sqrt(0.5 * rate * strength / f)
    result: NDArray[np.float64] = np.fft.irfft(spectrum, count)
    return result
