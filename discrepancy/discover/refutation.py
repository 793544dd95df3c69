"""Whether terms of the library speak against effects that were named."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from discrepancy.discover.contest import Standing, Terms, ranked
from discrepancy.fit.fitted import Fitted
from discrepancy.fit.refit import Fitter
from gyro_model.progress import Steps

CHECKED: Final = 16_000
"""Samples on which a name is checked, shared by the runs."""
NEARLY, CLOSEST = 0.05, 3
"""A name is checked against at most so many terms, which to first order take all but this share of what it takes."""


@dataclass(frozen=True)
class Rivals:
    """What speaks against names. instead: by the ids of the effects left out, the term that fits significantly better
    in their place; beside: terms that explain something significant and material besides."""

    instead: Mapping[tuple[str, ...], str]
    beside: Mapping[str, float]

    @property
    def refuted(self) -> bool:
        """Whether some name is wrong."""
        return bool(self.instead)

    @property
    def names(self) -> list[str]:
        """The wrong ones."""
        return list(dict.fromkeys(name for group in self.instead for name in group))


def rivals(fitter: Fitter, at: Fitted, named: Sequence[str], progress: Steps | None = None) -> Rivals:
    """Whether terms of the library speak against the effects ``named`` (ids) that are fitted in ``at``.

    All effects together are left out, the rest is refitted, and the library's terms compete for their place; where no
    term does better than all of them, each is left out alone. To be called when no further effect is found: what is
    missing besides may look like anything.
    """
    tell = progress or (lambda _: None)
    tell("terms against names")
    instead: dict[tuple[str, ...], str] = {}
    groups = ([tuple(named)] if len(named) > 1 else []) + [(name,) for name in named]
    with Terms(fitter, at) as terms:
        short, begun = terms.excerpt(fitter, at, CHECKED)
        full = short.fit(begun, rounds=3)
        rest, *standings = terms.scans(short, full, groups)
        limits = fitter.criteria
        beside = {c.form.text: c.score.share for c in rest.contestants
                  if c.score.probability < limits.term_chance and c.score.share >= limits.material}  # fmt: skip
        for group, standing in zip(groups, standings, strict=True):
            best = _in_place(terms, short, full, group, standing)
            if best is not None:
                instead[group] = best
                if len(group) > 1:
                    break
    return Rivals(instead, beside)


def _in_place(terms: Terms, fitter: Fitter, full: Fitted, group: Sequence[str], standing: Standing) -> str | None:
    """The term that fits better than the effects of ``group``, refitted."""
    close = [c for c in standing.contestants if c.id not in group and c.score.gain > (1 - NEARLY) * standing.gain]
    if not close:
        return None
    # The rest is fitted with the term in it: without either, the motion may be far from the measured one.
    less = _switched_off(fitter, full, group)
    price = (len(full.free) - len(less.free)) * float(np.log(full.count))
    goal = full.cost + price * full.variance
    best = ranked([terms.refitted(fitter, less, c, goal) for c in close[:CLOSEST]])[0]
    variance = best.fitted.variance
    if best.price(variance) + fitter.criteria.even < full.cost / variance + price:
        return best.contestant.form.text
    return None


def without(fitter: Fitter, at: Fitted, ids: Sequence[str]) -> Fitted:
    """``at`` refitted with the effects ``ids`` switched off."""
    return fitter.fit(_switched_off(fitter, at, ids))


def _switched_off(fitter: Fitter, at: Fitted, ids: Sequence[str]) -> Fitted:
    own = [q for effect in ids for q in fitter.simulator.model.effect(effect).parameters]
    off, names = {q.name: q.start for q in own if q.role == "size"}, {q.name for q in own}
    free = tuple(f for f in at.free if f.name not in names)
    return fitter.evaluated(replace(at, parameters={**at.parameters, **off}, free=free))
