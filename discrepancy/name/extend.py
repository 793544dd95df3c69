"""Effects taken into the model one by one: score all, refit the best, accept, repeat."""

from dataclasses import replace
from functools import partial
from typing import Final

from scipy.stats import chi2

from discrepancy.fit.continuation import ROUNDS, nearly_settled, settled
from discrepancy.fit.fitted import Fitted
from discrepancy.fit.openings import Opening, parts
from discrepancy.fit.simulate import Simulator
from discrepancy.name.accepted import Accepted, Refit
from discrepancy.name.begin import tidy
from discrepancy.name.columns import on_the_way
from discrepancy.name.competition import best_refit, longer, near, own_filter, refitted, rivals, weak
from discrepancy.name.exchange import delete, exchange
from discrepancy.name.further import Wider
from discrepancy.name.kept import saved
from discrepancy.name.lagging import has_its_place
from discrepancy.name.look import fewer_parts, look
from discrepancy.name.resisting import alike
from discrepancy.name.scan import Scored, best_of
from discrepancy.name.score import Step
from discrepancy.name.search import Search, attempt
from discrepancy.name.shaping import movable, shaped
from discrepancy.terms.effect_file import Term

AT_ONCE: Final = 3
"""Effects behind a noise of the motion that may come in together: beside the large offset of an amplifier a delay alone
leaves as much for noise as before."""


def extend(search: Search, max_effects: int, *, patient: bool = False) -> Search:
    """With effects accepted until none is worth it, or, being ``patient``, until the best is ``weak``, called again
    from the one after it: those that short openings of the runs show, then those that longer ones do, at last the
    whole."""
    while True:
        full = len(search.accepted) >= max_effects
        search = replace(search, full=full, shortest=1 if full else search.shortest)
        if search.shortest == 1 and search.number > 1:
            search = search.fitted_or_kept(search.at)
        refused = bool(search.waiting)
        if not refused:
            search = attempt(search, "scores of all effects", look)
            if movable(search):
                before, search = search, attempt(search, "shapes of effects in the model", shaped)
                if search.accepted is not before.accepted:
                    continue
        search = replace(search, weak=0.0)
        if search.late or full:
            break
        before = search
        search = attempt(search, search.next_refits(), partial(accept, patient=patient and not refused))
        if search.weak:
            return search
        if _nothing(search, before) and search.number == 1:
            behind = partial(accept_behind_noise, most=max_effects - len(search.accepted))
            search = attempt(search, "effects behind a noise of the motion", behind)
        if search.accepted is before.accepted:
            if search.number == 1 or not _nothing(search, before):
                break
            search = replace(search, shortest=fewer_parts(search))
            continue
        if any(a.on_the_way for a in search.accepted[:-1]):
            # Filters and delays differ by little, which shows only beside what else is missing.
            search = delete(exchange(search, on_the_way), on_the_way)
        search = search.staged(search.accepted[-1].id)
        search = saved(attempt(search, "defects of single samples", tidy))
    last = Step({c.effect.id: s for c, s in best_of(search.scored, search.criteria)}, None)
    return replace(search, steps=(*search.steps, last))


def _nothing(search: Search, before: Search) -> bool:
    """Whether nothing was worth it since ``before``, though there was time for it."""
    return search.accepted is before.accepted and len(search.undone) == len(before.undone)


def accept(search: Search, *, patient: bool) -> Search:
    """With the best effect that is both significant and material in the model; with none more where there is none, or
    where it is ``weak`` and the search ``patient``. Raises OutOfTime."""
    worth = _worth(search)
    if not worth:
        return search
    view, fits = search.view, list(search.waiting)
    close = rivals(search, worth)
    search.progress("refit with " + ", ".join(dict.fromkeys(c.effect.id for c, _ in close)))
    if not fits:
        begun = [Refit(search.with_effect(*view, c, s), c, s) for c, s in close]
        fits = refitted(search, view, begun, elsewhere=True)
    best = best_refit(search.criteria, view, fits)
    share = weak(search, view, best) if best and patient and not search.offered else 0.0
    search = replace(search, weak=share, waiting=tuple(fits) if share else ())
    if share:
        return search
    best = _best_of_whole(search, view, fits, best)
    # One that was cut short is no match for the others.
    search.simulator.clock.check()
    return search if best is None else _accepted(search, best)


