"""The library of terms as a model, and how its terms compete to explain what a fit leaves.

The terms are effects beside those of the device, in one FMU that is built once. So a term is scored by what the FMU
shows, as an effect is (``columns.py``, ``score.py``), exactly through the whole chain, and refitted by the same fitter.
The simplest term that fits wins: each coefficient has to earn what the Bayesian information criterion asks (G. Schwarz,
Annals of Statistics 6, 1978), and a higher degree a little more.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Final

import numpy as np

from discrepancy.data.record import MINIMUM_SAMPLES, Floats
from discrepancy.fit.continuation import started
from discrepancy.fit.fitted import Fitted
from discrepancy.fit.refit import Fitter
from discrepancy.name.columns import Candidate, Probe
from discrepancy.name.scan import batched
from discrepancy.name.score import Score, score, without
from discrepancy.terms.effect_file import joined, scales_of
from discrepancy.terms.library import Form, Known, apart, forms, known, magnitude
from gyro_model.anatomy import Effect, Follow, Force
from gyro_model.model import Model

SHORTLIST, SHORT_SHARE = 6, 0.6
"""Terms refitted: at most so many, whose linear share is at least this of the best."""
DEGREE_PRICE: Final = 3.0
"""Chi-square that a term has to gain for each degree and magnitude in it: between two that fit evenly the plainer one
is named. An effect that has a file pays nothing: it is known to exist."""
PROBE: Final = 1e-7
"""Force of a probe over the spring's: at Q = 1e5 it changes the motion by a hundredth, and always by 1e7 roundings."""
BATCH: Final = 80
"""Columns held at a time."""
SCREEN, LEAST = 3, 1000
"""A part of so many of each piece, of that many samples at least, says which terms are worth the whole piece."""
PROMISING, NEAR = 0.1, 0.5
"""Probability there, below which a term is; and share of what effects take, that it has to take in their place. What is
significant in the whole by ``term_chance`` has five deviations there and more, 3.3 in a third: where it moves most, as
here, rather more."""


@dataclass(frozen=True)
class Contestant:
    """A term with its probes and their amplitudes; ``known``: it is an effect of the model."""

    form: Form
    candidate: Candidate
    known: bool
    amplitudes: tuple[float, ...]
    score: Score = field(repr=False)

    @property
    def id(self) -> str:
        """Of the effect that it is."""
        return self.candidate.effect.id


@dataclass(frozen=True)
class Entry:
    """A contestant, refitted."""

    contestant: Contestant
    fitted: Fitted

    def price(self, variance: float) -> float:
        """What its misfit and its complexity come to, as a chi-square."""
        coefficients = len(self.contestant.candidate.probes)
        return (
            self.fitted.cost / variance
            + coefficients * float(np.log(self.fitted.count))
            + DEGREE_PRICE * (0 if self.contestant.known else self.contestant.form.complexity)
        )


@dataclass
class Standing:
    """What terms take from the sum of squares [variances of an innovation] where effects are left out, and what those
    effects take themselves."""

    gain: float
    contestants: list[Contestant]


@lru_cache(maxsize=4)
def _library(model: Model, axes: int) -> tuple[tuple[Form, ...], Mapping[str, Known], Mapping[str, Effect], Model]:
    """The forms; of these, by id, those that an effect of ``model`` is, the others as effects; and the model with all.
    Where such an effect has one size for both axes, the form with two is another."""
    had = known(model, forms(axes))
    freer = (apart(form, had[form.id][1]) for form in forms(axes) if form.id in had)
    own = (*forms(axes), *(form for form in freer if form))
    effects = {form.id: form.effect() for form in own if form.id not in had}
    return own, had, effects, joined(model, effects.values())


