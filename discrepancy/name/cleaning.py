"""What the present model shows to be none of the device's is taken out of the record."""

from copy import copy
from typing import TYPE_CHECKING, Final

from discrepancy.fit.continuation import nearly_settled
from discrepancy.fit.defect import Blemish, blemishes
from discrepancy.fit.limits import clip_level
from discrepancy.fit.whitening import EARNED

if TYPE_CHECKING:
    from discrepancy.name.search import Search

CLEANED: Final = 3
"""Looks at most for blemishes, one after the other."""
SEEN: Final = 0.1
"""Of what a blemish has to earn, that it does before anything is fitted anew: what is in the record is far off any
model that was fitted to it."""


def mask_clipped(search: "Search") -> None:
    """Looks for clipped samples beside the present model, and takes them out of everything else."""
    if search.clip is None and search.fitter is search.whole:
        data, chance = search.dataset, search.criteria.clip_chance
        level = clip_level(data.fit, search.at.residuals, chance, data.held_out)
        if level is not None:
            search.progress(f"samples clipped at {level:.6g} V")
            search.take_clipped(level)
            search.go_on(search.at)


def clean(search: "Search") -> None:
    """Takes blemishes of the record out that the fit is better without. A large one hides others, so that each
    that is gone asks for another look."""
    before = len(search.found)
    for _ in range(CLEANED):
        if search.fitter is not search.whole or not any([_cleaned(search, blemish) for blemish in blemishes()]):
            break
    if len(search.found) > before:
        # Each was fitted near its minimum only, and what is left there would be looked for among effects.
        search.go_on(search.at)


def _cleaned(search: "Search", blemish: Blemish) -> bool:
    """Whether one was found beside the present model and taken out."""
    found = blemish.find(search.dataset.fit, search.at.residuals, search.criteria)
    if found is None:
        return False
    before = copy(vars(search))
    # Worth a line of the report, and beyond what its numbers take away by chance.
    needed = max(search.criteria.material, (2 * sum(map(len, found.data)) + EARNED) / search.at.count)
    search.take_blemish(blemish, found.data)
    cleaned = search.whole
    beside = cleaned.evaluated(search.at).unlikely
    vars(search).update(before)
    search.simulator.forget(cleaned.records)
    if beside > search.at.unlikely - SEEN * needed:
        return False
    # Both fitted alike: a filter that is chosen anew changes the likelihood by more than what is taken out.
    search.go_on(search.at, nearly_settled)
    unlikely = min(search.at.unlikely, before["at"].unlikely)
    vars(search).update(before)
    search.take_blemish(blemish, found.data)
    # The filter is to be that of what is left now.
    search.go_on(search.whole.evaluated(search.at), nearly_settled)
    if search.at.unlikely >= unlikely - needed:
        vars(search).update(before)
        return False
    search.progress(f"record: {blemish.id} taken out")
    search.found.append((blemish, found))
    return True