def _worth(search: Search) -> list[Scored]:
    """What is significant and material and may come in by itself."""
    # What a further search could not tell from its term comes in only in its place.
    out = {term.id for own in search.terms for term in own[1:]} | {d.candidate.effect.id for d in search.dropped}
    # One of two that no sample tells apart can only come in the place of the other.
    out |= set(alike(search, search.names))
    return [(c, s) for c, s in search.significant() if c.effect.id not in out]


def _best_of_whole(search: Search, view: Opening, fits: list[Refit], best: Refit | None) -> Refit | None:
    """The ``best`` of ``fits`` after those near it are fitted to ever longer openings, up to the whole runs."""
    criteria = search.criteria
    while best and view.fitter is not search.fitter:
        left = near(criteria, fits, 4 * criteria.even)
        view = longer(search, view, sole=len(left) == 1)
        fits = refitted(search, view, left, rounds=ROUNDS)
        best = best_refit(criteria, view, fits)
        if view.fitter is not search.fitter:
            search.simulator.forget(view.fitter.records)
    left = near(criteria, fits, 4 * criteria.even)
    if best and len(left) > 1:
        best = best_refit(criteria, view, [fit._replace(at=own_filter(search.fitter, fit.at)) for fit in left])
    return best


def _accepted(search: Search, best: Refit) -> Search:
    candidate = best.candidate
    scores = {c.effect.id: s for c, s in best_of(search.scored, search.criteria)}
    share = 1 - best.at.cost / search.at.cost
    taken = [candidate.partner, candidate] if candidate.partner else [candidate]
    search.progress(f"accepted {candidate.effect.id}")
    search = replace(
        search,
        offered=False,
        steps=(*search.steps, Step(scores, candidate.effect.id)),
        accepted=(*search.accepted, *(Accepted(own, share, {}) for own in taken)),
    )
    if has_its_place(search):
        search = search.without_first_samples()
    return search.fitted_or_kept(best.at, nearly_settled if search.number > 1 else settled)


def untracked(view: Opening) -> Fitted:
    """A fit, anew where its filter tracks a motion, which may be what is missing: without that."""
    still = view.fitter.still(view.at)
    return still if still is view.at else view.fitter.fit(still)


def accept_behind_noise(search: Search, most: int) -> Search:
    """The same where the filter takes a part of the motion for noise, which may be what is missing: the best beside no
    such noise, if the residuals are then likelier, or with the best beside that, ``most`` in all. Raises OutOfTime."""
    if search.fitter is not search.whole or not search.at.whiten.setting.bandwidth:
        return search
    found, needed = search, 0.0
    for _ in range(min(AT_ONCE, most)):
        before = found
        found = accept(look(replace(before, at=untracked(Opening(before.fitter, before.at)))), patient=False)
        if found.accepted is before.accepted:
            break
        candidate = found.accepted[-1].candidate
        chance = search.criteria.effect_chance / candidate.trials
        needed += float(chi2.isf(chance, len(candidate.all_probes) + len(candidate.searched)))
        if found.at.count * (search.at.unlikely - found.at.unlikely) > needed:
            return found
    for entry in found.accepted[len(search.accepted) :]:
        search.progress(f"took {entry.id} back: residuals are no likelier with it")
    return search


def widen(search: Search, wide: Simulator, wider: Wider) -> Search:
    """Goes on without the effects that ``wider`` has found wrong, with the model of ``wide``: the present one and the
    effects of its terms. Raises OutOfTime."""
    search = _without(search, wider.wrong)
    search = replace(search, simulator=wide, terms=(*search.terms, wider.terms),
                     shortest=parts(search.dataset.fit)[0]).on(search.dataset)  # fmt: skip
    search = replace(search.fitted(search.at), weak=0.0, waiting=(), offered=True)
    if wider.wrong and wider.terms:
        first = wider.terms[0]
        search = attempt(search, f"refit with {first.id}", partial(_with_term, term=first))
    return saved(search)


def _without(search: Search, wrong: tuple[str, ...]) -> Search:
    """With effects given up for good."""
    for entry in [a for a in search.accepted if a.id in wrong]:
        search.progress(f"gave up {entry.id}: another term fits better in its place")
        search = replace(search.lacking(entry), at=search.without_effect(search.at, entry))
    return replace(search, refused=search.refused | set(wrong))


def _with_term(search: Search, term: Term) -> Search:
    """With a term that was found in the place of a name: it has held its own against all others, over more than the
    shortest openings. Raises OutOfTime."""
    search = look(replace(search, shortest=1), lambda effect: effect.id == term.id)
    found = accept(search, patient=False)
    found = found if found.accepted is search.accepted else found.staged(term.id)
    return replace(found, shortest=parts(found.dataset.fit)[0])
