"""Whittle's maximum likelihood for the spectrum of the sense voltage: fit, intervals, likelihood profile.

Bins of the periodogram are independent and exponential with mean M(f) (P. Whittle 1953); a mean over c of them has

    -ln L = Σ c (ln M + P/M)

A taper makes neighbours dependent: the log-likelihood is divided by ``spread``.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.linalg import LinAlgError, cho_factor, cho_solve
from scipy.stats import chi2

from calibration.mode_split.model import F_Y, LOG_FLICKER, LOG_HUMP, LOG_Q, LOG_SKIRT, LOG_WHITE, SplitModel
from calibration.mode_split.record import Floats
from calibration.mode_split.spectrum import Groups

LOOSE: Final = 3.0
"""Standard deviation of a prior on the logarithms of the floor's terms: within e^±3 of their start. It tells nothing of
f_y and keeps a term that is not there, or that the band can't tell from another, from running away."""
FLOOR_TERMS: Final = (LOG_WHITE, LOG_FLICKER, LOG_SKIRT)
ITERATIONS: Final = 60
ACCURACY: Final = 1e-4
"""Gain of the log-likelihood in a step at which a fit ends: an interval is where it has fallen by 1.9."""
LARGEST_STEP: Final = 1.0
"""In half-widths of the hump and nepers."""
QUANTILE_95: Final = 0.5 * float(chi2.ppf(0.95, 1))
"""Fall of the log-likelihood at the ends of a 95 % interval of one parameter (S. S. Wilks 1938): 1.92."""


@dataclass(frozen=True)
class Likelihood:
    """Groups (n,), the start whose floor the prior is centred on, and the spread of the periodogram."""

    groups: Groups
    start: Floats
    spread: float

    def value(self, model: SplitModel) -> float:
        """Log-likelihood less the prior's penalty; -inf where parameters are so far off that the model is no number."""
        with np.errstate(all="ignore"):
            density = model.density(self.groups.f)
            fit = -float(self.groups.count @ (np.log(density) + self.groups.power / density)) / self.spread
            value = fit - 0.5 * float(self._off(model) @ self._off(model))
        return value if np.isfinite(value) else -np.inf

    def step(self, model: SplitModel) -> tuple[Floats, Floats]:
        """Gradient (6,) and Fisher information (6, 6), prior included."""
        density, gradient = model.log_gradient(self.groups.f)
        excess = self.groups.count * (self.groups.power / density - 1) / self.spread
        slope = gradient.T @ excess
        matrix = gradient.T @ ((self.groups.count / self.spread)[:, None] * gradient)
        places = list(FLOOR_TERMS)
        slope[places] -= self._off(model) / LOOSE
        matrix[places, places] += LOOSE**-2
        return slope, matrix

    def _off(self, model: SplitModel) -> Floats:
        places = list(FLOOR_TERMS)
        there = np.isfinite(self.start[places])
        return np.where(there, model.vector[places] - np.where(there, self.start[places], 0.0), 0.0) / LOOSE


@dataclass(frozen=True)
class Fit:
    """A maximum of the likelihood over the ``free`` parameters; value: log-likelihood; deviation (6,): by Fisher
    information, zero where held."""

    model: SplitModel
    value: float
    deviation: Floats
    free: tuple[int, ...]


def free_parameters(hump: bool, q_known: bool, clean_line: bool) -> tuple[int, ...]:
    """Which parameters a fit finds: with or without a hump, Q free or held, with or without a skirt of the line."""
    shape = ((F_Y, LOG_HUMP) if q_known else (F_Y, LOG_Q, LOG_HUMP)) if hump else ()
    return (*shape, LOG_WHITE, LOG_FLICKER) if clean_line else (*shape, *FLOOR_TERMS)


