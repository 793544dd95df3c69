"""Allan deviation of the rate from the angle that a whole-angle gyroscope gives, with intervals and noise terms.

Terms of the variance (IEEE Std 952, annex C): white angle noise 3 Q²/τ², angle random walk N²/τ, bias instability
(2 ln 2/π) B², rate random walk K² τ/3.
"""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls
from scipy.stats import chi2

from calibration.analysis.allan_freedom import degrees_of_freedom
from cosim.rate.allan import FLAT, MINIMUM_ROWS, bottom, overlapping
from gyro_model.errors import InputError

Floats = NDArray[np.float64]

CONFIDENCE: Final = 0.95
OCTAVE: Final = 2.0
"""The terms are fitted to deviations at least this far apart: nearer ones repeat each other."""
SLOPES: Final = np.array([-1.0, -0.5, 0.0, 0.5])
"""Of the deviation of each term, on logarithmic axes."""
SHARED: Final = 1.4
"""Octaves of an overlapping estimator still share noise: the terms scatter by this more than independent deviations
would let them (Q and N where they rule: 1.3 to 1.5 in 150 records each of five mixtures of the terms)."""
PASSES: Final = 4
"""The weights come from the fit of the pass before; from the third on they change no third digit."""


class Term(NamedTuple):
    """A coefficient and its standard error; where it is zero, the error says what would have been seen."""

    value: float
    error: float


class AngleAllan(NamedTuple):
    """tau [s]; deviation, low and high, its 95 % interval [rad/s], shapes (n,).

    Fitted terms: angle_noise Q [rad]; angle_random_walk N [rad/sqrt(s)]; instability B [rad/s]; rate_random_walk K
    [rad/s/sqrt(s)]. bias_instability [rad/s], at bias_instability_tau [s]: read off the bottom, None where the
    deviation still falls at the end.
    """

    tau: Floats
    deviation: Floats
    low: Floats
    high: Floats
    angle_noise: Term
    angle_random_walk: Term
    instability: Term
    rate_random_walk: Term
    bias_instability: float | None
    bias_instability_tau: float | None


def angle_allan(angle: Floats, interval: float) -> AngleAllan:
    """Of the error of an ``angle`` [rad], shape (n,), one each ``interval`` [s].

    Raises InputError where a row holds no number or there are too few, saying how many are needed.
    """
    if not np.isfinite(angle).all():
        raise InputError("angle holds rows without a number: give the rows from convergence on")
    if len(angle) <= MINIMUM_ROWS:
        raise InputError(f"{len(angle)} rows of the angle: an Allan deviation needs {MINIMUM_ROWS + 1}")
    tau, deviation = overlapping(np.diff(angle) / interval, interval)
    if not deviation.all():
        raise InputError("angle does not change: an Allan deviation needs its noise")
    design = np.stack([3 / tau**2, 1 / tau, np.full(len(tau), FLAT**2), tau / 3], axis=1)
    # What noise there is decides how many degrees of freedom a deviation has, and these how the terms are fitted.
    freedom = _freedom(np.zeros(len(tau)), tau, interval, len(angle))
    squares, _ = _fit(design, deviation, freedom, tau)
    shares = design * squares
    freedom = _freedom(shares @ SLOPES / shares.sum(axis=1), tau, interval, len(angle))
    angle_noise, walk, instability, rate_walk = map(_term, *_fit(design, deviation, freedom, tau))
    tail = (1 - CONFIDENCE) / 2
    low, high = (deviation * np.sqrt(freedom / chi2.ppf(share, freedom)) for share in (1 - tail, tail))
    # Of a deviation, half the relative error of the variance, sqrt(2/freedom).
    lowest, lowest_tau = bottom(tau, deviation, float(deviation[-1] / np.sqrt(2 * freedom[-1])))
    return AngleAllan(tau, deviation, low, high, angle_noise, walk, instability, rate_walk, lowest, lowest_tau)


def _freedom(slope: Floats, tau: Floats, interval: float, rows: int) -> Floats:
    """Degrees of freedom of each deviation, shape (n,), for the noise that its ``slope`` shows (Greenhall and Riley
    2003): white rate at -1/2, flicker at 0, random walk at 1/2. Steeper than white counts as white: white angle noise
    would promise hundreds of times as many as the least white rate beside it leaves."""
    noise = np.clip(np.rint(-2 * slope - 1), -2, 0).astype(int)
    averaged = np.rint(tau / interval).astype(int)
    pairs = zip(noise.tolist(), averaged.tolist(), strict=True)
    return np.array([degrees_of_freedom(a, m, rows) for a, m in pairs])


def _fit(design: Floats, deviation: Floats, freedom: Floats, tau: Floats) -> tuple[Floats, Floats]:
    """Squares of the four coefficients and their standard errors, shapes (4,), by least squares on the variance with
    weights of its own statistics; none is negative."""
    rows = [0]
    for row in range(1, len(tau)):
        # A hair less than an octave is one.
        if tau[row] >= OCTAVE * tau[rows[-1]] * (1 - 1e-9):
            rows.append(row)
    design, variance = design[rows], deviation[rows] ** 2
    relative = np.sqrt(2 / freedom[rows])
    model = variance
    for _ in range(PASSES):
        weighted = design / (relative * model)[:, None]
        size = np.sqrt((weighted**2).sum(axis=0))
        scaled, _ = nnls(weighted / size, variance / (relative * model))
        model = design @ (scaled / size)
    errors = 1 / size
    active = scaled > 0
    used = (weighted / size)[:, active]
    errors[active] *= np.sqrt(np.diag(np.linalg.inv(used.T @ used)))
    return scaled / size, SHARED * errors


def _term(square: float, error: float) -> Term:
    """A coefficient from its square, where d(c²) = 2 c dc; one that is not seen could be as large as sqrt(d(c²))."""
    largest = float(error**0.5)
    return Term(float(square**0.5), min(float(error / (2 * square**0.5)), largest) if square > 0 else largest)
