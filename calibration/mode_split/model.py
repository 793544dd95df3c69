"""The spectrum of the sense voltage as a model, and what it lets one know of the sense resonance.

    M(f) = h |G(f)|²/|G(f_y)|² + w + k f_x/f + s (g/(f - f_x))²

Thermal hump, white and flicker floor of CN 111272193 (eqs. 3, 10), and the skirt that a line with phase noise leaves
beside its masked bins (g: half-width of the mask). |G(f)|² = 1/((f_y² - f²)² + (f f_y/Q)²) as in its eq. 11.
"""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from calibration.mode_split.record import Floats

NAMES: Final = ("f_y", "log_q", "log_hump", "log_white", "log_flicker", "log_skirt")
F_Y, LOG_Q, LOG_HUMP, LOG_WHITE, LOG_FLICKER, LOG_SKIRT = range(len(NAMES))


@dataclass(frozen=True)
class SplitModel:
    """Parameters of the spectrum, densities one-sided.

    f_y [Hz]: undamped sense resonance; q [1]; hump: density at f_y [V²/Hz]; white, flicker (at the drive line), skirt
    (at the edge of the mask) [V²/Hz]; drive_line, guard [Hz] as in ``Spectrum``.
    """

    f_y: float
    q: float
    hump: float
    white: float
    flicker: float
    skirt: float
    drive_line: float
    guard: float

    @property
    def half_width(self) -> float:
        """Of the hump at half its height, f_y/(2 Q) [Hz]."""
        return 0.5 * self.f_y / self.q

    @property
    def vector(self) -> Floats:
        """The parameters in the order of NAMES; the logarithm of zero is -inf."""
        with np.errstate(divide="ignore"):
            logs = np.log([self.q, self.hump, self.white, self.flicker, self.skirt])
        return np.concatenate([[self.f_y], logs])

    def at(self, vector: Floats) -> "SplitModel":
        """The model with other parameters, in the order of NAMES."""
        return replace(self, f_y=float(vector[0]), **dict(zip(_FIELDS, np.exp(vector[1:]).tolist(), strict=True)))

    def floor(self, f: ArrayLike) -> Floats:
        """Everything but the hump [V²/Hz]."""
        white, flicker, skirt = self._floor_terms(np.asarray(f, dtype=float))
        return white + flicker + skirt

    def density(self, f: ArrayLike) -> Floats:
        """M(f) [V²/Hz]."""
        return self.hump * response(f, self.f_y, self.q) + self.floor(f)

    def log_gradient(self, f: Floats) -> tuple[Floats, Floats]:
        """M (n,) and d ln M/d parameter (n, 6) in the order of NAMES."""
        hump = self.hump * response(f, self.f_y, self.q)
        damping = (f * self.f_y / self.q) ** 2
        below = (self.f_y**2 - f**2) ** 2 + damping
        slope = 4 / self.f_y - (4 * self.f_y * (self.f_y**2 - f**2) + 2 * damping / self.f_y) / below
        terms = self._floor_terms(f)
        density = hump + sum(terms)
        parts = (hump * slope, hump * (2 * damping / below - 2), hump, *terms)
        return density, np.stack(np.broadcast_arrays(*parts), axis=-1) / density[:, None]

    def _floor_terms(self, f: Floats) -> tuple[Floats, Floats, Floats]:
        away = np.maximum(np.abs(f - self.drive_line), self.guard)
        return self.white * np.ones_like(f), self.flicker * self.drive_line / f, self.skirt * (self.guard / away) ** 2


_FIELDS: Final = ("q", "hump", "white", "flicker", "skirt")


def response(f: ArrayLike, f_y: float, q: float) -> Floats:
    """|G(f)|²/|G(f_y)|² of a resonance, shape of ``f`` [Hz] (CN 111272193, eq. 11)."""
    g = np.asarray(f, dtype=float)
    shape: NDArray[np.float64] = (f_y**2 / q) ** 2 / ((f_y**2 - g**2) ** 2 + (g * f_y / q) ** 2)
    return shape


def kept_information(hump_over_floor: float) -> float:
    """g: the share of the information on f_y that a white floor leaves, for R = hump over floor at its top.

        g = R²/(a (1 + a)³), a = √(1 + R)

    From I = T ∫ (d ln M/d f_y)² df with M ∝ 1/(1 + z²) + 1/R, z = (f - f_y)/half-width:
    g = (2R²/π) ∫ z²/((1 + z²)² (a² + z²)²) dz. It is 0.21 at 6 dB and 0.97 at 40 dB.
    """
    a = np.sqrt(1 + hump_over_floor)
    return float(hump_over_floor**2 / (a * (1 + a) ** 3))


def frequency_bound(f_y: float, q: float, duration: float, hump_over_floor: float = np.inf) -> float:
    """Cramér–Rao bound σ_f = √(Γ/(T g))/2π [Hz], Γ = π f_y/Q, of f_y from ``duration`` [s] of thermal noise.

    All else known; the hump is symmetric, so that not knowing Q, hump and floor costs nothing to first order.
    """
    g = 1.0 if np.isinf(hump_over_floor) else kept_information(hump_over_floor)
    return float(np.sqrt(np.pi * f_y / (q * duration * g)) / (2 * np.pi))


def spectrum_bound(model: SplitModel, f: Floats) -> float:
    """Cramér–Rao bound of f_y [Hz] from the bins of a periodogram at ``f`` (n,) [Hz]; Q, hump and floor unknown.

    A bin is exponential with mean M, so each adds d ln M d ln Mᵀ to the Fisher information. A line on the hump costs
    little: the bins at its top tell nothing of f_y, d ln M/d f_y = 0 there; masking ±Z half-widths takes
    (2/π)(arctan Z - Z/(1 + Z²)) of the information, 4 % for Z = 1/2.
    """
    _, gradient = model.log_gradient(f)
    matrix = gradient.T @ gradient
    some = np.diag(matrix) > 0
    scale = 1 / np.sqrt(np.diag(matrix)[some])
    # Terms that the band can't tell apart make the matrix nearly singular; f_y is not among them.
    inverse = np.linalg.pinv(matrix[np.ix_(some, some)] * np.outer(scale, scale), rcond=1e-10, hermitian=True)
    return float(np.sqrt(inverse[F_Y, F_Y]) * scale[F_Y])