class Terms:
    """The model of a fitter with all terms of the library in it, as a context manager."""

    def __init__(self, fitter: Fitter, at: Fitted) -> None:
        """Builds the FMU where that has not been done. ``at``: a fit, which says how large the motion is."""
        self.forms, self.known, self.effects, model = _library(fitter.simulator.model, fitter.axes)
        self.simulator = fitter.simulator.like(model)
        self.scales = scales_of(fitter, at)
        self.spring = at.parameters["kxx"] * self.scales["x"]

    def __enter__(self) -> "Terms":
        return self

    def __exit__(self, *_: object) -> None:
        self.simulator.__exit__(None, None, None)

    def excerpt(self, fitter: Fitter, at: Fitted, samples: int) -> tuple[Fitter, Fitted]:
        """``at`` on a piece of each run, where it moves most, all together at most so many samples, or the shortest
        that there can be: what is missing shows most there. It is the first piece where an effect remembers what went
        before."""
        shortest = min(len(r.t) for r in fitter.records) // MINIMUM_SAMPLES
        number = min(math.ceil(sum(len(r.t) for r in fitter.records) / samples), shortest)
        pieces = [self.simulator.cut(r, number)[: 1 if _remembers(fitter.simulator.model, at) else None]
                  for r in fitter.records]  # fmt: skip
        cut = [max(own, key=lambda p: float(np.mean(p.v**4))) for own in pieces]
        own = Fitter(self.simulator, cut, fitter.blocks, fitter.criteria)
        return own, started(own, at)

    def candidates(self, at: Fitted) -> list[tuple[Form, Candidate]]:
        """Every term that is not fitted in ``at`` already, with both of its parts where both can be seen."""
        fitted = {free.name for free in at.free}
        found = []
        for form in self.forms:
            effect, names = self.known.get(form.id) or (self.effects[form.id], ())
            named = names or tuple(q.name for q in self.effects[form.id].sizes)
            if fitted & set(named):
                continue
            sizes: dict[str, Probe] = {}
            for name, part in zip(named, form.parts, strict=True):
                force = magnitude(part, self.scales)
                if name and force > 0:
                    quantity = next(q for q in effect.sizes if q.name == name)
                    sizes.setdefault(name, Probe(quantity, PROBE * self.spring / force, 1))
            if sizes:
                found.append((form, Candidate(effect, tuple(sizes.values()), {})))
        return found

    def scored(self, fitter: Fitter, at: Fitted) -> list[Contestant]:
        """Every term, largest share first."""
        return self.scans(fitter, at, ())[0].contestants

    def scans(self, fitter: Fitter, at: Fitted, groups: Sequence[Sequence[str]]) -> list[Standing]:
        """Every term beside the fit ``at``, and in the place of each of ``groups`` (ids of effects fitted in it), to
        first order."""
        own = [[q for name in group for q in self.simulator.model.effect(name).parameters] for group in groups]
        removals = [{q.name: q.start for q in sizes if q.role == "size"} for sizes in own]
        names = [set[str](), *({q.name for q in sizes} for sizes in own)]
        found = self.candidates(at)
        if min(len(r.t) for r in fitter.records) >= SCREEN * LEAST:
            part = self.excerpt(fitter, at, math.ceil(sum(len(r.t) for r in fitter.records) / SCREEN))
            found = _promising(found, self._scans(*part, found, removals, names))
            self.simulator.forget(part[0].records)
        return self._scans(fitter, at, found, removals, names)

    def _scans(self, fitter: Fitter, at: Fitted, found: Sequence[tuple[Form, Candidate]],
               removals: Sequence[Mapping[str, float]], names: Sequence[set[str]]) -> list[Standing]:  # fmt: skip
        """``found`` beside the fit, and in the place of the effects whose parameters have each of further ``names``;
        removals: what switches these off."""
        scans, n = [Standing(math.inf, []) for _ in names], len(at.free)
        for batch in batched(found, [len(c.probes) for _, c in found], BATCH):
            linear = fitter.with_grams(at, [*removals, *(changes for _, c in batch for changes in c.changes())])
            assert linear.grams is not None
            for k, (scan, freed) in enumerate(zip(scans, names, strict=True)):
                grams = without(linear.grams, n + k - 1) if k else linear.grams
                beside = [i for i, f in enumerate(at.free) if f.name not in freed]
                if k:
                    scan.gain = score(grams, beside, [i for i in range(n) if i not in beside], at.count).gain
                scan.contestants += self._contestants(batch, grams, beside, n + len(removals), at.count)
        for scan in scans:
            scan.contestants.sort(key=lambda c: -c.score.share)
        return scans

    def _contestants(
        self, batch: Sequence[tuple[Form, Candidate]], grams: Floats, beside: Sequence[int], place: int, count: int
    ) -> list[Contestant]:
        found = []
        for form, candidate in batch:
            columns = range(place, place + len(candidate.probes))
            place += len(columns)
            result = score(grams, beside, columns, count)
            if result.amplitudes:
                found.append(Contestant(form, candidate, form.id in self.known, result.amplitudes, result))
        return found

    def pruned(self, fitter: Fitter, at: Fitted, entry: Entry) -> Entry:
        """The term without those of its parts that do not earn their coefficient; ``at``: the fit before it."""
        while len(entry.contestant.candidate.probes) > 1 and np.isfinite(entry.fitted.cost):
            candidate, parameters = entry.contestant.candidate, entry.fitted.parameters
            deviation = fitter.deviations(entry.fitted)
            surety = {p: abs(parameters[p.quantity.name]) / deviation[p.quantity.name] for p in candidate.probes}
            kept = tuple(p for p in candidate.probes if p != min(surety, key=lambda p: surety[p]))
            sizes = tuple(parameters[p.quantity.name] / p.step for p in kept)
            fewer = replace(entry.contestant, candidate=replace(candidate, probes=kept), amplitudes=sizes)
            less = self.refitted(fitter, at, fewer)
            variance = entry.fitted.variance
            if less.price(variance) >= entry.price(variance):
                break
            entry = less
        return entry

    def refitted(self, fitter: Fitter, at: Fitted, contestant: Contestant, goal: float = math.inf) -> Entry:
        """``at`` with the term in it, as far as it comes near ``goal``, a cost."""
        candidate = contestant.candidate
        sizes = zip(candidate.probes, contestant.amplitudes, strict=True)
        values = {p.quantity.name: p.value(a) for p, a in sizes}
        free = (*at.free, *candidate.free(fitter.period))
        begun = replace(at, parameters={**at.parameters, **values}, free=free)
        return Entry(contestant, fitter.fit(fitter.evaluated(begun), goal=goal))

    def contest(self, fitter: Fitter, at: Fitted) -> list[Entry]:
        """The best terms refitted, lowest price first."""
        scored = self.scored(fitter, at)
        limits = fitter.criteria
        worth = [c for c in scored
                 if c.score.probability < limits.term_chance and c.score.share >= limits.material]  # fmt: skip
        short = [c for c in worth if c.score.share >= SHORT_SHARE * worth[0].score.share][:SHORTLIST]
        entries = ranked([self.refitted(fitter, at, c) for c in short])
        # A part that earns nothing costs its term about a dozen: more than two terms are seldom so close.
        return ranked([self.pruned(fitter, at, e) for e in entries[:2]]) + entries[2:]


def _promising(found: Sequence[tuple[Form, Candidate]], scans: Sequence[Standing]) -> list[tuple[Form, Candidate]]:
    """Those of ``found`` that may count beside the fit or in the place of effects."""
    beside, *instead = scans
    ids = {c.id for c in beside.contestants if c.score.probability < PROMISING}
    ids |= {c.id for scan in instead for c in scan.contestants if c.score.gain > NEAR * scan.gain}
    return [(form, candidate) for form, candidate in found if candidate.effect.id in ids]


def _remembers(model: Model, at: Fitted) -> bool:
    """Whether an effect that is fitted in ``at`` has states of its own, which no piece has free."""
    fitted = {free.name for free in at.free}
    stateful = (e for e in model.effects if isinstance(e, Follow) or e.memories or (isinstance(e, Force) and e.states))
    return any(fitted & {q.name for q in e.parameters} for e in stateful)


def ranked(entries: Sequence[Entry]) -> list[Entry]:
    """Lowest price first."""
    variance = min((e.fitted.variance for e in entries), default=0.0)
    return sorted(entries, key=lambda e: e.price(variance))
