"""A fitted model as data: what is free, and what a fit knows."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from discrepancy.data.record import Floats
from discrepancy.fit.whitening import Whitener


@dataclass(frozen=True)
class Free:
    """A parameter to fit: ``step`` of its difference quotient, bounds; SI. ``factor``: a positive one is changed by at
    most so much at once; ``against``: a parameter that moves the other way, so that their sum stays."""

    name: str
    step: float
    low: float = -np.inf
    high: float = np.inf
    factor: float = np.inf
    against: str = ""

    def at(self, value: float, parameters: Mapping[str, float]) -> dict[str, float]:
        """What changes of ``parameters`` where this one is ``value``."""
        if not self.against:
            return {self.name: value}
        return {self.name: value, self.against: parameters[self.against] + parameters[self.name] - value}

    def bounded(self, before: float, after: float) -> float:
        """``after``, or how far the parameter may go on its way there."""
        low, high = self.low, self.high
        if self.factor < np.inf:
            low, high = max(low, before / self.factor), min(high, before * self.factor)
        return float(np.clip(after, low, high))


@dataclass(frozen=True)
class Fitted:
    """A model fitted to runs.

    parameters: shared ones by name; starts: initial states of each run. cost: sum of squared innovations [V²], count of
    them. Of the last linearisation, if there is one: grams (blocks, p, p) of [free, further columns, residual] as
    innovations with the states projected out; fill, by run (states, p): the change of the states, in their steps, that
    goes with each; left: what a further step would take from the cost, in variances of an innovation.
    """

    parameters: Mapping[str, float]
    starts: tuple[Mapping[str, float], ...]
    free: tuple[Free, ...]
    whiten: Whitener
    residuals: tuple[Floats, ...] = field(repr=False)
    cost: float = np.inf
    count: int = 1
    grams: Floats | None = field(default=None, repr=False)
    fill: tuple[Floats, ...] = field(default=(), repr=False)
    left: float = np.inf

    @property
    def unlikely(self) -> float:
        """Twice the negative log likelihood of the residuals, a sample: innovations alone do not tell two fits apart
        that are whitened by different filters, since a strong one leaves little of anything."""
        logs = sum(self.whiten.log_determinants(len(residual)) for residual in self.residuals)
        return float(np.log(self.variance)) - 2 * logs / self.count

    @property
    def variance(self) -> float:
        """Mean square of an innovation [V²]."""
        return self.cost / self.count

    @property
    def known(self) -> int:
        """How many columns of the grams are the model's own: those before any further ones."""
        return len(self.free)


def bare(at: Fitted) -> Fitted:
    """``at`` without its linearisation."""
    return replace(at, grams=None, fill=(), left=np.inf)
