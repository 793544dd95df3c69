"""What no name explains: names that a term of the library refutes are given up, and a term that is found becomes an
effect of the model."""

from pathlib import Path
from typing import TYPE_CHECKING

from discrepancy.columns import Candidate, Probe
from discrepancy.discovery import Discovery, discover, rivals
from discrepancy.locate import located

if TYPE_CHECKING:
    from discrepancy.naming import Search


def give_up_refuted(search: "Search") -> bool:
    """Takes out of the model the effects in whose place a term of the library fits better; whether there was one."""
    if not search.accepted or search.fitter is not search.whole:
        return False
    against = rivals(search.fitter, search.at, [a.id for a in search.accepted], search.progress).instead
    alone = {name for group in against if len(group) == 1 for name in group}
    refuted = alone or {name for group in against for name in group}
    for entry in [a for a in search.accepted if a.id in refuted]:
        search.progress(f"gave up {entry.id}: a term that is in no file fits better")
        search.leave_out(entry)
    return bool(refuted)


def explain_rest(search: "Search", folder: Path, max_effects: int) -> None:
    """Finds terms for what is left, as long as something is; their effect files go to ``folder``."""
    while len(search.accepted) < max_effects and is_open(search):
        found = discover(search.fitter, search.at, folder, search.progress)
        if found is None:
            break
        _adopt(search, found)


def is_open(search: "Search") -> bool:
    """Whether the fit leaves anything but noise. Not so the tracked motion: what is missing shakes the mass as well."""
    corner = search.at.whiten.setting.corner
    return bool(located(search.at.residuals, search.fitter.records, search.at.parameters, corner))


def _adopt(search: "Search", found: Discovery) -> None:
    from discrepancy.naming import Accepted

    if not found.known:
        search.continue_with(found.model)
    sizes = [q for q in found.effect.sizes if q.name in found.deviations]
    probes = tuple(Probe(q, found.fitted.parameters[q.name] - q.start, 1) for q in sizes)
    search.accepted.append(Accepted(Candidate(found.effect, probes, {}), found.share, {}))
    search.progress(f"accepted {found.effect.id}")
    search.take_fit(found.fitted, found.effect.id)
