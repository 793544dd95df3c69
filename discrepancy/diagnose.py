"""Names the effects that a model lacks, and hands what no name explains to a further search."""

import os
from collections.abc import Iterable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import asdict
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Any, Final

from threadpoolctl import threadpool_limits

from discrepancy import MOST_EFFECTS
from discrepancy.clock import Clock, OutOfTime
from discrepancy.criteria import Criteria
from discrepancy.data.dataset import Dataset
from discrepancy.data.modes import further_modes
from discrepancy.fit.refit import DEFAULT
from discrepancy.fit.simulate import Simulator
from discrepancy.name import checkpoint as store
from discrepancy.name.further import Further
from discrepancy.name.more_modes import copies, with_copies
from discrepancy.name.search import Search
from discrepancy.tell.answer import Diagnosis
from discrepancy.tell.assemble import assemble
from discrepancy.tell.limits import Limits
from discrepancy.terms.effect_file import Term, joined
from gyro_model.errors import InputError
from gyro_model.model import Model
from gyro_model.progress import Steps

AGAIN: Final = 3
"""Times at most that effects are looked for anew beside names that questions have changed."""


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

    max_effects: at most so many are named; jobs: threads; seed: names the search (it draws nothing at random);
    progress: called with one line a step; checkpoint: a file that holds the search after each step, from which an
    interrupted one resumes, removed at the end; further: called with the answer, at most ``max_effects`` times, until
    it finds no more; what it adds to the model is scored, refitted and questioned beside all effects; criteria: every
    threshold; limits: of the laboratory, for the experiment that it proposes.
    Raises InputError where the FMU can't be built or refuses the nominal values.
    """
    with ExitStack() as stack:
        # Products of thin matrices: threads of their own make them slower, many times where cores are shared.
        stack.enter_context(threadpool_limits(1, "blas"))

        def simulator(model: Model, terms: Iterable[Term]) -> Simulator:
            return stack.enter_context(Simulator(joined(model, [term.effect for term in terms]), jobs, clock))

        clock = Clock(jobs or os.cpu_count() or 1)
        modes = further_modes(dataset.fit)
        more = copies(model, dataset.fit[0].axes, len(modes[1]))
        model = with_copies(model, more)
        settings = {"max_effects": max_effects, "seed": seed, "further": further is not None, **asdict(criteria)}
        key = store.digest(dataset, model, settings) if checkpoint else ""
        tell = progress or (lambda _: None)

        def begun(state: Mapping[str, Any] | None) -> Search:
            terms = state["terms"] if state else []
            search = Search(simulator(model, chain(*terms)), dataset, tell, terms, criteria)
            search.copies, search.modes = more, modes
            if checkpoint is not None:
                search.keep = lambda state: store.save(checkpoint, key, state)
            search.begin(state)
            return search

        try:
            search = begun(store.load(checkpoint, key, dataset, model))
        except InputError as error:
            if checkpoint is None or not checkpoint.is_file():
                raise
            tell(f"{checkpoint.name} is not used: {error}")
            checkpoint.unlink()
            search = begun(None)
        if further is not None:
            for term in chain(*search.terms):
                term.write(further.folder)

        refuted: set[str] = set()

        def widened(against: Sequence[str], least: float) -> bool:
            if further is None:
                return False
            room = max_effects - sum(not a.of_record for a in search.accepted)
            if least:
                # On the openings that showed the effect, which leave more there.
                fitter, at = search.view.fitter, search.untracked(search.view)
            else:
                fitter, at = search.fitter, search.at
            ask = partial(further, fitter, at, against, room, least)
            wider = search.attempt("terms that are in no file", ask)
            if wider is None:
                return False
            refuted.update(wider.wrong)
            own = search.simulator
            wide = simulator(own.model, wider.terms) if wider.terms else own
            return bool(search.attempt("refit with a new term", partial(search.widen, wide, wider.terms, wider.wrong)))

        def extended() -> None:
            search.extend(max_effects, patient=further is not None)
            while search.weak:
                # It may be a part of what a term explains in full; names are questioned in the end.
                if len(search.terms) < max_effects:
                    widened((), search.weak)
                search.extend(max_effects, patient=True)

        def settled() -> None:
            # What came in first may have hidden what is seen once its place is taken or it is gone.
            for _ in range(AGAIN):
                extended()
                before = search.names
                search.finish(max_effects)
                if search.names == before:
                    break

        def replaced() -> bool:
            before = search.astray
            if not widened([a.id for a in search.accepted if not a.of_record], 0.0):
                return False
            settled()
            # A name is not given up for one that there was no time to take in.
            if search.late and search.astray > before:
                raise OutOfTime
            return True

        settled()
        while further and len(search.terms) < max_effects and not search.in_vain:
            if not search.attempt("another term in the place of a name", replaced):
                break
        # Those that stayed because there was no time for the other term.
        search.refuted = refuted & search.names
        again = AGAIN
        # What comes in after a question is questioned as well.
        while search.question() and again:
            again -= 1
            settled()
        found = assemble(search, limits or Limits())
        used = more.keys() & found.spoken_of
        if further is not None:
            for name in used:
                more[name].write(further.folder)
        found = found.without(more.keys() - used)
    if checkpoint is not None:
        checkpoint.unlink(missing_ok=True)
    return found
