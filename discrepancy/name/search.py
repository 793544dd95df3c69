"""The search for effects that a model lacks: score all, refit the best, accept, repeat, then question each again."""

from collections.abc import Callable, Mapping, Sequence
from copy import copy
from dataclasses import replace
from functools import partial
from math import inf
from typing import Any, Final, TypeVar

import numpy as np
from scipy.stats import chi2

from discrepancy.clock import OutOfTime
from discrepancy.criteria import Criteria
from discrepancy.data.dataset import Dataset
from discrepancy.fit.continuation import IN_STEP, LAST_ROUNDS, ROUNDS, beginnings, grown, nearly_settled, settled
from discrepancy.fit.defect import Blemish, Data, Defect, Found, Level, blemishes, effect_of
from discrepancy.fit.fitted import Fitted, Free
from discrepancy.fit.limits import clip_level, masked
from discrepancy.fit.locate import noise_level
from discrepancy.fit.openings import LONG, Opening, opened, parts
from discrepancy.fit.refit import AS_PROMISED, DEFAULT, Fitter
from discrepancy.fit.simulate import Simulator
from discrepancy.fit.whitening import EARNED
from discrepancy.name import checkpoint as store
from discrepancy.name.accepted import Accepted, Dropped, Instead, Refit
from discrepancy.name.columns import (
    Candidate,
    Fading,
    Kind,
    Library,
    Probe,
    Probes,
    fading,
    finer,
    nameable,
    on_the_way,
)
from discrepancy.name.more_modes import Copy
from discrepancy.name.scan import Scan, Scored, best_of, next_peaks, other_forms, scanned, sure
from discrepancy.name.score import Score, Step, score
from discrepancy.name.score import without as less
from discrepancy.name.unseen import unseen_gains
from discrepancy.terms.effect_file import Term
from gyro_model.anatomy import Force
from gyro_model.errors import InputError

RIVALS: Final = 6
"""At most so many effects are refitted before one is named."""
RIVAL_SHARE: Final = 0.5
"""A rival is refitted, where the simulation is not close, if it takes at least this part of the best one's share of the
residual: there, linear scores tell half the truth."""
CLEAR: Final = 30.0
"""Times the gain that an effect needs to stay, from which no refit without it is tried: what is not linear in it does
not make up for so much."""
WEAK: Final = 0.3
"""Share of what is no noise in the residual, below which an effect may only imitate what is missing."""
CLEANED: Final = 3
"""Looks at most for blemishes, one after the other."""
PART: Final = 1e-2
"""Of its usual size, by which a part of an effect that may vanish is probed: so little that its square is no matter."""
FINEST: Final = 70
"""Trials of a grid after which it is not refined further: resonances are then as sharp as Q = 640."""

BEGIN, NAME, QUESTION = 0.35, 0.8, 0.9
"""Shares of the time after which the nominal model is left as it is, nothing further is named, no name questioned."""

Progress = Callable[[str], None]
Settle = Callable[[Fitter, Fitted], tuple[Fitter, Fitted]]
Result = TypeVar("Result")


