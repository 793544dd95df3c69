"""Scores of columns against a residual: Lagrange multiplier tests whose variance comes from blocks."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from scipy.special import chdtrc

from discrepancy.data.algebra import inverse_scaled
from discrepancy.data.record import Floats

TESTABLE: Final = 1e-9
"""Share of a column's square that must be left beside the nominal parameters and states: below, the two are one to the
accuracy of difference quotients (a common gain is one)."""


@dataclass(frozen=True)
class Score:
    """Of one effect: statistic (chi-square with ``freedom``), share of the residual's square that it takes away,
    amplitudes in units of its probes with their standard deviations, ``inflation`` of the variance by blocks over that
    by white innovations, and how far its columns stand ``apart`` from the known ones: the least share of a column's
    square that is left beside them; moves: by how much other parameters go with it, by name [SI]."""

    statistic: float
    freedom: int
    share: float
    amplitudes: tuple[float, ...]
    deviations: tuple[float, ...]
    inflation: float
    apart: float
    moves: Mapping[str, float] = field(default_factory=dict)

    @property
    def probability(self) -> float:
        """Of so large a statistic where the effect is absent."""
        return float(chdtrc(self.freedom, self.statistic))

    @property
    def gain(self) -> float:
        """What it takes from the sum of squares, in variances of an innovation."""
        return self.statistic * self.inflation


NOTHING: Final = Score(0.0, 1, 0.0, (), (), 1.0, 0.0)


@dataclass(frozen=True)
class Step:
    """One step of the search: the best score of every effect (by id) and what was accepted."""

    scores: Mapping[str, Score]
    accepted: str | None


def score(grams: Floats, known: int | Sequence[int], columns: Sequence[int], count: int) -> Score:
    """The score of ``columns`` (indices) beside the ``known`` ones (indices, or the first so many); grams (blocks, p,
    p), the residual last; count: samples in it."""
    beside = list(range(known)) if isinstance(known, int) else list(known)
    own = [*beside, *columns, grams.shape[1] - 1]
    n, k = len(columns), len(beside)
    chosen = grams[:, own][:, :, own]
    total = chosen.sum(axis=0)
    square = np.diag(total)[k : k + n]
    # Columns and residual with their part along the known ones taken out, block by block.
    lift = np.vstack((-inverse_scaled(total[:k, :k]) @ total[:k, k:], np.eye(n + 1)))
    blocks = lift.T @ chosen @ lift
    left = blocks.sum(axis=0)
    usable = [i for i in range(n) if left[i, i] > TESTABLE * square[i] > 0]
    if not usable:
        return NOTHING
    inverse = inverse_scaled(left[np.ix_(usable, usable)])
    slope = left[usable, -1]
    best = inverse @ slope
    gain = float(slope @ best)
    rest = max(left[-1, -1] - gain, 1e-300)
    variance = rest / max(count - k - len(usable), 1)
    scores = blocks[:, usable, -1] - np.einsum("bij,j->bi", blocks[:, usable][:, :, usable], best)
    spread = scores.T @ scores * (len(scores) / max(len(scores) - len(usable), 1))
    # The larger of both variances, as one factor: a colour of the residual must not make an effect surer.
    inflation = max(1.0, float(np.linalg.eigvals(inverse @ spread).real.max()) / variance)
    amplitudes, deviations = np.zeros(n), np.full(n, np.inf)
    amplitudes[usable] = best
    deviations[usable] = np.sqrt(np.diag(inverse) * variance * inflation)
    share = gain / max(left[-1, -1], 1e-300)
    apart = min(float(left[i, i] / square[i]) for i in usable)
    return Score(
        gain / (variance * inflation), len(usable), share, tuple(amplitudes), tuple(deviations), inflation, apart
    )


def taken_up(total: Floats, known: Sequence[int], columns: Sequence[int], amplitudes: Sequence[float]) -> Floats:
    """How far the ``known`` columns go with ``amplitudes`` of others, in their steps; total (p, p): the grams' sum."""
    rest = total[known, -1] - total[np.ix_(known, columns)] @ np.asarray(amplitudes)
    return np.asarray(inverse_scaled(total[np.ix_(known, known)]) @ rest)


def without(grams: Floats, removal: int) -> Floats:
    """``grams`` with the residual as it would be without an effect; removal: the column that takes the effect out."""
    result = grams.copy()
    result[:, :, -1] -= result[:, :, removal]
    result[:, -1, :] -= result[:, removal, :]
    return result
