"""What was accepted is put to the test by data that its fit did not see."""

from collections.abc import Mapping
from dataclasses import replace
from math import inf, isfinite
from typing import Final, NamedTuple

from scipy.stats import chi2

from discrepancy.fit.continuation import leaves
from discrepancy.fit.fitted import Fitted
from discrepancy.name.accepted import Accepted, Dropped
from discrepancy.name.begin import NAME
from discrepancy.name.exchange import first_of_its_kind
from discrepancy.name.scan import sure
from discrepancy.name.score import score
from discrepancy.name.score import without as less
from discrepancy.name.search import Search, attempt
from discrepancy.name.unseen import steady_gain, told

QUESTION: Final = 0.9
"""Share of the time after which no name is questioned."""
BENDS: Final = 4.0
"""Times what a linear model foretells, by which a fit is worse without an effect, from which that model says nothing of
it: a lag beside a delay, which makes up for it to first order."""


class _Failing(NamedTuple):
    """What fails a test, and why; unseen: by data that its fit did not see; seen: as in Told."""

    dropped: Dropped
    reason: str
    unseen: bool
    seen: float = 0.0


def question(search: Search) -> Search:
    """With every name put to the test: those that fail are gone, and the rest is fitted for what may come in their
    places, if there is time for that."""
    first, before = search.names, None
    search.until(QUESTION)
    while before is None or search.accepted is not before.accepted:
        before, search = search, attempt(search, "names held against data that no fit saw", ask)
    search.until(NAME)
    return search.fitted_or_kept(search.at) if search.names < first and not search.late else search


def ask(search: Search) -> Search:
    """Without the weakest effect that data which its fit did not see do not support, or whose interval holds neutral,
    the rest refitted; ``questioned`` where every one stands. Raises OutOfTime."""
    for failing in _failing(search):
        entry = next(a for a in search.accepted if a.candidate is failing.dropped.candidate)
        fitted = search.fitter.fit(search.without_effect(search.at, entry))
        search.simulator.clock.check()
        # What a filter predicts a sample ahead it does not miss, though the motion is lost without it.
        if failing.unseen and (leaves(search.fitter, fitted, search.at) or _bends(search, fitted, failing)):
            continue
        search.progress(f"took out {entry.id}: {failing.reason}")
        search = replace(search.lacking(entry), dropped=(*search.dropped, failing.dropped), at=fitted)
        return first_of_its_kind(search, entry)
    search.simulator.clock.check()
    return replace(search, questioned=True)


def _bends(search: Search, without: Fitted, failing: _Failing) -> bool:
    """Whether the fit without what fails is worse than a linear model, by which it fails, foretells, in every run."""
    if without.cost == inf:
        return True
    lost = search.at.count * (without.unlikely - search.at.unlikely)
    needed = float(chi2.isf(search.criteria.effect_chance, len(failing.dropped.sizes)))
    if lost < BENDS * max(failing.seen, needed):
        return False
    return steady_gain(search.fitter, without, search.at) >= search.criteria.unseen


def _failing(search: Search) -> list[_Failing]:
    """The effects that fail, the weakest first."""
    partners = search.partners
    entries = [a for a in search.accepted if a.id not in partners]
    if not entries:
        return []
    deviations = search.fitter.deviations(search.at)
    failing = []
    for entry, (gain, seen) in zip(
        entries, told(search.fitter, search.at, [(a.names, a.neutral) for a in entries]), strict=True
    ):
        weak = _neutral(search, entry, deviations)
        if weak is not None:
            failing.append((gain, _Failing(weak, "its interval holds neutral", unseen=False)))
        elif gain < search.criteria.unseen:
            reason = f"data that its fit did not see improve by {gain:.1f} deviations only"
            dropped = Dropped(entry.candidate, _sizes(search, entry, deviations), entry.share)
            failing.append((gain, _Failing(dropped, reason, unseen=True, seen=seen)))
    return [own for _, own in sorted(failing, key=lambda f: f[0])]


def unasked(search: Search) -> dict[str, Dropped]:
    """By id, the effects whose interval holds neutral, of a search that had no time to put what it accepted to the
    test; none where no interval is known, since its runs took too long to change anything in them."""
    deviations, partners = {} if search.questioned else search.fitter.deviations(search.at), search.partners
    if not any(map(isfinite, deviations.values())):
        return {}
    found = {a.id: _neutral(search, a, deviations) for a in search.accepted if a.id not in partners}
    return {name: dropped for name, dropped in found.items() if dropped is not None}


def _neutral(search: Search, entry: Accepted, deviations: Mapping[str, float]) -> Dropped | None:
    """An effect whose sizes have 95 % intervals that all hold neutral, and that shows by no other parameter; None for
    another."""
    sizes = _sizes(search, entry, deviations)
    neutral = {q.name: q.start for q in entry.candidate.effect.sizes}
    weak = all(abs(value - neutral[name]) < 1.96 * d for name, (value, d) in sizes.items())
    gone = all(value == neutral[name] for name, (value, _) in sizes.items())
    if not sizes or not weak or (not gone and len(entry.names) > 1 and _shows(search, entry)):
        return None
    return Dropped(entry.candidate, sizes, entry.share)


def _sizes(search: Search, entry: Accepted, deviations: Mapping[str, float]) -> dict[str, tuple[float, float]]:
    """Value and standard deviation of the sizes of an effect that are fitted."""
    return {q.name: (search.at.parameters[q.name], deviations[q.name])
            for q in entry.candidate.effect.sizes if q.name in deviations}  # fmt: skip


def _shows(search: Search, entry: Accepted) -> bool:
    """Whether all parameters of an effect together explain something significant, though each by itself may be
    what the others make up for: of a weak friction over a high speed the data show the ratio alone."""
    linear = search.fitter.with_grams(search.at, [entry.neutral])
    assert linear.grams is not None
    own = [i for i, f in enumerate(linear.free) if f.name in entry.names]
    others = [i for i in range(linear.known) if i not in own]
    found = score(less(linear.grams, linear.known), others, own, linear.count)
    return sure(entry.candidate, found, search.criteria)
