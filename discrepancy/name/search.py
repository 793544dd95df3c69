"""The search for effects that a model lacks: score all, refit the best, accept, repeat, then question each again."""

from collections.abc import Callable, Mapping, Sequence
from copy import copy
from dataclasses import replace
from functools import partial
from math import inf
from typing import Any, Final, NamedTuple, TypeVar

from scipy.stats import chi2

from discrepancy.clock import OutOfTime
from discrepancy.criteria import Criteria
from discrepancy.data.dataset import Dataset
from discrepancy.data.late import lateness
from discrepancy.data.modes import Mode
from discrepancy.data.record import Hold
from discrepancy.fit.continuation import ROUNDS, beginnings, nearly_settled, roughly_settled, settled, unsprung
from discrepancy.fit.defect import Blemish, Data, Found, Level, effect_of
from discrepancy.fit.fitted import Fitted, Free
from discrepancy.fit.limits import masked
from discrepancy.fit.openings import Opening, opened, parts
from discrepancy.fit.refit import DEFAULT, Fitter
from discrepancy.fit.simulate import Simulator
from discrepancy.name import checkpoint as store
from discrepancy.name.accepted import RIVALS, Accepted, Dropped, Instead, Refit, Taken
from discrepancy.name.bending import bending
from discrepancy.name.cleaning import clean, mask_clipped
from discrepancy.name.columns import (
    Candidate,
    Kind,
    Library,
    Probes,
    Silent,
    finer,
    nameable,
    on_the_way,
)
from discrepancy.name.competition import best_refit, longer, near, own_filter, refitted, rivals, weak
from discrepancy.name.exchange import delete, exchange, fade
from discrepancy.name.holding import let_run_on
from discrepancy.name.more_modes import Copy
from discrepancy.name.question import ask
from discrepancy.name.resisting import alike, resisting
from discrepancy.name.resonating import resonating
from discrepancy.name.scan import Scan, Scored, best_of, scanned, sure
from discrepancy.name.score import Score, Step
from discrepancy.name.shaping import movable, shaped
from discrepancy.terms.effect_file import Term
from gyro_model.anatomy import Delay
from gyro_model.errors import InputError
from gyro_model.progress import Steps

FINEST: Final = 70
"""Trials of a grid after which it is not refined further: resonances are then as sharp as Q = 640."""

BEGIN, NAME, QUESTION = 0.35, 0.8, 0.9
"""Shares of the time after which the nominal model is left as it is, nothing further is named, no name questioned."""

FIRST: Final = "effects without which a linear fit goes astray"

Settle = Callable[[Fitter, Fitted], tuple[Fitter, Fitted]]
Result = TypeVar("Result")


class Look(NamedTuple):
    """What decides the scores of candidates: where they are looked for, and beside what."""

    library: Library
    fitter: Fitter
    at: Fitted
    among: Kind | None
    present: Sequence[str]
    neutral: Sequence[Mapping[str, float]]

    def same(self, other: "Look") -> bool:
        """Whether scores are the same; a fit is the same only if it is one object."""
        places = zip(self[:4], other[:4], strict=True)
        return all(a is b for a, b in places) and (self.present, self.neutral) == (other.present, other.neutral)


