"""Bias over the pattern angle, from a run in which the pattern goes round.

Damping and stiffness that are not isotropic make the pattern drift by an amount that depends on where it stands. An
orbit turned by pi is the same orbit, so the drift is a series in the even harmonics of the pattern angle:

    d(error)/dt = b + sum over h = 2, 4 of (c_h cos h phi + s_h sin h phi)
"""

from math import atan2, hypot, pi
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid

from calibration.analysis.regression import least_squares_correlated
from gyro_model.errors import InputError

Floats = NDArray[np.float64]

ORDERS: Final = (2, 4)
"""Harmonics of the pattern angle: unequal and rotated damping is the second; the fourth comes from squares of it and of
the pickoff's defects."""
ARC: Final = pi / 18
"""The record is averaged over blocks in which the pattern turns by this, 10 deg [rad]."""
ROUND: Final = pi
"""The pattern must turn by this [rad], or the harmonics can't be told from the mean."""
BINS: Final = 36


class Harmonic(NamedTuple):
    """One harmonic [rad/s]: cosine * cos(order * phi) + sine * sin(order * phi), with standard errors."""

    order: int
    cosine: float
    sine: float
    cosine_error: float
    sine_error: float

    @property
    def amplitude(self) -> float:
        """Its amplitude [rad/s]."""
        return hypot(self.cosine, self.sine)

    @property
    def angle(self) -> float:
        """Pattern angle of its maximum [rad], from -pi/order to pi/order."""
        return atan2(self.sine, self.cosine) / self.order


class Spin(NamedTuple):
    """Error of the rate over the pattern angle.

    mean with its standard error [rad/s]: bias and, at a rate, the error of the scale factor; harmonics: of ORDERS;
    pattern: middles of the bins [rad] in 0 .. pi; rate_error: the mean in each [rad/s]; spread: the standard error of
    each [rad/s]; shapes (m,). rounds: how often the pattern went round.
    """

    mean: float
    mean_error: float
    harmonics: tuple[Harmonic, ...]
    pattern: Floats
    rate_error: Floats
    spread: Floats
    rounds: float


def spin(t: Floats, error: Floats, pattern: Floats) -> Spin:
    """Of a record in which the angle is wrong by ``error`` [rad] and the pattern stands at ``pattern`` [rad],
    unwrapped, at times ``t`` [s], rising; shapes (n,).

    Raises InputError where a row holds no number, the pattern does not go round, or rows are too far apart.
    """
    if not (np.isfinite(t).all() and np.isfinite(error).all() and np.isfinite(pattern).all()):
        raise InputError("angle holds rows without a number: give the rows from convergence on")
    turned = float(np.ptp(pattern)) if len(pattern) else 0.0
    if turned < ROUND:
        raise InputError(
            f"pattern turned by {turned:.3g} rad: bias over its angle needs {ROUND:.3g} rad; give a higher rate or a "
            "longer duration"
        )
    blocks = int(np.ceil(np.abs(np.diff(pattern)).sum() / ARC))
    if len(t) < 4 * blocks:
        raise InputError(
            f"{len(t)} rows for {blocks} blocks of {np.rad2deg(ARC):g} deg: give {4 * blocks} rows or more"
        )
    # Model and record go through the same averages and differences, so that neither dulls a harmonic.
    regressors = [np.ones_like(pattern)]
    regressors += [wave(order * pattern) for order in ORDERS for wave in (np.cos, np.sin)]
    design = np.stack([_rate(t, cumulative_trapezoid(r, t, initial=0.0), blocks) for r in regressors], axis=1)
    rate_error = _rate(t, error, blocks)
    fit = least_squares_correlated(design, rate_error)
    v, e = fit.values.tolist(), fit.errors.tolist()
    harmonics = tuple(
        Harmonic(order, v[i], v[i + 1], e[i], e[i + 1]) for order, i in zip(ORDERS, range(1, len(v), 2), strict=True)
    )
    means = _means(pattern, blocks)
    return Spin(v[0], e[0], harmonics, *_binned(0.5 * (means[:-1] + means[1:]), rate_error), turned / ROUND)


def _means(values: Floats, blocks: int) -> Floats:
    """Means over ``blocks`` blocks of as equal a size as can be."""
    borders = np.linspace(0, len(values), blocks + 1).astype(int)
    means: Floats = np.add.reduceat(values, borders[:-1]) / np.diff(borders)
    return means


def _rate(t: Floats, values: Floats, blocks: int) -> Floats:
    """Rate of change from the mean of each block to that of the next, shape (blocks - 1,)."""
    rate: Floats = np.diff(_means(values, blocks)) / np.diff(_means(t, blocks))
    return rate


def _binned(pattern: Floats, values: Floats) -> tuple[Floats, Floats, Floats]:
    """Middles of the bins that are not empty, mean in each, and its standard error (NaN for a single value)."""
    index = np.minimum((pattern % ROUND / ROUND * BINS).astype(int), BINS - 1)
    used = np.unique(index)
    inside = [values[index == i] for i in used]
    spread = [float(v.std(ddof=1)) / len(v) ** 0.5 if len(v) > 1 else np.nan for v in inside]
    return (used + 0.5) * ROUND / BINS, np.array([v.mean() for v in inside]), np.array(spread)