def maximise(likelihood: Likelihood, start: SplitModel, free: tuple[int, ...]) -> Fit:
    """The nearest maximum, by Fisher scoring with Levenberg's damping; -inf where ``start`` has no likelihood."""
    model, value, damping = start, likelihood.value(start), 1e-3
    if not np.isfinite(value):
        return Fit(start, -np.inf, np.zeros(len(start.vector)), free)
    places = np.array(free)
    for _ in range(ITERATIONS):
        slope, matrix = likelihood.step(model)
        scale = _scale(model)[places]
        slope, matrix = slope[places] * scale, matrix[np.ix_(places, places)] * np.outer(scale, scale)
        gain = 0.0
        while damping < 1e8:
            move = _solve(matrix + damping * np.diag(np.diag(matrix) + 1e-9), slope)
            move /= max(1.0, float(np.abs(move).max()) / LARGEST_STEP)
            vector = model.vector
            vector[places] += scale * move
            trial = model.at(vector)
            gain = likelihood.value(trial) - value
            if gain >= 0:
                model, value, damping = trial, value + gain, max(damping / 10, 1e-9)
                break
            damping *= 10
        if gain < ACCURACY:
            break
    return Fit(model, value, _deviation(likelihood, model, places), free)


def profile_interval(likelihood: Likelihood, fit: Fit, parameter: int = F_Y) -> tuple[float, float]:
    """95 % interval of a parameter where the log-likelihood, maximised over all others, has fallen by 1.92.

    An end that lies beyond 30 deviations is infinite: the data do not bound the parameter.
    """
    return _end(likelihood, fit, parameter, -1.0), _end(likelihood, fit, parameter, 1.0)


def profile(likelihood: Likelihood, fit: Fit, places: Floats, parameter: int = F_Y) -> Floats:
    """Fall of the log-likelihood, maximised over all other parameters, with ``parameter`` at ``places`` (n,)."""
    others = tuple(place for place in fit.free if place != parameter)
    fallen = []
    for place in places:
        vector = fit.model.vector
        vector[parameter] = place
        fallen.append(fit.value - maximise(likelihood, fit.model.at(vector), others).value)
    return np.array(fallen)


def _end(likelihood: Likelihood, fit: Fit, parameter: int, side: float) -> float:
    """Newton's steps on the root of the fall, which is nearly a straight line through zero: four come within 1e-3."""
    best, unit = float(fit.model.vector[parameter]), float(fit.deviation[parameter])
    distance = np.sqrt(2 * QUANTILE_95) * unit
    for _ in range(4):
        [fallen] = profile(likelihood, fit, np.array([best + side * distance]), parameter)
        # So far off, or so narrow, that the model is no number: nothing bounds the parameter.
        if not np.isfinite(fallen):
            return side * np.inf
        # The fall of a finite record may level off: then the distance runs away, and that is said.
        distance *= np.sqrt(QUANTILE_95 / max(fallen, 0.1 * QUANTILE_95))
        if not distance < 30 * unit:
            return side * np.inf
    return best + side * float(distance)


def _scale(model: SplitModel) -> Floats:
    """Half-widths for f_y, nepers for the rest."""
    return np.array([model.half_width, 1.0, 1.0, 1.0, 1.0, 1.0])


def _solve(matrix: Floats, slope: Floats) -> Floats:
    try:
        solved: Floats = cho_solve(cho_factor(matrix), slope)
    except LinAlgError:
        solved = slope / np.maximum(np.diag(matrix), np.finfo(float).tiny)
    return solved


def _deviation(likelihood: Likelihood, model: SplitModel, places: np.typing.NDArray[np.int64]) -> Floats:
    deviation = np.zeros(len(model.vector))
    _, matrix = likelihood.step(model)
    scale = _scale(model)[places]
    scaled = matrix[np.ix_(places, places)] * np.outer(scale, scale)
    try:
        variance = np.diag(np.linalg.inv(scaled))
    except np.linalg.LinAlgError:
        variance = np.full(len(places), np.inf)
    deviation[places] = scale * np.sqrt(np.where(variance > 0, variance, np.inf))
    return deviation