class Search:
    """The state of a search: what is accepted, and the model fitted with it (``at``, over the runs of ``fitter``);
    ``terms``: by further search, what it added to the model; ``modes``: those that the runs show, one an axis and
    further ones; ``copies``: effects that wait for others; ``refuted``: ids of those in the model in whose place a term
    fits better that there was no time to take in."""

    def __init__(
        self,
        simulator: Simulator,
        dataset: Dataset,
        progress: Steps,
        terms: Sequence[tuple[Term, ...]] = (),
        criteria: Criteria = DEFAULT,
    ) -> None:
        self.criteria = criteria
        self.simulator, self.progress, self.terms = simulator, progress, list(terms)
        self.at: Fitted
        self.fitter: Fitter
        self.keep: Callable[[Mapping[str, Any]], None] | None = None
        self.refitted_state: Mapping[str, Any] | None = None
        self.copies: Mapping[str, Copy] = {}
        self.modes: tuple[list[Mode], list[Mode]] = [], []
        self.clip: float | None = None
        self.measured = dataset
        self.found: list[tuple[Blemish, Found]] = []
        self.dropped: list[Dropped] = []
        self.undone: list[str] = []
        self.full = self.questioned = self.offered = False
        self.weak = 0.0
        self.waiting: list[Refit] = []
        self.shortest, self.number = parts(dataset.fit)[0], 1
        self.probes: Probes = {}
        self.silent: Silent = {}
        self.instead: Mapping[str, Instead] = {}
        self._take(dataset)
        noise = {q.name for e in simulator.model.effects if e.noise for q in e.sizes}
        self.nominal = {name: value for name, value in dataset.nominal.items() if name not in noise}
        self.accepted: list[Accepted] = []
        self.refused: set[str] = set()
        self.refuted: set[str] = set()
        self.scored: list[Scored] = []
        self.looked: Look | None = None
        self.steps: list[Step] = []
        self.stages: list[tuple[str, dict[str, float]]] = [("nominal", dict(self.nominal))]

    def attempt(self, what: str, work: Callable[[], Result]) -> Result | None:
        """What ``work`` gives; where the time ends within it all is as it was before, and ``what`` is noted as not
        done."""
        before = self._kept()
        try:
            self.simulator.clock.check()
            return work()
        except OutOfTime:
            vars(self).update(before)
            self.undone.append(what)
            self.progress(f"out of time: {what}")
            return None

    def _kept(self) -> dict[str, Any]:
        return {name: copy(own) if isinstance(own, list | set) else own for name, own in vars(self).items()}

    def _until(self, share: float) -> None:
        self.simulator.clock.until = share * self.criteria.time_limit

    def _take(self, dataset: Dataset) -> None:
        self.dataset = dataset
        self.whole = Fitter(self.simulator, dataset.fit, criteria=self.criteria)
        if self.refitted_state:
            self.refitted_state = store.on_other_data(self.whole, self.refitted_state)
        self._open(self.number)

    def _open(self, number: int) -> None:
        """Looks for effects in the first of ``number`` parts of each run from now on, by the probes that are known."""
        self.number = number
        self.opening = self.whole if number == 1 else beginnings(self.whole, number)
        self.library = Library(self.opening, self.probes, self.silent)

    def take_clipped(self, level: float) -> None:
        self.clip = level
        self._take(replace(self.dataset, records=tuple(masked(record, level) for record in self.dataset.records)))

    def take_hold(self, hold: Hold) -> None:
        """Goes on with forces that ran so between samples."""
        self._take(replace(self.dataset, records=tuple(replace(r, hold=hold) for r in self.dataset.records)))

    def take_blemish(self, blemish: Blemish, data: Sequence[Data]) -> None:
        """Goes on with the runs to fit without what ``data`` say."""
        cleaned = dict(zip((r.name for r in self.dataset.fit), data, strict=True))
        records = tuple(blemish.without(r, cleaned[r.name]) if cleaned.get(r.name) else r for r in self.dataset.records)
        self._take(replace(self.dataset, records=records))

    def begin(self, state: Mapping[str, Any] | None = None) -> None:
        """Fits the nominal model, or takes up a kept ``state``, whose entries are checked. Raises InputError where the
        state's fit is not one of these runs."""
        if state is None:
            self.progress("nominal parameters and initial states")
            late = lateness(self.dataset.fit, self.nominal)
            shown_by = late.records if late else None
            self.fitter, self.at = self.whole, self.whole.begin(self.nominal, self._believed(), shown_by)
            self.refitted = self.at
            self._until(BEGIN)
            if late:
                self._stage("refit")
                self.refitted_state = store.fit_state(self.whole, self.whole, self.refitted)
                self._take_delay(late.delay)
            else:
                kinds: tuple[Callable[[Search], Taken | None], ...]
                kinds = (resisting,) if unsprung(self.whole, self.at) else (resonating, bending)
                found = (self.attempt(FIRST, partial(kind, self)) for kind in kinds)
                self._take_in_first(next((own for own in found if own), None))
            early = len(self.accepted)
            # Long runs are fitted once more before they are looked at as a whole.
            self._go_on_or_keep(self.at, roughly_settled if self.shortest > 1 else settled)
            self._until(NAME)
            self.attempt("defects of single samples", self._tidy)
            if early:
                self._stage(self.accepted[-1].id)
            else:
                self.refitted = self.at
                self._stage("refit")
            self._save()
        else:
            self._restore(state)
            self._until(NAME)
            self.progress(f"resumed with {', '.join(a.id for a in self.accepted) or 'nominal parameters fitted'}")

    def _take_delay(self, delay: float) -> None:
        """Takes a delay [s] into the model before anything is fitted: nothing would stay in step without it."""
        [candidate] = self.library.candidates(self.whole, self.at, self.present, lambda e: isinstance(e, Delay))
        [probe] = candidate.probes
        own = {**self.at.parameters, probe.quantity.name: min(delay, probe.quantity.high)}
        free = (*self.at.free, *candidate.free(self.whole.period))
        delayed = self.whole.evaluated(replace(self.at, parameters=own, free=free))
        self.accepted.append(Accepted(candidate, 1 - delayed.cost / self.at.cost, {}))
        self.steps.append(Step({}, candidate.effect.id))
        self.progress(f"accepted {candidate.effect.id}: without it no model stays in step")
        self.at = delayed

    def _take_in_first(self, found: Taken | None) -> None:
        """Takes effects into the model before anything else is scored, without which the linear parameters go astray,
        so that all else would imitate what they do."""
        if found is None:
            return
        self.refitted = found.plain
        self._stage_of("refit", found.plain)
        self.refitted_state = store.fit_state(self.whole, self.whole, found.plain)
        for own in found.taken:
            self.accepted.append(Accepted(own, max(1 - found.at.cost / found.plain.cost, 0.0), {}))
            self.steps.append(Step({}, own.effect.id))
            self.progress(f"accepted {own.effect.id}: without it the linear model goes astray")
        self.at = found.at

    def _tidy(self) -> None:
        """Takes out of the record what the present model shows to be none of the device's."""
        let_run_on(self)
        mask_clipped(self)
        clean(self)

    def _give_up(self, wrong: Sequence[str]) -> None:
        """Takes effects out of the model for good."""
        for entry in [a for a in self.accepted if a.id in wrong]:
            self.progress(f"gave up {entry.id}: another term fits better in its place")
            self.accepted.remove(entry)
            self.at = self.without_effect(self.at, entry)
        self.refused |= set(wrong)

    def widen(self, simulator: Simulator, terms: tuple[Term, ...], wrong: Sequence[str]) -> bool:
        """Goes on without the effects ``wrong``, with the model of ``simulator``: the present one and the effects of
        ``terms``. Raises OutOfTime."""
        self._give_up(wrong)
        self.simulator = simulator
        self.terms.append(terms)
        self.shortest = parts(self.dataset.fit)[0]
        self._take(self.dataset)
        self.go_on(self.at)
        self.weak, self.waiting, self.offered = 0.0, [], True
        if wrong and terms:
            self.attempt(f"refit with {terms[0].id}", partial(self._take_in, terms[0]))
        self._save()
        return True

    def _take_in(self, term: Term) -> None:
        """Takes in a term that was found in the place of a name: it has held its own against all others, over more than
        the shortest openings."""
        self.shortest = 1
        self.look(lambda effect: effect.id == term.id)
        if self._accept(patient=False):
            self._stage(term.id)
        self.shortest = parts(self.dataset.fit)[0]

    @property
    def in_vain(self) -> bool:
        """Whether the last further search added what was not accepted."""
        last = self.terms[-1] if self.terms else ()
        return bool(last) and not {term.id for term in last} & {a.id for a in self.accepted}

    @property
    def astray(self) -> tuple[int, float]:
        """How far the present fit is from the motion: pieces that it needs to stay in step, and residual over signal,
        which is less in shorter ones."""
        return len(self.fitter.records), self.fitter.off(self.at)

    @property
    def late(self) -> bool:
        """Whether the time for the present part is used up."""
        return self.simulator.clock.late

    def finish(self, max_effects: int) -> None:
        """Questions all that was accepted, as far as the time goes."""
        for place in range(len(self.accepted)):
            self.attempt(f"refit without a part of {self.accepted[place].id}", partial(fade, self, place))
        if self.terms:
            # A term in no file may make a name needless: first each is held against the others.
            exchange(self)
            delete(self)
        else:
            delete(self)
            exchange(self)

    def extend(self, max_effects: int, *, patient: bool = False) -> None:
        """Accepts effects until none is worth it, or, being ``patient``, until the best is ``weak``, called again from
        the one after it: those that short openings of the runs show, then those that longer ones do, at last the
        whole."""
        while True:
            self.full = len(self.accepted) >= max_effects
            self.shortest = 1 if self.full else self.shortest
            if self.shortest == 1 and self.number > 1:
                self._go_on_or_keep(self.at)
            refused = bool(self.waiting)
            if not refused:
                self.attempt("scores of all effects", self.look)
                if movable(self) and self.attempt("shapes of effects in the model", partial(shaped, self)):
                    continue
            self.weak = 0.0
            if self.late or self.full:
                break
            accepted = self.attempt(self._next(), partial(self._accept, patient=patient and not refused))
            if self.weak:
                return
            if accepted is False and self.number == 1:
                accepted = self.attempt("effects behind a noise of the motion", self._accept_behind_noise)
            if accepted is None or (not accepted and self.number == 1):
                break
            if not accepted:
                self.shortest = self._fewer_parts()
                continue
            if any(a.on_the_way for a in self.accepted[:-1]):
                # Filters and delays differ by little, which shows only beside what else is missing.
                exchange(self, on_the_way)
                delete(self, on_the_way)
            self._stage(self.accepted[-1].id)
            self.attempt("defects of single samples", self._tidy)
            self._save()
        self.steps.append(Step({c.effect.id: s for c, s in best_of(self.scored, self.criteria)}, None))

    def _fewer_parts(self) -> int:
        """Into how many parts runs are cut for longer openings, of which the present ones let expect that something
        material is sure; 1, the whole, where none are."""
        fewer = [n for n in parts(self.dataset.fit) if n < self.number]
        material = [(c, s) for c, s in self.scored if s.share >= self.criteria.material]

        def expected(number: int) -> bool:
            grown = [(c, replace(s, statistic=s.statistic * self.number / number)) for c, s in material]
            return any(sure(c, s, self.criteria) for c, s in grown)

        return next(filter(expected, fewer), 1)

    def _save(self) -> None:
        """Hands out the state, and goes on from what a resumed search would have."""
        if self.keep is None:
            return
        clock = self.simulator.clock
        until, clock.until = clock.until, float("inf")
        state = {
            "terms": store.terms_state(self.terms),
            "refused": sorted(self.refused),
            "clip": self.clip,
            "hold": self.dataset.records[0].hold,
            "blemishes": [
                [b.id, list(map(list, f.data)), {k: list(v) for k, v in f.levels.items()}] for b, f in self.found
            ],
            "at": store.fit_state(self.whole, self.fitter, self.at),
            "refitted": self.refitted_state or store.fit_state(self.whole, self.fitter, self.refitted),
            "accepted": [[store.candidate_state(a.candidate), a.share] for a in self.accepted],
            "steps": [store.step_state(step) for step in self.steps],
            "stages": self.stages,
            "shortest": self.shortest,
            "opening": self.number,
            "offered": int(self.offered),
            "probes": store.probes_state(self.probes),
        }
        self.keep(state)
        self._restore(state)
        clock.until = until

    def _restore(self, state: Mapping[str, Any]) -> None:
        model = self.simulator.model
        if state["hold"] != self.dataset.records[0].hold:
            self.take_hold(state["hold"])
        if state["clip"] is not None and self.clip is None:
            self.take_clipped(state["clip"])
        for name, data, levels in state["blemishes"][len(self.found) :]:
            blemish = effect_of(model, name)
            if not isinstance(blemish, Blemish) or len(data) != len(self.dataset.fit):
                raise InputError(f"blemish {name}: give numbers for each of {len(self.dataset.fit)} runs")
            found = Found(tuple(map(tuple, data)), {k: Level(*v) for k, v in levels.items()})
            self.take_blemish(blemish, found.data)
            self.found.append((blemish, found))
        self.fitter, self.at = store.fit_from(self.whole, state["at"])
        self.refused = set(state["refused"])
        self.refitted_state = state["refitted"]
        _, self.refitted = store.fit_from(self.whole, state["refitted"])
        self.accepted = [Accepted(store.candidate_from(model, c), share, {}) for c, share in state["accepted"]]
        self.steps = [store.step_from(step) for step in state["steps"]]
        self.stages = [(name, dict(parameters)) for name, parameters in state["stages"]]
        self.shortest, self.offered = state["shortest"], bool(state["offered"])
        self.probes = store.probes_from(model, state["probes"])
        self._open(state["opening"])

    @property
    def present(self) -> list[str]:
        """Effects that are not to be scored: accepted, believed by the lab to be there, given up, or to come after
        another."""
        believed = [e.id for e in nameable(self.simulator.model)
                    if any(self.nominal.get(q.name, q.start) != q.start for q in e.sizes)]  # fmt: skip
        accepted = [a.id for a in self.accepted]
        waiting = [name for name, copy in self.copies.items() if copy.after and copy.after not in accepted]
        return [*believed, *accepted, *self.refused, *waiting]

    def _believed(self) -> list[Free]:
        """Sizes of effects that the nominal model has, and gains that no one knows: fitted with it."""
        sizes = [q for e in nameable(self.simulator.model) for q in e.sizes]
        held = [Free(q.name, 1e-6 * abs(self.nominal[q.name] - q.start), q.low, q.high) for q in sizes
                if self.nominal.get(q.name, q.start) != q.start]  # fmt: skip
        gains = [(name, self.nominal[name]) for name in self.dataset.unknown]
        signs = [(0.0, inf) if gain > 0 else (-inf, 0.0) for _, gain in gains]
        return [*held, *(Free(name, 1e-6 * abs(gain), *sign) for (name, gain), sign in zip(gains, signs, strict=True))]

    def go_on(self, at: Fitted, settle: Settle = settled) -> None:
        """Goes on with ``at``, fitted over as much of the runs as stays in step."""
        self.fitter, self.at = settle(self.whole, at)

    def _go_on_or_keep(self, at: Fitted, settle: Settle = settled) -> None:
        """The same; without the time for it with ``at`` as it is, which the present fitter has fitted."""
        self.at = at
        self.attempt("fit over whole runs", partial(self.go_on, at, settle))

    def _next(self) -> str:
        """What a refit would try next."""
        ids = [c.effect.id for c, _ in self.significant()]
        return f"refit with {', '.join(ids[:RIVALS])}" if ids else "refit"

    def _stage(self, name: str) -> None:
        self._stage_of(name, self.at)

    def _stage_of(self, name: str, at: Fitted) -> None:
        self.stages.append((name, dict(at.parameters)))

    def look(self, among: Kind | None = None) -> None:
        """Scores every candidate, or those ``among`` which alone it looks, at the present fit, on the shortest openings
        that may show one. What was last asked is not asked again."""
        number = self.shortest if self.fitter is self.whole else 1
        if number != self.number:
            self._open(number)
        asked = Look(self.library, self.fitter, self.at, among, self.present, [a.neutral for a in self.accepted])
        if self.looked and asked.same(self.looked):
            return
        self.view = opened(self.opening, self.at) if number > 1 else Opening(self.fitter, self.at)
        found = self.library.candidates(*self.view, self.present, among)
        self.scan, self.among = self._scanned(found), among
        self.scored = self.scan.scores()
        best = best_of(self.scored, self.criteria)
        for candidate, result in best:
            sharper = candidate
            # A resonance or an instant on a coarse grid: ever finer about the best point, where it may matter.
            while result.probability < 0.01 and result.gain > 0.2 * best[0][1].gain and sharper.trials < FINEST:
                closer = finer(sharper)
                more = self._scanned(closer).scores() if closer else []
                if not more:
                    break
                self.scored += more
                sharper = max(more, key=lambda entry: entry[1].gain)[0]
        self.looked = asked

    def _scanned(self, found: Sequence[Candidate]) -> Scan:
        return scanned(*self.view, [entry.neutral for entry in self.accepted], found)

    def significant(self) -> list[Scored]:
        """What is significant and material beside the present model, best first."""
        return [(c, s) for c, s in best_of(self.scored, self.criteria)
                if sure(c, s, self.criteria) and s.share >= self.criteria.material]  # fmt: skip

    def _accept(self, *, patient: bool) -> bool:
        """Takes the best effect that is both significant and material into the model; False where there is none."""
        # What a further search could not tell from its term comes in only in its place.
        out = {term.id for own in self.terms for term in own[1:]} | {d.candidate.effect.id for d in self.dropped}
        # One of two that no sample tells apart can only come in the place of the other.
        out |= set(alike(self, self.names))
        worth = [(c, s) for c, s in self.significant() if c.effect.id not in out]
        if not worth:
            return False
        close = rivals(self, worth)
        self.progress("refit with " + ", ".join(dict.fromkeys(c.effect.id for c, _ in close)))
        view = self.view
        begun = [Refit(self.with_effect(*view, c, s), c, s) for c, s in close]
        fits = self.waiting or refitted(self, view, begun, elsewhere=True)
        self.waiting, best = [], best_refit(self.criteria, view, fits)
        self.weak = weak(self, view, best) if best and patient and not self.offered else 0.0
        if self.weak:
            self.waiting = fits
            return False
        while best and view.fitter is not self.fitter:
            left = near(self.criteria, fits, 4 * self.criteria.even)
            view = longer(self, view, sole=len(left) == 1)
            fits = refitted(self, view, left, rounds=ROUNDS)
            best = best_refit(self.criteria, view, fits)
            if view.fitter is not self.fitter:
                self.simulator.forget(view.fitter.records)
        left = near(self.criteria, fits, 4 * self.criteria.even)
        if best and len(left) > 1:
            fits = [fit._replace(at=own_filter(self.fitter, fit.at)) for fit in left]
            best = best_refit(self.criteria, view, fits)
        # One that was cut short is no match for the others.
        self.simulator.clock.check()
        if best is None:
            return False
        candidate, self.offered = best.candidate, False
        scores = {c.effect.id: s for c, s in best_of(self.scored, self.criteria)}
        self.steps.append(Step(scores, candidate.effect.id))
        share = 1 - best.at.cost / self.at.cost
        if candidate.partner:
            self.accepted.append(Accepted(candidate.partner, share, {}))
        self.accepted.append(Accepted(candidate, share, {}))
        self.progress(f"accepted {candidate.effect.id}")
        self._go_on_or_keep(best.at, nearly_settled if self.number > 1 else settled)
        return True

    @staticmethod
    def untracked(view: Opening) -> Fitted:
        """A fit, anew where its filter tracks a motion, which may be what is missing: without that."""
        still = view.fitter.still(view.at)
        return still if still is view.at else view.fitter.fit(still)

    def _accept_behind_noise(self) -> bool:
        """The same where the filter takes a part of the motion for noise, which may be what is missing: the best beside
        no such noise, if the residuals are then likelier."""
        setting = self.at.whiten.setting
        if self.fitter is not self.whole or not setting.bandwidth:
            return False
        before, unlikely = self._kept(), self.at.unlikely
        self.at = self.untracked(Opening(self.fitter, self.at))
        self.look()
        if self._accept(patient=False):
            candidate = self.accepted[-1].candidate
            chance = self.criteria.effect_chance / candidate.trials
            needed = float(chi2.isf(chance, len(candidate.all_probes) + len(candidate.searched)))
            if self.at.count * (unlikely - self.at.unlikely) > needed:
                return True
            self.progress(f"took {candidate.effect.id} back: residuals are no likelier with it")
        vars(self).update(before)
        return False

    def with_effect(self, fitter: Fitter, at: Fitted, candidate: Candidate, result: Score) -> Fitted:
        """``at``, a fit of ``fitter``, with the effect switched on at the size that its score says, to be fitted. What
        takes up a part of it goes with it, where that is nearer: a film damps beside a damper that is as much less."""
        values = candidate.values(result.amplitudes, result.deviations)
        free = (*at.free, *candidate.free(fitter.period))
        shapes = {**(candidate.partner.shapes if candidate.partner else {}), **candidate.shapes}
        own = {**at.parameters, **shapes, **values}
        moved = {f.name: f.bounded(own[f.name], own[f.name] + result.moves.get(f.name, 0.0)) for f in at.free}
        begun = fitter.evaluated(replace(at, parameters={**own, **moved}, free=free))
        if begun.cost <= at.cost:
            return begun
        return min(begun, fitter.evaluated(replace(at, parameters=own, free=free)), key=lambda fitted: fitted.cost)

    def without_effect(self, at: Fitted, entry: Accepted) -> Fitted:
        """``at`` with the effect switched off, to be fitted."""
        free = tuple(f for f in at.free if f.name not in entry.names)
        rest = {name: value for name, value in at.parameters.items() if name not in entry.names}
        return self.fitter.evaluated(replace(at, parameters=rest, free=free))

    @property
    def partners(self) -> set[str]:
        """Ids of effects without which others in the model would change nothing."""
        return {a.candidate.partner.effect.id for a in self.accepted if a.candidate.partner}

    @property
    def unsure(self) -> bool:
        """Whether a name in the model was not put to the test: by others in its place, or by data that no fit saw."""
        named = [a for a in self.accepted if not a.of_record and a.id not in self.partners]
        return bool(named) and not (self.questioned and all(a.asked for a in named))

    @property
    def names(self) -> set[str]:
        """Ids of what is in the model."""
        return {entry.id for entry in self.accepted}

    def question(self) -> bool:
        """Puts every name to the test. Whether one went, in whose place something is to be looked for, and there is
        time for it."""
        before = self.names
        self._until(QUESTION)
        while self.attempt("names held against data that no fit saw", partial(ask, self)):
            pass
        self._until(NAME)
        again = self.names < before and not self.late
        if again:
            self._go_on_or_keep(self.at)
        return again
