"""Scores of all candidates at one fit, and which of them count."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from discrepancy.criteria import Criteria
from discrepancy.data.record import Floats
from discrepancy.fit.fitted import Fitted
from discrepancy.fit.refit import Fitter
from discrepancy.name.columns import Candidate
from discrepancy.name.score import Score, score, taken_up, without

HELD, FEWEST = 50_000_000, 8
"""Bytes of columns of a run that a scan holds at a time, and columns at least: beyond, it goes in batches."""

Item = TypeVar("Item")
Scored = tuple[Candidate, Score]
Batch = tuple[Fitted, tuple[Candidate, ...]]


@dataclass(frozen=True)
class Scan:
    """Columns of candidates at a fit, in ``batches`` that each stand beside the model's own columns and the
    ``removals``: those that take accepted effects out."""

    batches: tuple[Batch, ...]
    removals: int

    @property
    def at(self) -> Fitted:
        """The fit, linearised."""
        return self.batches[0][0]

    def grams(self, at: Fitted, removal: int | None = None) -> Floats:
        """Of a batch; with the residual as it would be without the accepted effect of that number."""
        assert at.grams is not None
        return at.grams if removal is None else without(at.grams, at.known + removal)

    def scores(self, known: Sequence[int] | None = None, removal: int | None = None) -> list[Scored]:
        """Of every candidate beside the ``known`` columns, by default all of the model's own."""
        beside, scored = list(range(self.at.known) if known is None else known), []
        for at, found in self.batches:
            grams, place = self.grams(at, removal), at.known + self.removals
            total = grams.sum(axis=0)
            for candidate in found:
                columns = range(place, place + len(candidate.all_probes))
                place += len(columns)
                result = signed_score(grams, beside, columns, candidate, at.count)
                if result is not None:
                    steps = taken_up(total, beside, columns, result.amplitudes) if result.amplitudes else ()
                    own = [at.free[i] for i in beside]
                    moves = {free.name: float(s) * free.step for free, s in zip(own, steps, strict=False)}
                    scored.append((candidate, replace(result, moves=moves)))
        return scored

    def together(self, candidate: Candidate) -> float:
        """The largest share of the residual's square that a candidate takes with another effect, each of them with
        signs that it can take; 0 where it stands in no batch with others."""
        for at, found in self.batches:
            ends = at.known + self.removals + np.cumsum([0, *(len(c.all_probes) for c in found)])
            columns = {i: range(ends[i], ends[i + 1]) for i in range(len(found))}
            own = next((i for i, c in enumerate(found) if c == candidate), None)
            if own is not None:
                others = [i for i, c in enumerate(found) if c.effect.id != candidate.effect.id]
                pairs = [(replace(candidate, probes=(*candidate.all_probes, *found[i].all_probes), partner=None),
                          [*columns[own], *columns[i]]) for i in others]  # fmt: skip
                scores = [signed_score(self.grams(at), range(at.known), both, pair, at.count) for pair, both in pairs]
                return max((s.share for s in scores if s is not None), default=0.0)
        return 0.0


def scanned(fitter: Fitter, at: Fitted, removals: Sequence[Mapping[str, float]], found: Sequence[Candidate]) -> Scan:
    """The columns of ``found`` at a fit; removals: parameters that take each accepted effect out."""
    longest = max(record.v.nbytes for record in fitter.records)
    most = max(FEWEST, HELD // longest)

    def linear(batch: Sequence[Candidate]) -> Fitted:
        return fitter.with_grams(at, [*removals, *(change for c in batch for change in c.changes())])

    parts = batched(found, [len(c.all_probes) for c in found], most) or [()]
    return Scan(tuple((linear(part), part) for part in parts), len(removals))


def batched(items: Sequence[Item], columns: Sequence[int], most: int) -> list[tuple[Item, ...]]:
    """``items`` in batches, each of at most so many ``columns`` (those of each item) or of one item."""
    batches: list[tuple[Item, ...]] = []
    held = 0
    for item, own in zip(items, columns, strict=True):
        if not batches or held + own > most:
            batches.append(())
            held = 0
        batches[-1] += (item,)
        held += own
    return batches


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


def best_of(scored: Sequence[Scored], criteria: Criteria) -> list[Scored]:
    """Of each effect the best point of its grid, largest gain first. Of points within chance of the best it is the one
    that the model imitates least: far along a ridge, as where a film's gap is so wide that it is a linear damper, a
    size has no meaning, and no fit begins there."""
    points: dict[str, list[Scored]] = {}
    for candidate, result in scored:
        points.setdefault(candidate.effect.id, []).append((candidate, result))
    best = [_surest(own) for own in points.values()]
    return sorted(best, key=lambda entry: criteria.simpler * entry[1].freedom - entry[1].gain)


def _surest(points: Sequence[Scored]) -> Scored:
    top = max(points, key=lambda entry: entry[1].gain)[1]
    return max((p for p in points if p[1].gain >= top.gain - top.inflation), key=lambda entry: entry[1].apart)


def next_peaks(best: Candidate, scored: Sequence[Scored]) -> list[Scored]:
    """Of a grid whose best point is ``best``, the maxima but the highest, largest gain first: columns of a resonance
    far from where it is may explain as much, to first order."""
    own = [e for e in scored if e[0].effect.id == best.effect.id and e[0].partner == best.partner]
    coarse = min((c.trials for c, _ in own), default=0)
    grid = [e for e in own if e[0].trials == coarse]
    gains = [-np.inf, *(s.gain for _, s in grid), -np.inf]
    peaks = [e for e, left, here, right in zip(grid, gains, gains[1:], gains[2:], strict=False) if left < here >= right]
    return sorted(peaks, key=lambda e: -e[1].gain)[1:]


def other_forms(best: Candidate, scored: Sequence[Scored]) -> list[Scored]:
    """Of an effect with whole numbers among its shapes, the points with others than those of ``best``: to first order
    they may be alike."""
    whole = [q.name for q in best.effect.parameters if q.role == "shape" and q.integer]
    return [e for e in scored if e[0].effect.id == best.effect.id and e[0].partner == best.partner
            and any(e[0].shapes.get(name) != best.shapes.get(name) for name in whole)]  # fmt: skip


def sure(candidate: Candidate, result: Score, criteria: Criteria) -> bool:
    """Whether an effect is significant, the points of its grid counted as tests."""
    return result.probability * candidate.trials < criteria.effect_chance
