"""The openings of runs: what is plain to see in a part of long runs need not be searched for in the whole.

Each run's first part is one of its own: initial states and what an effect remembers begin as in the whole.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np

from discrepancy.data.record import Record
from discrepancy.fit.continuation import LAST_ROUNDS
from discrepancy.fit.fitted import Fitted
from discrepancy.fit.refit import Fitter

TRIED: Final = 4_000
"""Samples of the shortest openings, all together."""
LEAST: Final = 2_000
"""Samples of a run that an opening has at least: shorter ones show a run's initial state more than any effect, and what
they promise the whole does not keep."""
MOVING: Final = 0.1
"""Mean power of the voltages in openings, over that in whole runs, that shows what they do: 0.4 to 1.2 of seven sets
under tones, and 0.014 to 0.068 below the resonance of five sweeps, which show no friction and no bent spring there."""
LONG: Final = 4
"""By which runs must be longer than their openings, and these than the next shorter ones."""


class Opening(NamedTuple):
    """The openings of runs, or all of them, and the model fitted to these."""

    fitter: Fitter
    at: Fitted

    def of(self, begun: Fitted, goal: float = float("inf"), rounds: int = LAST_ROUNDS) -> Fitted:
        """``begun``, a model of these runs or of longer or shorter ones, fitted to these, as far as it comes near
        ``goal``."""
        return self.fitter.fit(self.fitter.evaluated(replace(begun, whiten=self.at.whiten)), rounds, goal)


def parts(records: Sequence[Record]) -> list[int]:
    """Into how many parts runs are cut for each opening, the shortest first; the last is 1, the whole. Openings in
    which hardly anything moves are none, nor are those of runs with a drift: what was taken out of these is slow over
    the whole alone."""
    if any(record.drift for record in records):
        return [1]
    lengths = [len(r.t) for r in records]
    number, found = min(sum(lengths) // TRIED, min(lengths) // LEAST), []
    while number >= LONG:
        if _power(records, number) >= MOVING * _power(records, 1):
            found.append(number)
        number //= LONG
    return [*found, 1]


def _power(records: Sequence[Record], number: int) -> float:
    """Mean square of the voltages, beside the mean of each run, of the first of so many parts of all."""
    openings = [(record.v - record.v.mean(axis=0))[: len(record.t) // number] for record in records]
    return float(np.mean(np.concatenate(openings) ** 2))


def opened(fitter: Fitter, at: Fitted) -> Opening:
    """``at``, a fit of the whole runs, fitted to their openings, which are the runs of ``fitter``."""
    return Opening(fitter, fitter.fit(fitter.evaluated(at)))
