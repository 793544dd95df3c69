"""Scores of all candidates at one fit, and which of them count."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from discrepancy.columns import Candidate
from discrepancy.record import Floats
from discrepancy.refit import Fitted
from discrepancy.score import Score, score

CHANCE: Final = 1e-6
"""Probability of one test by chance at which an effect counts as significant: 60 effects and 400 null sets make 0.02
false alarms; the points of a grid count as tests."""
MATERIAL: Final = 3e-4
"""Share of the residual's square that an effect has to take away to be worth a parameter."""
EVEN: Final = 9.0
"""Chi-square by which a rival may fit worse and still count as not told apart: three standard deviations."""
SIMPLER: Final = 12.0
"""Chi-square that a further size parameter must bring."""

Scored = tuple[Candidate, Score]


@dataclass(frozen=True)
class Scan:
    """Columns of candidates at a fit, after so many ``removals``: columns that take accepted effects out."""

    at: Fitted
    found: tuple[Candidate, ...]
    removals: int

    @property
    def known(self) -> int:
        """Columns of the model itself."""
        return self.at.known

    @property
    def grams(self) -> Floats:
        """As ``Fitted`` has them."""
        assert self.at.grams is not None
        return self.at.grams

    def scores(self, known: Sequence[int], grams: Floats) -> list[Scored]:
        """Of every candidate beside the ``known`` columns; ``grams`` may have another residual."""
        place, scored = self.known + self.removals, []
        for candidate in self.found:
            columns = range(place, place + len(candidate.all_probes))
            place += len(columns)
            result = signed_score(grams, known, columns, candidate, self.at.count)
            if result is not None:
                scored.append((candidate, result))
        return scored


def signed_score(grams: Floats, known: Sequence[int], columns: Sequence[int], candidate: Candidate,
                 count: int) -> Score | None:  # fmt: skip
    """The score of a candidate's columns, those left out that would have to act with a sign that they can't take; None
    where none is left."""
    used = list(range(len(columns)))
    probes = candidate.all_probes
    while used:
        result = score(grams, known, [columns[i] for i in used], count)
        if not result.amplitudes:
            return None
        wrong = [i for i, a in zip(used, result.amplitudes, strict=True) if probes[i].one_sided and a < 0
                 and candidate.partner is None]  # fmt: skip
        if not wrong:
            amplitudes, deviations = np.zeros(len(columns)), np.full(len(columns), np.inf)
            amplitudes[used], deviations[used] = result.amplitudes, result.deviations
            return replace(result, amplitudes=tuple(amplitudes), deviations=tuple(deviations))
        used = [i for i in used if i not in wrong]
    return None


def best_of(scored: Sequence[Scored]) -> list[Scored]:
    """Of each effect the best point of its grid, largest gain first."""
    best: dict[str, Scored] = {}
    for candidate, result in scored:
        before = best.get(candidate.effect.id)
        if before is None or result.gain > before[1].gain:
            best[candidate.effect.id] = (candidate, result)
    return sorted(best.values(), key=lambda entry: SIMPLER * entry[1].freedom - entry[1].gain)


def sure(candidate: Candidate, result: Score) -> bool:
    """Whether an effect is significant, the points of its grid counted as tests."""
    return result.probability * candidate.trials < CHANCE
