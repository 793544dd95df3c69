"""What was accepted is put to the test by data that its fit did not see."""

from typing import TYPE_CHECKING

from discrepancy.name.accepted import Accepted, Dropped
from discrepancy.name.exchange import first_of_its_kind
from discrepancy.name.scan import sure
from discrepancy.name.score import score
from discrepancy.name.score import without as less
from discrepancy.name.unseen import unseen_gains

if TYPE_CHECKING:
    from discrepancy.name.search import Search


def ask(search: "Search") -> None:
    """Takes out every effect that data which its fit did not see do not support, or whose interval holds neutral: the
    weakest first, the rest refitted. Raises OutOfTime."""
    while failing := _failing(search):
        search.progress(f"took out {failing.candidate.effect.id}: {failing.reason}")
        entry = next(a for a in search.accepted if a.candidate is failing.candidate)
        search.dropped.append(failing)
        search.accepted.remove(entry)
        search.go_on(search.without_effect(search.at, entry))
        first_of_its_kind(search, entry)
    search.simulator.clock.check()
    search.questioned = True


def _failing(search: "Search") -> Dropped | None:
    partners = search.partners
    entries = [a for a in search.accepted if a.id not in partners]
    if not entries:
        return None
    deviations = search.fitter.deviations(search.at)
    gains = unseen_gains(search.fitter, search.at, [(a.names, a.neutral) for a in entries])
    failing = []
    for entry, gain in zip(entries, gains, strict=True):
        sizes = {q.name: (search.at.parameters[q.name], deviations[q.name])
                 for q in entry.candidate.effect.sizes if q.name in deviations}  # fmt: skip
        neutral = {q.name: q.start for q in entry.candidate.effect.sizes}
        weak = all(abs(value - neutral[name]) < 1.96 * d for name, (value, d) in sizes.items())
        if sizes and weak and not _shows(search, entry):
            failing.append((gain, Dropped(entry.candidate, "its interval holds neutral", sizes, entry.share)))
        elif gain < search.criteria.unseen:
            reason = f"data that its fit did not see improve by {gain:.1f} deviations only"
            failing.append((gain, Dropped(entry.candidate, reason, sizes, entry.share)))
    return min(failing, key=lambda f: f[0])[1] if failing else None


def _shows(search: "Search", entry: Accepted) -> bool:
    """Whether all parameters of an effect together explain something significant, though each by itself may be
    what the others make up for: of a weak friction over a high speed the data show the ratio alone."""
    linear = search.fitter.with_grams(search.at, [entry.neutral])
    assert linear.grams is not None
    own = [i for i, f in enumerate(linear.free) if f.name in entry.names]
    others = [i for i in range(linear.known) if i not in own]
    found = score(less(linear.grams, linear.known), others, own, linear.count)
    return sure(entry.candidate, found, search.criteria)
