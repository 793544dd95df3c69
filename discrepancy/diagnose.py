"""Names the effects that a model lacks, and hands what no name explains to a further search."""

import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass, replace
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Any, Final

from threadpoolctl import threadpool_limits

from discrepancy import MOST_EFFECTS
from discrepancy.clock import Clock, OutOfTime
from discrepancy.criteria import Criteria
from discrepancy.data.dataset import Dataset
from discrepancy.fit.openings import Opening
from discrepancy.fit.refit import DEFAULT
from discrepancy.fit.simulate import Simulator
from discrepancy.name import checkpoint as store
from discrepancy.name.begin import begin, resume
from discrepancy.name.exchange import finish
from discrepancy.name.extend import extend, untracked, widen
from discrepancy.name.further import Further, Wider
from discrepancy.name.more_modes import copies, with_copies
from discrepancy.name.question import question
from discrepancy.name.search import Given, Search, asked, attempt
from discrepancy.tell.answer import Diagnosis
from discrepancy.tell.assemble import assemble
from discrepancy.tell.limits import Limits
from discrepancy.terms.effect_file import Term, joined
from gyro_model.errors import InputError
from gyro_model.model import Model
from gyro_model.progress import Steps

AGAIN: Final = 3
"""Times at most that effects are looked for anew beside names that questions have changed."""


@dataclass(frozen=True)
class _Plan:
    """What is asked of a search in turn. max_effects: at most so many are named; further: a search for terms that are
    in no file, where there is one; simulator: of a model with terms."""

    max_effects: int
    further: Further | None
    simulator: Callable[[Model, Iterable[Term]], Simulator]

    def carried_out(self, search: Search) -> Search:
        """The search with all in its model that is worth it, and every name put to the test."""
        search = self._settled(search)
        while self.further and len(search.terms) < self.max_effects and not search.in_vain:
            before, search = search, self._other_terms(search)
            if len(search.terms) == len(before.terms):
                break
        # Those that stayed because there was no time for the other term.
        search = replace(search, refuted=search.refuted & search.names)
        # What comes in after a question is questioned as well.
        for again in range(AGAIN, -1, -1):
            before, search = search, question(search)
            if not again or search.late or not search.names < before.names:
                break
            search = self._settled(search)
        return search

    def _settled(self, search: Search) -> Search:
        """With effects accepted and held against each other, again where what came in first may have hidden what is
        seen once its place is taken or it is gone."""
        for _ in range(AGAIN):
            search = self._extended(search)
            before, search = search, finish(search)
            if search.names == before.names:
                break
        return search

    def _extended(self, search: Search) -> Search:
        search = extend(search, self.max_effects, patient=self.further is not None)
        while search.weak:
            # It may be a part of what a term explains in full; names are questioned in the end.
            if len(search.terms) < self.max_effects:
                search, wider = self._wider(search, (), search.weak)
                search = self._widened(search, wider)
            search = extend(search, self.max_effects, patient=True)
        return search

    def _other_terms(self, search: Search) -> Search:
        """With a term in no file where one is missing, or in the place of names."""
        against = [a.id for a in search.accepted if not a.of_record]
        search, wider = self._wider(search, against)
        if wider is None:
            return search
        search = replace(search, refuted=search.refuted | set(wider.wrong))

        def replaced(before: Search) -> Search:
            after = self._widened(before, wider)
            if len(after.terms) == len(before.terms):
                return after
            after = self._settled(after)
            # A name is not given up for one that there was no time to take in.
            if after.late and after.astray > before.astray:
                raise OutOfTime
            return after

        return attempt(search, "another term in the place of a name", replaced)

    def _wider(self, search: Search, against: Sequence[str], least: float = 0.0) -> tuple[Search, Wider | None]:
        """What a further search finds in the place of the names ``against``, or, where it is to take ``least``, before
        a weak effect: on the openings that showed the effect, which leave more there."""
        if self.further is None:
            return search, None
        room, further = self.max_effects - sum(not a.of_record for a in search.accepted), self.further

        def ask(search: Search) -> Wider | None:
            view = Opening(search.view.fitter, untracked(search.view)) if least else Opening(search.fitter, search.at)
            return further(*view, against, room, least)

        return asked(search, "terms that are in no file", ask)

    def _widened(self, search: Search, wider: Wider | None) -> Search:
        if wider is None:
            return search
        own = search.simulator
        wide = self.simulator(own.model, wider.terms) if wider.terms else own
        return attempt(search, "refit with a new term", partial(widen, wide=wide, wider=wider))


def diagnose(
    dataset: Dataset,
    model: Model,
    *,
    max_effects: int = MOST_EFFECTS,
    jobs: int | None = None,
    seed: int = 0,
    progress: Steps | None = None,
    checkpoint: Path | None = None,
    further: Further | None = None,
    criteria: Criteria = DEFAULT,
    limits: Limits | None = None,
) -> Diagnosis:
    """Finds what ``model`` lacks to explain ``dataset``; held-out runs are simulated once, at the end.

    max_effects: at most so many are named, beside the further modes that the runs show; jobs: threads; seed: names the
    search (it draws nothing at random); progress: called with one line a step; checkpoint: a file that holds the search
    after each step, from which an interrupted one resumes, removed at the end; further: called with the answer, at most
    ``max_effects`` times, until it finds no more; what it adds to the model is scored, refitted and questioned beside
    all effects; criteria: every threshold; limits: of the laboratory, for the experiment that it proposes.
    Raises InputError where the FMU can't be built or refuses the nominal values.
    """
    with ExitStack() as stack:
        # Products of thin matrices: threads of their own make them slower, many times where cores are shared.
        stack.enter_context(threadpool_limits(1, "blas"))

        def simulator(model: Model, terms: Iterable[Term]) -> Simulator:
            own = joined(model, [term.effect for term in terms])
            # With terms that are in no file compiling took longer than a faster library saves: 195 s of tests for 121.
            return stack.enter_context(Simulator(own, jobs, clock, brief=own.effects != model.effects))

        clock = Clock(jobs or os.cpu_count() or 1)
        # Of forces that run on, taken for held ones, sensors see what no mode of the structure makes.
        modes = dataset.shown.modes
        more = copies(model, dataset.fit[0].axes, len(modes[1]))
        model = with_copies(model, more)
        settings = {"max_effects": max_effects, "seed": seed, "further": further is not None, **asdict(criteria)}
        key = store.digest(dataset, model, settings) if checkpoint else ""
        keep = partial(store.save, checkpoint, key) if checkpoint else None
        given = Given(dataset, progress or (lambda _: None), criteria, more, modes, keep)

        def begun(state: Mapping[str, Any] | None) -> Search:
            terms = state["terms"] if state else []
            own = simulator(model, chain(*terms))
            return resume(given, own, terms, state) if state else begin(given, own)

        try:
            search = begun(store.load(checkpoint, key, dataset, model))
        except InputError as error:
            if checkpoint is None or not checkpoint.is_file():
                raise
            given.progress(f"{checkpoint.name} is not used: {error}")
            checkpoint.unlink()
            search = begun(None)
        if further is not None:
            for term in chain(*search.terms):
                term.write(further.folder)
        # A resonator for each mode that the runs show takes no other's place.
        most = max_effects + len(modes[1]) if max_effects else 0
        search = _Plan(most, further, simulator).carried_out(search)
        found = assemble(search, limits or Limits())
        used = more.keys() & found.spoken_of
        if further is not None:
            for name in used:
                more[name].write(further.folder)
        found = found.without(more.keys() - used)
    if checkpoint is not None:
        checkpoint.unlink(missing_ok=True)
    return found
