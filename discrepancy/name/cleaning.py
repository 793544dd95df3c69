"""What the present model shows to be none of the device's is taken out of the record."""

from dataclasses import replace
from functools import reduce
from typing import Final

from discrepancy.data.record import Floats
from discrepancy.fit.continuation import nearly_settled
from discrepancy.fit.defect import Blemish, Left, blemishes
from discrepancy.fit.limits import clip_level
from discrepancy.fit.whitening import EARNED
from discrepancy.name.search import Search

CLEANED: Final = 3
"""Looks at most for blemishes, one after the other."""
SEEN: Final = 0.1
"""Of what a blemish has to earn, that it does before anything is fitted anew: what is in the record is far off any
model that was fitted to it."""


def mask_clipped(search: Search) -> Search:
    """Without clipped samples, where the present model shows that there are."""
    if search.clip is not None or search.fitter is not search.whole:
        return search
    data, chance = search.dataset, search.criteria.clip_chance
    level = clip_level(data.fit, search.at.residuals, chance, data.held_out)
    if level is None:
        return search
    search.progress(f"samples clipped at {level:.6g} V")
    return search.clipped(level).fitted(search.at)


def clean(search: Search) -> Search:
    """Without blemishes of the record that the fit is better without. A large one hides others, so that each that is
    gone asks for another look."""
    known = len(search.blemishes)
    for _ in range(CLEANED):
        before = search
        if search.fitter is search.whole:
            search = reduce(_cleaned, blemishes(), search)
        if search is before:
            break
    # Each was fitted near its minimum only, and what is left there would be looked for among effects.
    return search.fitted(search.at) if len(search.blemishes) > known else search


def _left(search: Search) -> Left:
    runs, at = search.dataset.fit, search.at

    def between(run: int) -> Floats | None:
        return search.simulator.between_samples(runs[run], {**at.parameters, **at.starts[run]})

    return Left(runs, at.residuals, between)


def _cleaned(search: Search, blemish: Blemish) -> Search:
    """Without those of one kind, where they are found beside the present model."""
    found = blemish.find(_left(search), search.criteria)
    if found is None:
        return search
    # Worth a line of the report, and beyond what its numbers take away by chance.
    chosen = 0 if blemish.by_motion else sum(map(len, found.data))
    needed = max(search.criteria.material, (2 * chosen + EARNED) / search.at.count)
    without = search.cleaned(blemish, found.data)
    beside = without.whole.evaluated(search.at).unlikely
    search.simulator.forget(without.whole.records)
    if beside > search.at.unlikely - SEEN * needed:
        return search
    # Both fitted alike: a filter that is chosen anew changes the likelihood by more than what is taken out.
    unlikely = min(search.fitted(search.at, nearly_settled).at.unlikely, search.at.unlikely)
    # The filter is to be that of what is left now.
    without = without.fitted(without.whole.evaluated(search.at), nearly_settled)
    if without.at.unlikely >= unlikely - needed:
        return search
    search.progress(f"record: {blemish.id} taken out")
    return replace(without, blemishes=(*search.blemishes, (blemish, found)))
