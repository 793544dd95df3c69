"""What was accepted is held against others beside all else that is in the model: could it go, or give way?"""

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Final

import numpy as np
from scipy.stats import chi2

from discrepancy.fit.continuation import LAST_ROUNDS, ROUNDS, beginnings, leaves, nearly_settled
from discrepancy.fit.defect import Defect
from discrepancy.fit.fitted import Fitted
from discrepancy.fit.openings import opened, parts
from discrepancy.name.accepted import RIVALS, Accepted, Instead
from discrepancy.name.columns import Candidate, Kind, fading, without_part
from discrepancy.name.competition import own_filter, price, price_of_shapes
from discrepancy.name.resisting import alike, other_resistances
from discrepancy.name.scan import Scored, best_of, other_forms
from discrepancy.name.score import Score, score

if TYPE_CHECKING:
    from discrepancy.name.search import Search

CLEAR: Final = 30.0
"""Times the gain that an effect needs to stay, from which no refit without it is tried: what is not linear in it does
not make up for so much."""
ALIKE: Final = 4.0
"""Times the square that a constant force leaves of a motion one way, up to which friction may be what it is, and the
other way round: where the mass sets out the friction of the model is smoother than that of a bearing."""


def fade(search: "Search", place: int) -> None:
    """Takes out of an effect the part that may vanish, where its interval holds that it has."""
    entry = search.accepted[place]
    part = fading(entry.candidate)
    deviation = search.fitter.deviations(search.at).get(part.size.name, 0.0) if part else 0.0
    if part is None or search.at.parameters[part.size.name] >= 1.96 * deviation:
        return
    candidate = without_part(entry.candidate, part)
    free = tuple(f for f in search.at.free if f.name not in part.names)
    begun = replace(search.at, parameters={**search.at.parameters, part.size.name: 0.0}, free=free)
    search.go_on(search.fitter.evaluated(begun), nearly_settled)
    search.accepted[place] = replace(entry, candidate=candidate)


def delete(search: "Search", among: Kind | None = None) -> None:
    """Backward deletion: without each effect that the others have made needless. among: of these alone."""
    for entry in list(search.accepted):
        if len(search.accepted) < 2 or search.late:
            break
        # It may have got the name of one that went.
        if entry not in search.accepted or (among and not among(entry.candidate.effect)):
            continue
        search.attempt(f"refit without {entry.id}", partial(_delete_needless, search, entry, among))


def _delete_needless(search: "Search", entry: Accepted, among: Kind | None) -> None:
    chance = search.criteria.effect_chance / entry.candidate.trials
    needed = chi2.isf(chance, len(entry.candidate.probes)) * search.at.variance
    if _takes(search, entry, among).gain * search.at.variance > CLEAR * max(
        needed, search.criteria.material * search.at.cost
    ):
        return
    fitted = search.fitter.fit(search.without_effect(search.at, entry))
    search.simulator.clock.check()
    gain = fitted.cost - search.at.cost
    # Where a filter predicts a sample ahead the cost may hardly rise while the motion is lost.
    lost = leaves(search.fitter, fitted, search.at)
    if not lost and (gain < needed or gain < search.criteria.material * fitted.cost):
        search.progress(f"deleted {entry.id}")
        search.accepted.remove(entry)
        search.go_on(fitted)
        first_of_its_kind(search, entry)


def first_of_its_kind(search: "Search", gone: Accepted) -> None:
    """Where ``gone`` was the first of two of a kind, the other has its name."""
    for place, entry in enumerate(search.accepted):
        copy = search.copies.get(entry.id)
        if copy and copy.further and copy.after == gone.id:
            own = zip(entry.candidate.effect.parameters, gone.candidate.effect.parameters, strict=True)
            names = {mine.name: first.name for mine, first in own}
            p = {name: value for name, value in search.at.parameters.items() if name not in names.values()}
            free = tuple(replace(f, name=names.get(f.name, f.name)) for f in search.at.free)
            moved = replace(search.at, parameters={names.get(n, n): v for n, v in p.items()}, free=free)
            search.fitter.forget()
            search.at = replace(search.fitter.evaluated(moved), left=search.at.left)
            search.accepted[place] = replace(entry, candidate=entry.candidate.renamed(gone.candidate.effect, names))


def exchange(search: "Search", among: Kind | None = None) -> None:
    """Could another effect stand in the place of each? One that fits better takes it, one that fits as well is its
    ``either``. among: of these alone, while the search goes on."""
    partners = search.partners
    for place, entry in enumerate(search.accepted):
        if entry.id in partners or (among and not among(entry.candidate.effect)):
            continue
        search.attempt(f"rivals of {entry.id}", partial(_exchange_one, search, place, entry, among))


