"""What a search holds: effects on trial, in the model, and taken out of it again."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final, NamedTuple

from discrepancy.criteria import Criteria
from discrepancy.fit.defect import Defect
from discrepancy.fit.fitted import Fitted
from discrepancy.name.columns import Candidate, on_the_way
from discrepancy.name.score import Score

RIVALS: Final = 6
"""At most so many effects are refitted before one is named, or in the place of one."""


@dataclass(frozen=True)
class Accepted:
    """An effect in the model: how it was probed, the share of the residual's square it took, and rivals (parameters by
    id) that fit as well or are as probable; behind: by how much each rival that was refitted fits worse, as a
    chi-square; asked: whether all effects were tried in its place."""

    candidate: Candidate
    share: float
    rivals: dict[str, dict[str, float]]
    behind: dict[str, float] = field(default_factory=dict)
    asked: bool = False

    @property
    def id(self) -> str:
        """The effect's."""
        return self.candidate.effect.id

    @property
    def names(self) -> set[str]:
        """Its parameters."""
        return {q.name for q in self.candidate.effect.parameters}

    @property
    def neutral(self) -> dict[str, float]:
        """What its sizes are where it is absent."""
        return {p.quantity.name: p.quantity.start for p in self.candidate.probes}

    @property
    def of_record(self) -> bool:
        """Whether it is a defect of the record, no effect of the device."""
        return isinstance(self.candidate.effect, Defect)

    @property
    def on_the_way(self) -> bool:
        """Whether it acts on the way of force or voltage: a defect of the record, a delay or a lag."""
        return on_the_way(self.candidate.effect)


class Taken(NamedTuple):
    """A fit with effects that are in the model before anything else is scored, the candidates that they are, and the
    fit without."""

    at: Fitted
    taken: Sequence[Candidate]
    plain: Fitted

    def price(self, criteria: Criteria) -> float:
        """What the fit leaves, and what its effects have to bring, as a chi-square."""
        return self.at.count * self.at.unlikely + criteria.simpler * len(self.taken)


class Refit(NamedTuple):
    """A model with an effect that is on trial in it."""

    at: Fitted
    candidate: Candidate
    score: Score


class Instead(NamedTuple):
    """What was tried in the place of an effect ``beside`` these parameters: the id and the shapes of each, and the fits
    that are near, by id."""

    beside: Mapping[str, float]
    tried: Sequence[tuple[str, Mapping[str, float]]]
    fits: Mapping[str, tuple[Fitted, Candidate]]


class Dropped(NamedTuple):
    """An effect that was accepted and then taken out, and its sizes with their deviations."""

    candidate: Candidate
    sizes: Mapping[str, tuple[float, float]]
    share: float
