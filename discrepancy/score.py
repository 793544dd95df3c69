"""Scores of columns against a residual: Lagrange multiplier tests whose variance comes from blocks."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.stats import chi2

from discrepancy.record import Floats
from discrepancy.refit import inverse_scaled

TESTABLE: Final = 1e-6
"""Share of a column's square that must be left beside the nominal parameters and states: below, the two are one to the
accuracy of difference quotients of 1e-3 (a common gain is one)."""


@dataclass(frozen=True)
class Score:
    """Of one effect: statistic (chi-square with ``freedom``), share of the residual's square that it takes away,
    amplitudes in units of its probes with their standard deviations, what is left of each column [V rms sum],
    ``inflation`` of the variance by blocks over that by white innovations."""

    statistic: float
    freedom: int
    share: float
    amplitudes: tuple[float, ...]
    deviations: tuple[float, ...]
    inflation: float

    @property
    def probability(self) -> float:
        """Of so large a statistic where the effect is absent."""
        return float(chi2.sf(self.statistic, self.freedom))


NOTHING: Final = Score(0.0, 1, 0.0, (), (), 1.0)


def score(grams: Floats, known: int, columns: tuple[int, ...], count: int) -> Score:
    """The score of ``columns`` (indices) beside the first ``known`` ones; grams (blocks, p, p), the residual last."""
    total = grams.sum(axis=0)
    own = list(columns)
    square = total[own, own]
    fill = -inverse_scaled(total[:known, :known]) @ total[:known][:, [*own, -1]]
    # Columns and residual with their part along the known ones taken out, block by block.
    lift = np.zeros((total.shape[0], len(own) + 1))
    lift[:known] = fill
    lift[[*own, total.shape[0] - 1], range(len(own) + 1)] = 1.0
    blocks = np.einsum("pi,bpq,qj->bij", lift, grams, lift, optimize=True)
    left = blocks.sum(axis=0)
    usable = [i for i in range(len(own)) if left[i, i] > TESTABLE * square[i] > 0]
    if not usable:
        return NOTHING
    information = left[np.ix_(usable, usable)]
    inverse = inverse_scaled(information)
    slope = left[usable, -1]
    best = inverse @ slope
    gain = float(slope @ best)
    rest = max(left[-1, -1] - gain, 1e-300)
    variance = rest / max(count - known - len(usable), 1)
    scores = blocks[:, usable, -1] - np.einsum("bij,j->bi", blocks[:, usable][:, :, usable], best)
    spread = scores.T @ scores * (len(scores) / max(len(scores) - len(usable), 1))
    # The larger of both variances, as one factor: a colour of the residual must not make an effect surer.
    inflation = max(1.0, float(np.linalg.eigvals(inverse @ spread).real.max()) / variance)
    deviations = np.sqrt(np.diag(inverse) * variance * inflation)
    amplitudes, sizes = np.zeros(len(own)), np.full(len(own), np.inf)
    amplitudes[usable], sizes[usable] = best, deviations
    share = gain / max(left[-1, -1], 1e-300)
    return Score(gain / (variance * inflation), len(usable), share, tuple(amplitudes), tuple(sizes), inflation)
