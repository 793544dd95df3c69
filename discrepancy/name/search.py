"""The state of a search for effects that a model lacks. It is frozen: a step goes from one state to the next."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final, NamedTuple, TypeVar

import numpy as np

from discrepancy.clock import OutOfTime
from discrepancy.criteria import Criteria
from discrepancy.data.dataset import Dataset
from discrepancy.data.modes import Mode
from discrepancy.data.record import Hold
from discrepancy.data.setting_out import as_shown
from discrepancy.fit.continuation import beginnings, settled
from discrepancy.fit.defect import Blemish, Data, Found
from discrepancy.fit.fitted import Fitted
from discrepancy.fit.limits import masked
from discrepancy.fit.openings import Opening, parts
from discrepancy.fit.refit import DEFAULT, Fitter
from discrepancy.fit.simulate import Simulator
from discrepancy.name import checkpoint as store
from discrepancy.name.accepted import RIVALS, Accepted, Dropped, Instead, Refit
from discrepancy.name.columns import Candidate, Kind, Library, Probes, Silent, nameable
from discrepancy.name.more_modes import Copy
from discrepancy.name.scan import Scan, Scored, best_of, sure
from discrepancy.name.score import Score, Step
from discrepancy.terms.effect_file import Term
from gyro_model.model import Model
from gyro_model.progress import Steps

Settle = Callable[[Fitter, Fitted], tuple[Fitter, Fitted]]
Result = TypeVar("Result")

WHOLE_RUNS: Final = "fit over whole runs"
BEYOND: Final = 10.0
"""Seconds of work, beside ``time_limit``, for what an answer is the better for but can do without: of long runs with
many resonators a step of a fit takes a second, and with a hysteresis beside them seven."""


@dataclass(frozen=True)
class Given:
    """What a search is given, and never changes. dataset: as measured; progress: called with one line a step; copies:
    effects that wait for others; modes: those that the runs show, one an axis and further ones; keep: called with what
    an interrupted search resumes from."""

    dataset: Dataset
    progress: Steps = lambda line: None
    criteria: Criteria = DEFAULT
    copies: Mapping[str, Copy] = field(default_factory=dict)
    modes: tuple[list[Mode], list[Mode]] = field(default_factory=lambda: ([], []))
    keep: Callable[[Mapping[str, Any]], None] | None = None


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


class Seen(NamedTuple):
    """What a look has shown: the scores of all candidates, by a scan at the fit to what it looked at."""

    look: Look
    view: Opening
    scan: Scan
    scored: Sequence[Scored]


@dataclass(frozen=True)
class Search:
    """The state of a search: what is accepted, and the model fitted with it (``at``, over the runs of ``fitter``).

    dataset: the runs without what was found to be the record's, ``blemishes`` and samples beyond ``clip``, and, where
    ``without_first`` says so, without the first samples of each; whole: the fitter of whole runs; terms: by further
    search, what it added to the model; refitted: the fit of the nominal model, with ``refitted_state`` to make it
    again; refused: ids of effects given up; refuted: ids of those in the model in whose place a term fits better that
    there was no time to take in; shortest: into how many parts runs are cut where effects are looked for first; number,
    opening, library: into how many now, the fitter of the first parts, and candidates there; probes, silent: what
    libraries have found so far, which all states of a search share; full: whether no more effects are allowed;
    questioned: whether each name has stood a test by data that no fit saw; weak: what a term has to take to come before
    the best effect, one of those ``waiting``; offered: whether that was asked; instead: by id what was tried in the
    place of an effect; undone: what there was no time for; failed: what ended without numbers.
    """

    given: Given
    simulator: Simulator
    dataset: Dataset
    nominal: Mapping[str, float]
    whole: Fitter
    fitter: Fitter
    at: Fitted
    refitted: Fitted
    number: int
    opening: Fitter
    library: Library
    probes: Probes
    silent: Silent
    shortest: int
    refitted_state: Mapping[str, Any] | None = None
    terms: tuple[tuple[Term, ...], ...] = ()
    blemishes: tuple[tuple[Blemish, Found], ...] = ()
    clip: float | None = None
    without_first: bool = False
    accepted: tuple[Accepted, ...] = ()
    dropped: tuple[Dropped, ...] = ()
    refused: frozenset[str] = frozenset()
    refuted: frozenset[str] = frozenset()
    seen: Seen | None = None
    instead: Mapping[str, Instead] = field(default_factory=dict)
    weak: float = 0.0
    waiting: tuple[Refit, ...] = ()
    offered: bool = False
    full: bool = False
    questioned: bool = False
    steps: tuple[Step, ...] = ()
    stages: tuple[tuple[str, Mapping[str, float]], ...] = ()
    undone: tuple[str, ...] = ()
    failed: tuple[str, ...] = ()

    @classmethod
    def of(cls, given: Given, dataset: Dataset, whole: Fitter, at: Fitted) -> "Search":
        """A search of ``dataset``, the runs of ``whole``, that begins with ``at``, the nominal model fitted to them."""
        simulator, probes, silent = whole.simulator, Probes(), Silent()
        nominal, library = nominal_of(simulator.model, given.dataset), Library(whole, probes, silent)
        return cls(given, simulator, dataset, nominal, whole, whole, at, at, 1, whole, library, probes, silent,
                   parts(dataset.fit)[0], stages=(("nominal", nominal),))  # fmt: skip

    @property
    def criteria(self) -> Criteria:
        """Every threshold."""
        return self.given.criteria

    @property
    def progress(self) -> Steps:
        """Called with one line a step."""
        return self.given.progress

    @property
    def scored(self) -> Sequence[Scored]:
        """What the last look has shown of every candidate."""
        return self.seen.scored if self.seen else ()

    @property
    def view(self) -> Opening:
        """What the last look has looked at."""
        assert self.seen
        return self.seen.view

    @property
    def present(self) -> list[str]:
        """Effects that are not to be scored: accepted, believed by the lab to be there, given up, or to come after
        another."""
        believed = [e.id for e in nameable(self.simulator.model)
                    if any(self.nominal.get(q.name, q.start) != q.start for q in e.sizes)]  # fmt: skip
        accepted = [a.id for a in self.accepted]
        waiting = [name for name, copy in self.given.copies.items() if copy.after and copy.after not in accepted]
        return [*believed, *accepted, *self.refused, *waiting]

    @property
    def partners(self) -> set[str]:
        """Ids of effects without which others in the model would change nothing."""
        return {a.candidate.partner.effect.id for a in self.accepted if a.candidate.partner}

    @property
    def names(self) -> set[str]:
        """Ids of what is in the model."""
        return {entry.id for entry in self.accepted}

    @property
    def unsure(self) -> bool:
        """Whether a name in the model was not put to the test: by others in its place, or by data that no fit saw."""
        named = [a for a in self.accepted if not a.of_record and a.id not in self.partners]
        return bool(named) and not (self.questioned and all(a.asked for a in named))

    @property
    def in_vain(self) -> bool:
        """Whether the last further search added what was not accepted."""
        last = self.terms[-1] if self.terms else ()
        return bool(last) and not {term.id for term in last} & self.names

    @property
    def astray(self) -> tuple[int, float]:
        """How far the present fit is from the motion: pieces that it needs to stay in step, and residual over signal,
        which is less in shorter ones."""
        return len(self.fitter.records), self.fitter.off(self.at)

    @property
    def late(self) -> bool:
        """Whether the time for the present part is used up."""
        return self.simulator.clock.late

    def until(self, share: float) -> None:
        """Gives the present part the time to this share of all."""
        self.simulator.clock.until = share * self.criteria.time_limit

    def beyond(self) -> None:
        """Gives the present part a little more than is left."""
        clock = self.simulator.clock
        clock.until = max(clock.now, self.criteria.time_limit) + BEYOND

    def significant(self) -> list[Scored]:
        """What is significant and material beside the present model, best first."""
        return [(c, s) for c, s in best_of(self.scored, self.criteria)
                if sure(c, s, self.criteria) and s.share >= self.criteria.material]  # fmt: skip

    def next_refits(self) -> str:
        """What refits would try next."""
        ids = [c.effect.id for c, _ in self.significant()]
        return f"refit with {', '.join(ids[:RIVALS])}" if ids else "refit"

    def opened(self, number: int) -> "Search":
        """Looks for effects in the first of ``number`` parts of each run from now on, by the probes that are known."""
        opening = self.whole if number == 1 else beginnings(self.whole, number)
        return replace(self, number=number, opening=opening, library=Library(opening, self.probes, self.silent))

    def on(self, dataset: Dataset) -> "Search":
        """Goes on with these runs; what is fitted is as it was."""
        dataset = dataset.since_start() if self.without_first else dataset
        whole = Fitter(self.simulator, dataset.fit, criteria=self.criteria)
        state = store.on_other_data(whole, self.refitted_state) if self.refitted_state else None
        return replace(self, dataset=dataset, whole=whole, refitted_state=state).opened(self.number)

    def clipped(self, level: float) -> "Search":
        """Goes on without samples at or beyond ``level`` [V]."""
        return replace(self.on(clipped(self.dataset, level)), clip=level)

    def begun(self) -> "Search":
        """Goes on with runs that begin as their first samples show; what is fitted is as it was."""
        search = self.on(begun(self.dataset))
        starts = search.whole.starts(self.at.parameters)
        return replace(search, fitter=search.whole, at=search.whole.evaluated(replace(self.at, starts=starts)))

    def without_first_samples(self) -> "Search":
        """Goes on without the first samples of runs, in which what acted before them comes late."""
        return self if self.without_first else replace(self, without_first=True).on(self.dataset)

    def held(self, hold: Hold) -> "Search":
        """Goes on with forces that ran so between samples."""
        return self.on(self.dataset.held(hold))

    def cleaned(self, blemish: Blemish, data: Sequence[Data]) -> "Search":
        """Goes on with the runs to fit without what ``data`` say."""
        return self.on(cleaned(self.dataset, blemish, data))

    def fitted(self, at: Fitted, settle: Settle = settled) -> "Search":
        """Goes on with ``at``, fitted over as much of the runs as stays in step."""
        fitter, at = settle(self.whole, at)
        return replace(self, fitter=fitter, at=at)

    def fitted_or_kept(self, at: Fitted, settle: Settle = settled) -> "Search":
        """The same; without the time for it with ``at`` as it is, which the present fitter has fitted."""
        return attempt(replace(self, at=at), WHOLE_RUNS, lambda search: search.fitted(at, settle))

    def staged(self, name: str) -> "Search":
        """With the present parameters as a stage of the model."""
        return replace(self, stages=(*self.stages, (name, dict(self.at.parameters))))

    def changed(self, place: int, entry: Accepted) -> "Search":
        """With ``entry`` in this place of what is accepted."""
        return replace(self, accepted=(*self.accepted[:place], entry, *self.accepted[place + 1 :]))

    def lacking(self, entry: Accepted) -> "Search":
        """Without ``entry`` among what is accepted; the model has it still."""
        return replace(self, accepted=tuple(own for own in self.accepted if own.id != entry.id))

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


def asked(search: Search, what: str, question: Callable[[Search], Result]) -> tuple[Search, Result | None]:
    """The search, and what ``question`` gives; None where the time ends within it, or where its numbers run out of all
    bounds, and ``what`` is noted as not done."""
    try:
        search.simulator.clock.check()
        return search, question(search)
    except OutOfTime:
        search.progress(f"out of time: {what}")
        return replace(search, undone=(*search.undone, what)), None
    except (np.linalg.LinAlgError, ArithmeticError):
        search.progress(f"gave up, its numbers run out of all bounds: {what}")
        return replace(search, failed=(*search.failed, what)), None


def attempt(search: Search, what: str, step: Callable[[Search], Search]) -> Search:
    """The search after ``step``; as it was, with ``what`` noted as not done, where ``asked`` gives nothing."""
    before, after = asked(search, what, step)
    return before if after is None else after


def nominal_of(model: Model, dataset: Dataset) -> dict[str, float]:
    """The nominal values of a data set but for levels of noise, which no simulation has."""
    noise = {q.name for e in model.effects if e.noise for q in e.sizes}
    return {name: value for name, value in dataset.nominal.items() if name not in noise}


def clipped(dataset: Dataset, level: float) -> Dataset:
    """The runs without samples at or beyond ``level`` [V]."""
    return replace(dataset, records=tuple(masked(record, level) for record in dataset.records))


def begun(dataset: Dataset) -> Dataset:
    """The runs, each of which begins as its first samples show."""
    return replace(dataset, records=tuple(map(as_shown, dataset.records)))


def cleaned(dataset: Dataset, blemish: Blemish, data: Sequence[Data]) -> Dataset:
    """The runs, those to fit without what ``data`` say of each."""
    own = dict(zip((r.name for r in dataset.fit), data, strict=True))
    records = tuple(blemish.without(r, own[r.name]) if own.get(r.name) else r for r in dataset.records)
    return replace(dataset, records=records)