class Search:
    """The state of a search: what is accepted, and the model fitted with it (``at``, over the runs of ``fitter``);
    ``terms``: by further search, what it added to the model; ``copies``: effects that wait for others."""

    def __init__(
        self,
        simulator: Simulator,
        dataset: Dataset,
        progress: Progress,
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
        self.instead: Mapping[str, Instead] = {}
        self._take(dataset)
        noise = {q.name for e in simulator.model.effects if e.noise for q in e.sizes}
        self.nominal = {name: value for name, value in dataset.nominal.items() if name not in noise}
        self.accepted: list[Accepted] = []
        self.refused: set[str] = set()
        self.scored: list[Scored] = []
        self.steps: list[Step] = []
        self.stages: list[tuple[str, dict[str, float]]] = [("nominal", dict(self.nominal))]

    def attempt(self, what: str, work: Callable[[], Result]) -> Result | None:
        """What ``work`` gives; where the time ends within it all is as it was before, and ``what`` is noted as not
        done."""
        before = {name: copy(own) if isinstance(own, list | set) else own for name, own in vars(self).items()}
        try:
            self.simulator.clock.check()
            return work()
        except OutOfTime:
            vars(self).update(before)
            self.undone.append(what)
            self.progress(f"out of time: {what}")
            return None

    def _until(self, share: float) -> None:
        self.simulator.clock.until = share * self.criteria.time_limit

    def _take(self, dataset: Dataset) -> None:
        self.dataset = dataset
        self.whole = Fitter(self.simulator, dataset.fit, criteria=self.criteria)
        self._open(self.number)

    def _open(self, number: int) -> None:
        """Looks for effects in the first of ``number`` parts of each run from now on, by the probes that are known."""
        self.number = number
        self.opening = self.whole if number == 1 else beginnings(self.whole, number)
        self.library = Library(self.opening, self.probes)

    def _mask_clipped(self) -> None:
        """Looks for clipped samples beside the present model, and takes them out of everything else."""
        if self.clip is None and self.fitter is self.whole:
            level = clip_level(self.dataset.fit, self.at.residuals, self.criteria.clip_chance)
            if level is not None:
                self.progress(f"samples clipped at {level:.6g} V")
                self._take_clipped(level)
                self._settle(self.at)

    def _take_clipped(self, level: float) -> None:
        self.clip = level
        self._take(replace(self.dataset, records=tuple(masked(record, level) for record in self.dataset.records)))

    def _clean(self) -> None:
        """Takes blemishes of the record out that the fit is better without. A large one hides others, so that each
        that is gone asks for another look."""
        for _ in range(CLEANED):
            if self.fitter is not self.whole or not any([self._cleaned(blemish) for blemish in blemishes()]):
                return

    def _cleaned(self, blemish: Blemish) -> bool:
        """Whether one was found beside the present model and taken out."""
        found = blemish.find(self.dataset.fit, self.at.residuals, self.criteria)
        if found is None:
            return False
        before, unlikely = copy(vars(self)), self._unlikely()
        self._take_blemish(blemish, found.data)
        self._settle(self.at)
        # Worth a line of the report, and beyond what its numbers take away by chance.
        sure = (2 * sum(map(len, found.data)) + EARNED) / self.at.count
        if self._unlikely() >= unlikely - max(self.criteria.material, sure):
            vars(self).update(before)
            return False
        self.progress(f"record: {blemish.id} taken out")
        self.found.append((blemish, found))
        return True

    def _unlikely(self) -> float:
        """Twice the negative log likelihood of the residuals, a sample: innovations alone do not tell two fits apart
        that are whitened by different filters, since a strong one leaves little of anything."""
        logs = sum(self.at.whiten.log_determinants(len(residual)) for residual in self.at.residuals)
        return float(np.log(self.at.variance)) - 2 * logs / self.at.count

    def _take_blemish(self, blemish: Blemish, data: Sequence[Data]) -> None:
        """Goes on with the runs to fit without what ``data`` say."""
        cleaned = dict(zip((r.name for r in self.dataset.fit), data, strict=True))
        records = tuple(blemish.without(r, cleaned[r.name]) if cleaned.get(r.name) else r for r in self.dataset.records)
        self._take(replace(self.dataset, records=records))

    def begin(self, state: Mapping[str, Any] | None = None) -> None:
        """Fits the nominal model, or takes up a kept ``state``, whose entries are checked. Raises InputError where the
        state's fit is not one of these runs."""
        if state is None:
            self.progress("nominal parameters and initial states")
            self.fitter, self.at = self.whole, self.whole.begin(self.nominal, self._believed())
            self._until(BEGIN)
            self._settle_or_keep(self.at)
            self._until(NAME)
            self.attempt("defects of single samples", self._tidy)
            self.refitted = self.at
            self._stage("refit")
            self._save()
        else:
            self._restore(state)
            self._until(NAME)
            self.progress(f"resumed with {', '.join(a.id for a in self.accepted) or 'nominal parameters fitted'}")

    def _tidy(self) -> None:
        """Takes out of the record what the present model shows to be none of the device's."""
        self._mask_clipped()
        self._clean()

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
        self._settle(self.at)
        self.weak, self.waiting, self.offered = 0.0, [], True
        if wrong and terms:
            self.attempt(f"refit with {terms[0].id}", partial(self._take_in, terms[0]))
        self._save()
        return True

    def _take_in(self, term: Term) -> None:
        """Takes in a term that was found in the place of a name: it has held its own against all others, over more than
        the shortest openings."""
        self.shortest = 1
        self._scan(lambda effect: effect.id == term.id)
        if self._accept(patient=False):
            self._stage(term.id)
        self.shortest = parts(self.dataset.fit)[0]

    @property
    def in_vain(self) -> bool:
        """Whether the last further search added what was not accepted."""
        last = self.terms[-1] if self.terms else ()
        return bool(last) and not {term.id for term in last} & {a.id for a in self.accepted}

    @property
    def late(self) -> bool:
        """Whether the time for the present part is used up."""
        return self.simulator.clock.late

    def finish(self, max_effects: int) -> None:
        """Questions all that was accepted, as far as the time goes."""
        for place in range(len(self.accepted)):
            self.attempt(f"refit without a part of {self.accepted[place].id}", partial(self._fade, place))
        if self.terms:
            # A term in no file may make a name needless: first each is held against the others.
            self._exchange()
            self._delete()
        else:
            self._delete()
            self._exchange()

    def extend(self, max_effects: int, *, patient: bool = False) -> None:
        """Accepts effects until none is worth it, or, being ``patient``, until the best is ``weak``, called again from
        the one after it: those that short openings of the runs show, then those that longer ones do, at last the
        whole."""
        while True:
            self.full = len(self.accepted) >= max_effects
            self.shortest = 1 if self.full else self.shortest
            if self.shortest == 1 and self.number > 1:
                self._settle_or_keep(self.at)
            refused = bool(self.waiting)
            if not refused:
                self.attempt("scores of all effects", self._scan)
            self.weak = 0.0
            if self.late or self.full:
                break
            accepted = self.attempt(self._next(), partial(self._accept, patient=patient and not refused))
            if self.weak:
                return
            if accepted is None or (not accepted and self.number == 1):
                break
            if not accepted:
                self.shortest = max(n for n in parts(self.dataset.fit) if n < self.number)
                continue
            if any(a.on_the_way for a in self.accepted[:-1]):
                # Filters and delays differ by little, which shows only beside what else is missing.
                self._exchange(on_the_way)
                self._delete(on_the_way)
            self._stage(self.accepted[-1].id)
            self.attempt("defects of single samples", self._tidy)
            self._save()
        self.steps.append(Step({c.effect.id: s for c, s in best_of(self.scored, self.criteria)}, None))

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
        if state["clip"] is not None and self.clip is None:
            self._take_clipped(state["clip"])
        for name, data, levels in state["blemishes"][len(self.found) :]:
            blemish = effect_of(model, name)
            if not isinstance(blemish, Blemish) or len(data) != len(self.dataset.fit):
                raise InputError(f"blemish {name}: give numbers for each of {len(self.dataset.fit)} runs")
            found = Found(tuple(map(tuple, data)), {k: Level(*v) for k, v in levels.items()})
            self._take_blemish(blemish, found.data)
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

    def _settle(self, at: Fitted, settle: Settle = settled) -> None:
        """Goes on with ``at``, fitted over as much of the runs as stays in step."""
        self.fitter, self.at = settle(self.whole, at)

    def _settle_or_keep(self, at: Fitted, settle: Settle = settled) -> None:
        """The same; without the time for it with ``at`` as it is, which the present fitter has fitted."""
        self.at = at
        self.attempt("fit over whole runs", partial(self._settle, at, settle))

    def _next(self) -> str:
        """What a refit would try next."""
        ids = [c.effect.id for c, _ in self.significant()]
        return f"refit with {', '.join(ids[:RIVALS])}" if ids else "refit"

    def _stage(self, name: str) -> None:
        self.stages.append((name, dict(self.at.parameters)))

    def _scan(self, among: Kind | None = None) -> None:
        """Scores every candidate, or those ``among`` which alone it looks, at the present fit, on the shortest openings
        that may show one."""
        number = self.shortest if self.fitter is self.whole else 1
        if number != self.number:
            self._open(number)
        self.view = opened(self.opening, self.at) if number > 1 else Opening(self.fitter, self.at)
        found = self.library.candidates(*self.view, self.present, among)
        self.scan, self.among = self._scanned(found), among
        self.scored = self.scan.scores()
        best = best_of(self.scored, self.criteria)
        for candidate, result in best:
            sharper = candidate
            # A resonance or an instant on a coarse grid: ever finer about the best point, where it may matter.
            while result.probability < 0.01 and result.gain > 0.2 * best[0][1].gain and sharper.trials < FINEST:
                more = self._scanned(finer(sharper)).scores()
                if not more:
                    break
                self.scored += more
                sharper = max(more, key=lambda entry: entry[1].gain)[0]

    def _scanned(self, found: Sequence[Candidate]) -> Scan:
        return scanned(*self.view, [_neutral(entry) for entry in self.accepted], found)

    def significant(self) -> list[Scored]:
        """What is significant and material beside the present model, best first."""
        return [(c, s) for c, s in best_of(self.scored, self.criteria)
                if sure(c, s, self.criteria) and s.share >= self.criteria.material]  # fmt: skip

    def _accept(self, *, patient: bool) -> bool:
        """Takes the best effect that is both significant and material into the model; False where there is none."""
        # What a further search could not tell from its term comes in only in its place.
        out = {term.id for own in self.terms for term in own[1:]} | {d.candidate.effect.id for d in self.dropped}
        worth = [(c, s) for c, s in self.significant() if c.effect.id not in out]
        if not worth:
            return False
        # A plain one is soon fitted, and tells one that has shapes, which could imitate it, how far it has to come.
        rivals = sorted(self._close(worth), key=lambda entry: len(entry[0].searched))
        self.progress("refit with " + ", ".join(dict.fromkeys(c.effect.id for c, _ in rivals)))
        view = self.view
        begun = [Refit(self.with_effect(*view, c, s), c, s) for c, s in rivals]
        fits = self.waiting or self._refitted(view, begun, also=self._otherwise)
        self.waiting, best = [], self._best(view, fits)
        if best and patient and not self.offered and self._weak(view, best):
            self.weak, self.waiting = 1 - best.at.cost / view.at.cost, fits
            return False
        while best and view.fitter is not self.fitter:
            near = self._near(fits, 4 * self.criteria.even)
            view = self._longer(view, sole=len(near) == 1)
            fits = self._refitted(view, near, rounds=ROUNDS)
            best = self._best(view, fits)
            if view.fitter is not self.fitter:
                self.simulator.forget(view.fitter.records)
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
        self._settle_or_keep(best.at, nearly_settled if self.number > 1 else settled)
        return True

    def _longer(self, view: Opening, *, sole: bool) -> Opening:
        """Longer openings, or the whole runs, where rivals are told apart; for a ``sole`` one the whole."""
        number = len(self.whole.records[0].t) // len(view.fitter.records[0].t) // LONG
        if sole or number < 2 or self.fitter is not self.whole:
            return Opening(self.fitter, self.at)
        return opened(beginnings(self.whole, number), self.at)

    def _refitted(
        self,
        view: Opening,
        begun: Sequence[Refit],
        *,
        also: Callable[[Opening, Refit, float], list[Fitted]] | None = None,
        rounds: int = LAST_ROUNDS,
    ) -> list[Refit]:
        """Each fitted, or one of what there is ``also``; one that can't come near the best so far, or be significant,
        is left where that shows. Where columns promise what a fit then brings, one without shapes that promises no more
        is not fitted: which of the two it is, is asked when all else is in the model (``_exchange``)."""
        fits: list[Refit] = []
        brought = -inf
        for fit in begun:
            promised = fit.score.gain - self._price(fit.candidate, fit.score.freedom)
            if promised < brought + self.criteria.even and _linear(fit.candidate):
                continue
            enough = view.at.cost - self._needed(fit) * view.at.variance
            goal = min((f.at.cost + 4 * self.criteria.even * f.at.variance for f in fits), default=enough)
            ends = [view.of(fit.at, goal, rounds), *(also(view, fit, goal) if also else ())]
            fits.append(fit._replace(at=self._simplest(ends, fit.score.inflation)))
            gained = (view.at.cost - fits[-1].at.cost) / fits[-1].at.variance
            if _linear(fit.candidate) and abs(gained / fit.score.gain - 1) < AS_PROMISED:
                brought = max(brought, promised)
        return fits

    def _simplest(self, ends: Sequence[Fitted], inflation: float) -> Fitted:
        """The best of fits of one effect; a part of it that may vanish has to earn its parameters, where chance brings
        ``inflation`` times what it brings of white noise."""
        best = min(ends, key=lambda at: at.cost)
        price = self.criteria.simpler * inflation * best.variance
        return min(ends, key=lambda at: at.cost + price * len(at.free)) if best.cost < np.inf else best

    def _otherwise(self, view: Opening, fit: Refit, goal: float) -> list[Fitted]:
        """Fits that begin elsewhere, where one of all parameters at once may end in a wrong minimum: of a resonance
        from where it is broad, of a force with a part that may vanish from where it has."""
        part = fading(fit.candidate)
        if part is not None:
            return self._in_stages(view, fit, goal, part)
        resonant = any(q.search is not None and q.search.kind == "resonance" for q in fit.candidate.searched)
        if self.fitter is not self.whole or not resonant:
            return []
        return [view.of(grown(view.fitter, fit.at), goal)]

    def _in_stages(self, view: Opening, fit: Refit, goal: float, part: Fading) -> list[Fitted]:
        """The effect without a part of it, then that part where it shows most beside."""
        candidate = fit.candidate
        plain = view.of(self.with_effect(view.fitter, view.at, _without_part(candidate, part), fit.score))
        points = self.library.grids.wider(part.shapes, candidate.shapes)
        probe = Probe(part.size, part.size.typical * PART, 1)
        found = [Candidate(candidate.effect, (probe,), point, part.shapes, len(points)) for point in points]
        scan = scanned(view.fitter, plain, [], found)
        # A damping that stands in for what is missing has gone to its bound: it can take nothing up.
        stuck = {f.name for f in plain.free if plain.parameters[f.name] in (f.low, f.high)}
        stuck |= {"dxy"} if stuck & {"dxx", "dyy"} else set()
        scored = scan.scores([i for i, f in enumerate(plain.free) if f.name not in stuck])
        best = max(scored, key=lambda entry: entry[1].gain, default=None)
        if best is None or best[1].gain < self.criteria.simpler * (1 + len(part.shapes)):
            return [plain]
        return [plain, view.of(self.with_effect(view.fitter, plain, best[0], best[1]), goal)]

    def _best(self, view: Opening, fits: Sequence[Refit]) -> Refit | None:
        """The best of ``fits``; None where it is not worth it."""
        # Where nothing tells two apart the electronics are more often at fault than a force on the mass.
        best = min(self._near(fits, 1.0), key=lambda fit: isinstance(fit.candidate.effect, Force), default=None)
        worth = best is not None and view.at.cost - best.at.cost > self._needed(best) * best.at.variance
        return best if worth else None

    def _needed(self, fit: Refit) -> float:
        """What an effect has to take to be significant, as a chi-square."""
        chance = self.criteria.effect_chance / fit.candidate.trials
        return float(chi2.isf(chance, fit.score.freedom)) * fit.score.inflation

    def _weak(self, view: Opening, best: Refit) -> bool:
        """Whether the best is an effect of a file and takes little of what is no noise."""
        if best.candidate.effect.id in {term.id for own in self.terms for term in own}:
            return False
        noise = noise_level(view.at.residuals, view.fitter.records, view.at.parameters)
        return bool(view.at.cost - best.at.cost < WEAK * (view.at.cost - noise**2 * view.at.count))

    def _near(self, fits: Sequence[Refit], chi_square: float) -> list[Refit]:
        """Those whose cost and price are within so much of the best's; none where no motion stays within bounds."""
        fits = [fit for fit in fits if np.isfinite(fit.at.cost)]
        variance = min((fit.at.variance for fit in fits), default=1.0)
        prices = [fit.at.cost / variance + self._price(fit.candidate, fit.score.freedom) + self._shaped(fit.candidate)
                  for fit in fits]  # fmt: skip
        return [fit for fit, price in zip(fits, prices, strict=True) if price < min(prices) + chi_square]

    def _price(self, candidate: Candidate, sizes: int) -> float:
        """What so many sizes have to earn, as a chi-square; a defect of the record a little more, so that where it
        can't be told from an effect the effect is named."""
        more = self.criteria.even if isinstance(candidate.effect, Defect) else 0.0
        return self.criteria.simpler * sizes + more

    def _shaped(self, candidate: Candidate) -> float:
        """The same of the shapes that are fitted with them: of two names that are even the plainer stands first. How
        probable each is does not hang on it: a shape that data hardly show is as free as none."""
        return self.criteria.simpler * len(candidate.searched)

    def _close(self, worth: list[Scored]) -> list[Scored]:
        """Those whose refit could be the best: all that the linear scores leave open."""
        even, simpler = self.criteria.even, self.criteria.simpler
        top = max(s.gain - simpler * s.freedom for _, s in worth)
        share = max(s.share for _, s in worth)
        linear = self.view.fitter.off(self.view.at) < IN_STEP

        def near(entries: Sequence[Scored]) -> list[Scored]:
            if not linear:
                return [(c, s) for c, s in entries if s.share >= RIVAL_SHARE * share]
            least = [top - 4 * even * s.inflation - 0.1 * top for _, s in entries]
            return [(c, s) for (c, s), low in zip(entries, least, strict=True) if s.gain - simpler * s.freedom >= low]

        close = near(worth)[:RIVALS]
        peaks = [peak for c, _ in close for peak in near(next_peaks(c, self.scored))[:1]]
        return [*close, *peaks, *(form for c, _ in close for form in near(other_forms(c, self.scored)))]

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

    def _fade(self, place: int) -> None:
        """Takes out of an effect the part that may vanish, where its interval holds that it has."""
        entry = self.accepted[place]
        part = fading(entry.candidate)
        deviation = self.fitter.deviations(self.at).get(part.size.name, 0.0) if part else 0.0
        if part is None or self.at.parameters[part.size.name] >= 1.96 * deviation:
            return
        candidate = _without_part(entry.candidate, part)
        free = tuple(f for f in self.at.free if f.name not in part.names)
        begun = replace(self.at, parameters={**self.at.parameters, part.size.name: 0.0}, free=free)
        self._settle(self.fitter.evaluated(begun), nearly_settled)
        self.accepted[place] = replace(entry, candidate=candidate)

    def _delete(self, among: Kind | None = None) -> None:
        """Backward deletion: without each effect that the others have made needless. among: of these alone."""
        for entry in list(self.accepted):
            if len(self.accepted) < 2 or self.late:
                break
            # It may have got the name of one that went.
            if entry not in self.accepted or (among and not among(entry.candidate.effect)):
                continue
            self.attempt(f"refit without {entry.id}", partial(self._delete_needless, entry, among))

    def _delete_needless(self, entry: Accepted, among: Kind | None) -> None:
        chance = self.criteria.effect_chance / entry.candidate.trials
        needed = chi2.isf(chance, len(entry.candidate.probes)) * self.at.variance
        if self._takes(entry, among).gain * self.at.variance > CLEAR * max(
            needed, self.criteria.material * self.at.cost
        ):
            return
        fitted = self.fitter.fit(self.without_effect(self.at, entry))
        self.simulator.clock.check()
        gain = fitted.cost - self.at.cost
        if gain < needed or gain < self.criteria.material * fitted.cost:
            self.progress(f"deleted {entry.id}")
            self.accepted.remove(entry)
            self._settle(fitted)
            self._first_of_its_kind(entry)

    def _first_of_its_kind(self, gone: Accepted) -> None:
        """Where ``gone`` was the first of two of a kind, the other has its name."""
        for place, entry in enumerate(self.accepted):
            copy = self.copies.get(entry.id)
            if copy and copy.further and copy.after == gone.id:
                own = zip(entry.candidate.effect.parameters, gone.candidate.effect.parameters, strict=True)
                names = {mine.name: first.name for mine, first in own}
                p = {name: value for name, value in self.at.parameters.items() if name not in names.values()}
                free = tuple(replace(f, name=names.get(f.name, f.name)) for f in self.at.free)
                moved = replace(self.at, parameters={names.get(n, n): v for n, v in p.items()}, free=free)
                self.fitter.forget()
                self.at = replace(self.fitter.evaluated(moved), left=self.at.left)
                self.accepted[place] = replace(entry, candidate=entry.candidate.renamed(gone.candidate.effect, names))

    def _exchange(self, among: Kind | None = None) -> None:
        """Could another effect stand in the place of each? One that fits better takes it, one that fits as well is its
        ``either``. among: of these alone, while the search goes on."""
        partners = self._partners
        for place, entry in enumerate(self.accepted):
            if entry.id in partners or (among and not among(entry.candidate.effect)):
                continue
            self.attempt(f"rivals of {entry.id}", partial(self._exchange_one, place, entry, among))

    def _exchange_one(self, place: int, entry: Accepted, among: Kind | None) -> None:
        variance = self.at.variance
        fits = {entry.id: (self.at, entry.candidate), **self._refitted_instead(entry, among)}
        self.simulator.clock.check()
        price = {i: at.cost + self._price(c, len(c.all_probes)) * variance for i, (at, c) in fits.items()}
        plain = {i: price[i] + self._shaped(c) * variance for i, (_, c) in fits.items()}
        head = min(plain, key=lambda i: plain[i])
        # Of an effect and a defect of the record that are even the effect is named, whichever came first.
        owed = (
            0.0 if entry.of_record and not isinstance(fits[head][1].effect, Defect) else self.criteria.even * variance
        )
        if plain[head] > plain[entry.id] - owed:
            head = entry.id
        self.at, candidate = fits.pop(head)
        if head != entry.id and entry.id in self.instead:
            tried = [*self.instead[entry.id].tried, (entry.id, entry.candidate.shapes)]
            self.instead = {**self.instead, head: Instead(self.at.parameters, tried, fits)}
        close = self.at.cost + self.criteria.even * variance
        even = {i: dict(at.parameters) for i, (at, _) in fits.items() if at.cost < close}
        behind = {i: (price[i] - price[head]) / variance for i in fits}
        self.accepted[place] = Accepted(candidate, entry.share, even, behind, entry.asked or not among)

    @property
    def _partners(self) -> set[str]:
        """Ids of effects without which others in the model would change nothing."""
        return {a.candidate.partner.effect.id for a in self.accepted if a.candidate.partner}

    @property
    def unsure(self) -> bool:
        """Whether a name in the model was not put to the test: by others in its place, or by data that no fit saw."""
        named = [a for a in self.accepted if not a.of_record and a.id not in self._partners]
        return bool(named) and not (self.questioned and all(a.asked for a in named))

    @property
    def names(self) -> set[str]:
        """Ids of what is in the model."""
        return {entry.id for entry in self.accepted}

    def question(self) -> bool:
        """Takes out every effect that data which its fit did not see do not support, or whose interval holds neutral:
        the weakest first, the rest refitted. Whether something is to be looked for in its place, for which there is
        time."""
        before = self.names
        self._until(QUESTION)
        self.attempt("names held against data that no fit saw", self._question)
        self._until(NAME)
        return self.names < before and not self.late

    def _question(self) -> None:
        while failing := self._failing():
            self.progress(f"took out {failing.candidate.effect.id}: {failing.reason}")
            entry = next(a for a in self.accepted if a.candidate is failing.candidate)
            self.dropped.append(failing)
            self.accepted.remove(entry)
            self._settle(self.without_effect(self.at, entry))
            self._first_of_its_kind(entry)
        self.simulator.clock.check()
        self.questioned = True

    def _failing(self) -> Dropped | None:
        partners = self._partners
        entries = [a for a in self.accepted if a.id not in partners]
        if not entries:
            return None
        deviations = self.fitter.deviations(self.at)
        gains = unseen_gains(self.fitter, self.at, [(a.names, _neutral(a)) for a in entries])
        failing = []
        for entry, gain in zip(entries, gains, strict=True):
            sizes = {q.name: (self.at.parameters[q.name], deviations[q.name])
                     for q in entry.candidate.effect.sizes if q.name in deviations}  # fmt: skip
            neutral = {q.name: q.start for q in entry.candidate.effect.sizes}
            weak = all(abs(value - neutral[name]) < 1.96 * d for name, (value, d) in sizes.items())
            if sizes and weak and not self._shows(entry):
                failing.append((gain, Dropped(entry.candidate, "its interval holds neutral", sizes, entry.share)))
            elif gain < self.criteria.unseen:
                reason = f"data that its fit did not see improve by {gain:.1f} deviations only"
                failing.append((gain, Dropped(entry.candidate, reason, sizes, entry.share)))
        return min(failing, key=lambda f: f[0])[1] if failing else None

    def _shows(self, entry: Accepted) -> bool:
        """Whether all parameters of an effect together explain something significant, though each by itself may be
        what the others make up for: of a weak friction over a high speed the data show the ratio alone."""
        linear = self.fitter.with_grams(self.at, [_neutral(entry)])
        assert linear.grams is not None
        own = [i for i, f in enumerate(linear.free) if f.name in entry.names]
        others = [i for i in range(linear.known) if i not in own]
        found = score(less(linear.grams, linear.known), others, own, linear.count)
        return sure(entry.candidate, found, self.criteria)

    def _refitted_instead(self, entry: Accepted, among: Kind | None) -> dict[str, tuple[Fitted, Candidate]]:
        """By id the effects that fit nearly as well in the place of ``entry``, or better."""
        stand_ins, rounds = self._stand_ins(entry, among), ROUNDS if among else LAST_ROUNDS
        before = self.instead.get(entry.id)
        known = before if before and before.beside == self.at.parameters else Instead(self.at.parameters, [], {})
        stand_ins = [(c, s) for c, s in stand_ins if (c.effect.id, c.shapes) not in known.tried]
        fits = dict(known.fits)
        if not stand_ins:
            return fits
        goal = self.at.cost + self.criteria.even * self.at.variance
        base, number = self.without_effect(self.at, entry), parts(self.fitter.records)[0]
        trial = opened(beginnings(self.fitter, number), self.at) if number > 1 else None
        least = trial.at.cost + 4 * self.criteria.even * trial.at.variance if trial else np.inf
        for candidate, result in stand_ins:
            begun = self.with_effect(self.fitter, base, candidate, result)
            if trial and trial.of(begun, least).cost > least:
                continue
            self.progress(f"{candidate.effect.id} in place of {entry.id}")
            at = self.fitter.fit(begun, rounds, goal)
            if at.cost < min(goal, fits[candidate.effect.id][0].cost if candidate.effect.id in fits else np.inf):
                fits[candidate.effect.id] = at, candidate
        if trial:
            self.simulator.forget(trial.fitter.records)
        tried = [*known.tried, *((c.effect.id, c.shapes) for c, _ in stand_ins)]
        self.instead = {**self.instead, entry.id: Instead(self.at.parameters, tried, fits)}
        return dict(fits)

    def _takes(self, entry: Accepted, among: Kind | None) -> Score:
        """What the present fit would lose without an effect, to first order, the other parameters taking up what they
        can."""
        if self.scan.at.parameters != self.at.parameters or self.among not in (None, among):
            self.shortest = 1
            self._scan(among)
        linear = self.scan.at
        own = [i for i, f in enumerate(linear.free) if f.name in entry.names]
        others = [i for i in range(linear.known) if i not in own]
        return score(self.scan.grams(linear, self.accepted.index(entry)), others, own, self.at.count)

    def _stand_ins(self, entry: Accepted, among: Kind | None) -> list[Scored]:
        """Effects that explain what ``entry`` does nearly as well, by their columns at the present fit."""
        least = self._takes(entry, among)
        others = [i for i, f in enumerate(self.scan.at.free) if f.name not in entry.names]
        further = {name for name, copy in self.copies.items() if copy.further and copy.after == entry.id}
        near = [(c, s) for c, s in self.scan.scores(others, self.accepted.index(entry))
                if s.gain > least.gain - 4 * self.criteria.even * least.inflation - 0.1 * least.gain
                and c.effect.id not in further]  # fmt: skip
        best = best_of(near, self.criteria)[:RIVALS]
        return [*best, *(form for c, _ in best for form in other_forms(c, near))]


def _linear(candidate: Candidate) -> bool:
    """Whether the voltage changes in proportion to all that a fit moves, where that is small."""
    return not candidate.searched and not candidate.partner and all(p.power == 1 for p in candidate.probes)


def _neutral(entry: Accepted) -> dict[str, float]:
    return {p.quantity.name: p.quantity.start for p in entry.candidate.probes}


def _without_part(candidate: Candidate, part: Fading) -> Candidate:
    searched = tuple(q for q in candidate.searched if q.name not in part.names)
    return replace(candidate, shapes={**candidate.shapes, part.size.name: 0.0}, searched=searched)