def _exchange_one(search: "Search", place: int, entry: Accepted, among: Kind | None) -> None:
    fits = {entry.id: (search.at, entry.candidate), **_refitted_instead(search, entry, among)}
    if len(fits) > 1:
        fits = {i: (own_filter(search.fitter, at), c) for i, (at, c) in fits.items()}
    search.simulator.clock.check()
    costs = {i: at.count * at.unlikely for i, (at, _) in fits.items()}
    prices = {i: costs[i] + price(search.criteria, c, len(c.all_probes)) for i, (_, c) in fits.items()}
    plain = {i: prices[i] + price_of_shapes(search.criteria, c) for i, (_, c) in fits.items()}
    head = min(plain, key=lambda i: plain[i])
    # Of an effect and a defect of the record that are even the effect is named, whichever came first.
    owed = 0.0 if entry.of_record and not isinstance(fits[head][1].effect, Defect) else search.criteria.even
    if plain[head] > plain[entry.id] - owed:
        head = entry.id
    search.at, candidate = fits.pop(head)
    if head != entry.id and entry.id in search.instead:
        tried = [*search.instead[entry.id].tried, (entry.id, entry.candidate.shapes)]
        search.instead = {**search.instead, head: Instead(search.at.parameters, tried, fits)}
    close = costs[head] + search.criteria.even
    # One with fewer parameters that is as probable though it fits a little worse is told from the name by no data.
    even = {i: dict(at.parameters) for i, (at, _) in fits.items() if costs[i] < close or prices[i] <= prices[head]}
    behind = {i: prices[i] - prices[head] for i in fits}
    # How the smoothed friction of the model sets out tells it from none that is sharper.
    same = [i for i in fits if i in alike(search, {entry.id, *entry.rivals})]
    even |= {i: dict(fits[i][0].parameters) for i in same}
    behind |= {i: min(behind[i], 0.0) for i in same}
    search.accepted[place] = Accepted(candidate, entry.share, even, behind, entry.asked or not among)


def _refitted_instead(search: "Search", entry: Accepted, among: Kind | None) -> dict[str, tuple[Fitted, Candidate]]:
    """By id the effects that fit nearly as well in the place of ``entry``, or better."""
    stand_ins, rounds = _stand_ins(search, entry, among), ROUNDS if among else LAST_ROUNDS
    before = search.instead.get(entry.id)
    known = before if before and before.beside == search.at.parameters else Instead(search.at.parameters, [], {})
    stand_ins = [(c, s) for c, s in stand_ins if (c.effect.id, c.shapes) not in known.tried]
    fits = dict(known.fits)
    if not stand_ins:
        return fits
    goal = search.at.cost + search.criteria.even * search.at.variance
    same = alike(search, {entry.id, *entry.rivals})
    base, number = search.without_effect(search.at, entry), parts(search.fitter.records)[0]
    trial = opened(beginnings(search.fitter, number), search.at) if number > 1 else None
    least = trial.at.cost + 4 * search.criteria.even * trial.at.variance if trial else np.inf
    for candidate, result in stand_ins:
        begun = search.with_effect(search.fitter, base, candidate, result)
        if trial and trial.of(begun, least).cost > least:
            continue
        search.progress(f"{candidate.effect.id} in place of {entry.id}")
        enough = ALIKE * search.at.cost if candidate.effect.id in same else goal
        at = search.fitter.fit(begun, rounds, enough)
        best = fits[candidate.effect.id][0].cost if candidate.effect.id in fits else np.inf
        if at.cost < min(enough, best) and not leaves(search.fitter, at, search.at):
            fits[candidate.effect.id] = at, candidate
    if trial:
        search.simulator.forget(trial.fitter.records)
    tried = [*known.tried, *((c.effect.id, c.shapes) for c, _ in stand_ins)]
    search.instead = {**search.instead, entry.id: Instead(search.at.parameters, tried, fits)}
    return dict(fits)


def _takes(search: "Search", entry: Accepted, among: Kind | None) -> Score:
    """What the present fit would lose without an effect, to first order, the other parameters taking up what they
    can."""
    if search.scan.at.parameters != search.at.parameters or search.among not in (None, among):
        search.shortest = 1
        search.look(among)
    linear = search.scan.at
    own = [i for i, f in enumerate(linear.free) if f.name in entry.names]
    others = [i for i in range(linear.known) if i not in own]
    return score(search.scan.grams(linear, search.accepted.index(entry)), others, own, search.at.count)


def _stand_ins(search: "Search", entry: Accepted, among: Kind | None) -> list[Scored]:
    """Effects that explain what ``entry`` does nearly as well, by their columns at the present fit."""
    least = _takes(search, entry, among)
    others = [i for i, f in enumerate(search.scan.at.free) if f.name not in entry.names]
    further = {name for name, copy in search.copies.items() if copy.further and copy.after == entry.id}
    scored = search.scan.scores(others, search.accepted.index(entry))
    enough = least.gain - 4 * search.criteria.even * least.inflation - 0.1 * least.gain
    near = [(c, s) for c, s in scored if s.gain > enough and c.effect.id not in further]
    best = best_of(near, search.criteria)[:RIVALS]
    forms = [form for c, _ in best for form in other_forms(c, near)]
    return [*other_resistances(search, entry, scored), *best, *forms]
