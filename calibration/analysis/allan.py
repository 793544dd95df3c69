"""Allan deviation of the rate, or of the angle that a gyroscope gives, with intervals and noise terms.

Terms of the variance (IEEE Std 952, annex C): quantisation, or white angle noise, 3 Q²/τ², angle random walk N²/τ, bias
instability (2 ln 2/π) B², rate random walk K² τ/3, rate ramp R² τ²/2.
"""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls
from scipy.stats import chi2

from calibration.analysis.allan_freedom import degrees_of_freedom
from cosim.rate.allan import FLAT, LONGEST_SHARE, MINIMUM_ROWS, bottom, overlapping
from gyro_model.errors import InputError

Floats = NDArray[np.float64]

CONFIDENCE: Final = 0.95
OCTAVE: Final = 2.0
"""The terms are fitted to deviations at least this far apart: nearer ones repeat each other."""
SLOPES: Final = np.array([-1.0, -0.5, 0.0, 0.5, 1.0])
"""Of the deviation of each term, on logarithmic axes."""
SHARED: Final = 1.4
"""Octaves of an overlapping estimator still share noise: the terms scatter by this more than independent deviations
would let them (Q and N where they rule: 1.3 to 1.5 in 150 records each of five mixtures of the terms)."""
LEAST_SPAN: Final = 8.0
"""The longest averaging time over the shortest one that is fitted, at least: three octaves."""
PASSES: Final = 4
"""The weights come from the fit of the pass before; from the third on they change no third digit."""


class Term(NamedTuple):
    """A coefficient and its standard error; where it is zero, the error says what would have been seen."""

    value: float
    error: float


class AngleAllan(NamedTuple):
    """tau [s]; deviation, low and high, its 95 % interval [rad/s], shapes (n,).

    Fitted terms: angle_noise Q [rad]; angle_random_walk N [rad/sqrt(s)]; instability B [rad/s]; rate_random_walk K
    [rad/s/sqrt(s)]; rate_ramp R [rad/s²]. bias_instability [rad/s], at bias_instability_tau [s]: read off the bottom,
    None where the deviation still falls at the end; lowest: the least deviation over 0.664, with its standard error.
    """

    tau: Floats
    deviation: Floats
    low: Floats
    high: Floats
    angle_noise: Term
    angle_random_walk: Term
    instability: Term
    rate_random_walk: Term
    rate_ramp: Term
    bias_instability: float | None
    bias_instability_tau: float | None
    lowest: Term


def angle_allan(angle: Floats, interval: float) -> AngleAllan:
    """Of the error of an ``angle`` [rad], shape (n,), one each ``interval`` [s].

    Raises InputError where a row holds no number or there are too few, saying how many are needed.
    """
    if not np.isfinite(angle).all():
        raise InputError("angle holds rows without a number: give the rows from convergence on")
    if len(angle) <= MINIMUM_ROWS:
        raise InputError(f"{len(angle)} rows of the angle: an Allan deviation needs {MINIMUM_ROWS + 1}")
    return rate_allan((np.diff(angle) / interval)[None], interval)


def rate_allan(rates: Floats, interval: float, shortest: float = 0.0) -> AngleAllan:
    """Of records of one ``rate`` [rad/s], shape (records, n), means over each ``interval`` [s]: the mean of their
    variances, with the degrees of freedom of all.

    shortest: the terms are fitted from this averaging time on [s]; below, a filter shapes the deviation. Raises
    InputError where the records are too short for that, or hold no noise.
    """
    found = [overlapping(rate, interval) for rate in rates]
    tau = found[0][0]
    deviation = np.sqrt(np.mean([one**2 for _, one in found], axis=0))
    if not deviation.all():
        raise InputError("angle does not change: an Allan deviation needs its noise")
    used = tau >= shortest * (1 - 1e-9)
    if tau[-1] < LEAST_SPAN * max(shortest, interval):
        raise InputError(
            f"record of {rates.shape[1] * interval:.4g} s: an Allan deviation from {shortest:.3g} s on needs "
            f"{LEAST_SPAN * max(shortest, interval) / LONGEST_SHARE:.4g} s"
        )
    design = columns(tau)

    def freedom_of(slope: Floats) -> Floats:
        return len(rates) * _freedom(slope, tau, interval, rates.shape[1] + 1)

    def fit(freedom: Floats) -> tuple[Floats, Floats]:
        return _fit(design[used], deviation[used], freedom[used], tau[used])

    # What noise there is decides how many degrees of freedom a deviation has, and these how the terms are fitted.
    squares, _ = fit(freedom_of(np.zeros(len(tau))))
    shares = design * squares
    freedom = freedom_of(shares @ SLOPES / shares.sum(axis=1))
    tail = (1 - CONFIDENCE) / 2
    low, high = (deviation * np.sqrt(freedom / chi2.ppf(share, freedom)) for share in (1 - tail, tail))
    # Of a deviation, half the relative error of the variance, sqrt(2/freedom).
    error = deviation / np.sqrt(2 * freedom)
    seen = bottom(tau, deviation, float(error[-1]))
    lowest = Term(float(deviation.min() / FLAT), float(error[deviation.argmin()] / FLAT))
    q, n, b, k, r = map(_term, *fit(freedom))
    return AngleAllan(tau, deviation, low, high, q, n, b, k, r, *seen, lowest)


def columns(tau: Floats) -> Floats:
    """What the square of each coefficient is multiplied by in the variance at ``tau`` [s], shape (n, 5)."""
    return np.stack([3 / tau**2, 1 / tau, np.full(len(tau), FLAT**2), tau / 3, tau**2 / 2], axis=1)


def _freedom(slope: Floats, tau: Floats, interval: float, rows: int) -> Floats:
    """Degrees of freedom of each deviation, shape (n,), for the noise that its ``slope`` shows (Greenhall and Riley
    2003): white rate at -1/2, flicker at 0, random walk at 1/2. Steeper than white counts as white: white angle noise
    would promise hundreds of times as many as the least white rate beside it leaves."""
    noise = np.clip(np.rint(-2 * slope - 1), -2, 0).astype(int)
    averaged = np.rint(tau / interval).astype(int)
    pairs = zip(noise.tolist(), averaged.tolist(), strict=True)
    return np.array([degrees_of_freedom(a, m, rows) for a, m in pairs])


def _fit(design: Floats, deviation: Floats, freedom: Floats, tau: Floats) -> tuple[Floats, Floats]:
    """Squares of the five coefficients and their standard errors, shapes (5,), by least squares on the variance with
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
