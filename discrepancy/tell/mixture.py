"""Mixtures of normal distributions, and their quantiles."""

from collections.abc import Sequence
from functools import partial
from typing import Final, NamedTuple

import numpy as np
from scipy.optimize import brentq
from scipy.stats import norm

from discrepancy.data.record import Floats

TAIL: Final = 0.025
"""Beyond either end of a 95 % interval."""
PLACES: Final = 50
"""Over a factor of ABOUT both ways, that are weighed: 7 % from one to the next, little beside what data tell of what
they do not show."""
FAR: Final = 8.0
"""Standard deviations beyond all means, where a quantile is sought: TAIL lies within."""
NEAR: Final = 1e-6
"""Of that range, by which a quantile may be off."""


class Mixture(NamedTuple):
    """Normal distributions: weight, mean, deviation of each."""

    weights: Floats
    means: Floats
    deviations: Floats

    def quantile(self, share: float) -> float:
        """Below which so much of it lies."""
        far = FAR * self.deviations
        ends = float((self.means - far).min()), float((self.means + far).max())
        return float(brentq(partial(self._below, share), *ends, xtol=NEAR * (ends[1] - ends[0])))

    def _below(self, share: float, x: float) -> float:
        return float(self.weights @ norm.cdf((x - self.means) / self.deviations)) - share

    @property
    def ends(self) -> tuple[float, float]:
        """Of the 95 % interval."""
        return self.quantile(TAIL), self.quantile(1 - TAIL)


def joined(parts: Sequence[Mixture]) -> Mixture:
    """One mixture of several, whose weights are logarithms."""
    logs, means, deviations = (np.concatenate(column) for column in zip(*parts, strict=True))
    weights = np.exp(logs - logs.max())
    return Mixture(weights / weights.sum(), means, deviations)
