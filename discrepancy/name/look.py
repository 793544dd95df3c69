"""A look for effects: every candidate scored at the present fit, on the shortest openings that may show one."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

from discrepancy.fit.openings import Opening, opened, parts
from discrepancy.name.columns import Candidate, Kind, finer
from discrepancy.name.scan import Scan, best_of, scanned, sure
from discrepancy.name.search import Look, Search, Seen

FINEST: Final = 70
"""Trials of a grid after which it is not refined further: resonances are then as sharp as Q = 640."""


def look(search: Search, among: Kind | None = None) -> Search:
    """With the scores of every candidate, or of those ``among`` which alone it looks. What was last asked is not asked
    again."""
    number = search.shortest if search.fitter is search.whole else 1
    if number != search.number:
        search = search.opened(number)
    neutral = [a.neutral for a in search.accepted]
    asked = Look(search.library, search.fitter, search.at, among, search.present, neutral)
    if search.seen and asked.same(search.seen.look):
        return search
    view = opened(search.opening, search.at) if number > 1 else Opening(search.fitter, search.at)

    def scan_of(found: Sequence[Candidate]) -> Scan:
        return scanned(*view, neutral, found)

    scan = scan_of(search.library.candidates(*view, search.present, among))
    scored = scan.scores()
    best = best_of(scored, search.criteria)
    for candidate, result in best:
        sharper = candidate
        # A resonance or an instant on a coarse grid: ever finer about the best point, where it may matter.
        while result.probability < 0.01 and result.gain > 0.2 * best[0][1].gain and sharper.trials < FINEST:
            closer = finer(sharper)
            more = scan_of(closer).scores() if closer else []
            if not more:
                break
            scored += more
            sharper = max(more, key=lambda entry: entry[1].gain)[0]
    return replace(search, seen=Seen(asked, view, scan, scored))


def fewer_parts(search: Search) -> int:
    """Into how many parts runs are cut for longer openings, of which the present ones let expect that something
    material is sure; 1, the whole, where none are."""
    fewer = [n for n in parts(search.dataset.fit) if n < search.number]
    material = [(c, s) for c, s in search.scored if s.share >= search.criteria.material]

    def expected(number: int) -> bool:
        grown = [(c, replace(s, statistic=s.statistic * search.number / number)) for c, s in material]
        return any(sure(c, s, search.criteria) for c, s in grown)

    return next(filter(expected, fewer), 1)
