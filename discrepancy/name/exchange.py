"""What was accepted is held against others beside all else that is in the model: could it go, or give way?"""

from dataclasses import replace
from functools import partial
from typing import Final

import numpy as np
from scipy.stats import chi2

from discrepancy.fit.continuation import LAST_ROUNDS, ROUNDS, beginnings, leaves, nearly_settled
from discrepancy.fit.defect import Defect
from discrepancy.fit.fitted import Fitted
from discrepancy.fit.openings import LEAST, opened, parts
from discrepancy.name.accepted import RIVALS, Accepted, Instead
from discrepancy.name.columns import Kind, fading, without_part
from discrepancy.name.competition import own_filter, price, price_of_shapes
from discrepancy.name.lagging import other_lags
from discrepancy.name.look import look
from discrepancy.name.resisting import alike, other_resistances
from discrepancy.name.scan import Scan, Scored, best_of, other_forms
from discrepancy.name.score import Score, score, taken_up
from discrepancy.name.search import Search, attempt
from gyro_model.anatomy import Force

CLEAR: Final = 30.0
"""Times the gain that an effect needs to stay, from which no refit without it is tried: what is not linear in it does
not make up for so much."""
ALIKE: Final = 4.0
"""Times the square that a constant force leaves of a motion one way, up to which friction may be what it is, and the
other way round: where the mass sets out the friction of the model is smoother than that of a bearing."""

QUARTER: Final = 4
"""Parts of a run in the first of which others are tried in the place of an effect with states of its own."""


def finish(search: Search) -> Search:
    """With all that was accepted held against others, as far as the time goes."""
    for place in range(len(search.accepted)):
        what = f"refit without a part of {search.accepted[place].id}"
        search = attempt(search, what, partial(fade, place=place))
    # A term in no file may make a name needless: first each is held against the others.
    return delete(exchange(search)) if search.terms else exchange(delete(search))


def fade(search: Search, place: int) -> Search:
    """Without the part of an effect that may vanish, where its interval holds that it has."""
    entry = search.accepted[place]
    part = fading(entry.candidate)
    deviation = search.fitter.deviations(search.at).get(part.size.name, 0.0) if part else 0.0
    if part is None or search.at.parameters[part.size.name] >= 1.96 * deviation:
        return search
    free = tuple(f for f in search.at.free if f.name not in part.names)
    begun = replace(search.at, parameters={**search.at.parameters, part.size.name: 0.0}, free=free)
    search = search.fitted(search.fitter.evaluated(begun), nearly_settled)
    return search.changed(place, replace(entry, candidate=without_part(entry.candidate, part)))


def delete(search: Search, among: Kind | None = None) -> Search:
    """Backward deletion: without each effect that the others have made needless. among: of these alone."""
    for entry in search.accepted:
        if len(search.accepted) < 2 or search.late:
            break
        # It may have got the name of one that went.
        if entry in search.accepted and (not among or among(entry.candidate.effect)):
            without = partial(_without_needless, entry=entry, among=among)
            search = attempt(search, f"refit without {entry.id}", without)
    return search


def _without_needless(search: Search, entry: Accepted, among: Kind | None) -> Search:
    search = _looked(search, among)
    chance = search.criteria.effect_chance / entry.candidate.trials
    needed = chi2.isf(chance, len(entry.candidate.probes)) * search.at.variance
    enough = CLEAR * max(needed, search.criteria.material * search.at.cost)
    if _takes(search, entry).gain * search.at.variance > enough:
        return search
    goal = max(search.at.cost + needed, search.at.cost / (1 - search.criteria.material))
    fitted = search.fitter.fit(_begun_without(search, entry), goal=goal)
    search.simulator.clock.check()
    # Where a filter predicts a sample ahead the cost may hardly rise while the motion is lost.
    if fitted.cost >= goal or leaves(search.fitter, fitted, search.at):
        return search
    search.progress(f"deleted {entry.id}")
    return first_of_its_kind(search.lacking(entry).fitted(fitted), entry)


def first_of_its_kind(search: Search, gone: Accepted) -> Search:
    """Where ``gone`` was the first of two of a kind, the other has its name."""
    for place, entry in enumerate(search.accepted):
        copy = search.given.copies.get(entry.id)
        if copy and copy.further and copy.after == gone.id:
            own = zip(entry.candidate.effect.parameters, gone.candidate.effect.parameters, strict=True)
            names = {mine.name: first.name for mine, first in own}
            p = {name: value for name, value in search.at.parameters.items() if name not in names.values()}
            free = tuple(replace(f, name=names.get(f.name, f.name)) for f in search.at.free)
            moved = replace(search.at, parameters={names.get(n, n): v for n, v in p.items()}, free=free)
            search.fitter.forget()
            at = replace(search.fitter.evaluated(moved), left=search.at.left)
            renamed = replace(entry, candidate=entry.candidate.renamed(gone.candidate.effect, names))
            search = replace(search.changed(place, renamed), at=at)
    return search


def exchange(search: Search, among: Kind | None = None) -> Search:
    """Could another effect stand in the place of each? One that fits better takes it, one that fits as well is its
    ``either``. among: of these alone, while the search goes on."""
    partners = search.partners
    for place, entry in enumerate(search.accepted):
        if entry.id not in partners and (not among or among(entry.candidate.effect)):
            step = partial(_exchange_one, place=place, among=among)
            search = attempt(search, f"rivals of {entry.id}", step)
    return search


def _exchange_one(search: Search, place: int, among: Kind | None) -> Search:
    search, entry = _looked(search, among), search.accepted[place]
    instead = _refitted_instead(search, entry, among)
    fits = {entry.id: (search.at, entry.candidate), **instead.fits}
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
    at, candidate = fits.pop(head)
    tried = {**search.instead, entry.id: instead}
    if head != entry.id:
        tried[head] = Instead(at.parameters, [*instead.tried, (entry.id, entry.candidate.shapes)], fits)
    search = replace(search, at=at, instead=tried)
    close = costs[head] + search.criteria.even
    # One with fewer parameters that is as probable though it fits a little worse is told from the name by no data.
    even = {i: dict(own.parameters) for i, (own, _) in fits.items() if costs[i] < close or prices[i] <= prices[head]}
    behind = {i: prices[i] - prices[head] for i in fits}
    # How the smoothed friction of the model sets out tells it from none that is sharper.
    same = [i for i in fits if i in alike(search, {entry.id, *entry.rivals})]
    even |= {i: dict(fits[i][0].parameters) for i in same}
    behind |= {i: min(behind[i], 0.0) for i in same}
    return search.changed(place, Accepted(candidate, entry.share, even, behind, entry.asked or not among))


def _refitted_instead(search: Search, entry: Accepted, among: Kind | None) -> Instead:
    """What was tried in the place of ``entry``, with the effects that fit nearly as well, or better."""
    stand_ins, rounds = _stand_ins(search, entry), ROUNDS if among else LAST_ROUNDS
    before = search.instead.get(entry.id)
    known = before if before and before.beside == search.at.parameters else Instead(search.at.parameters, [], {})
    stand_ins = [(c, s) for c, s in stand_ins if (c.effect.id, c.shapes) not in known.tried]
    if not stand_ins:
        return known
    fits = dict(known.fits)
    goal = search.at.cost + search.criteria.even * search.at.variance
    same = alike(search, {entry.id, *entry.rivals})
    base, number = search.without_effect(search.at, entry), _trial_parts(search, entry)
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
    return Instead(search.at.parameters, tried, fits)


def _trial_parts(search: Search, entry: Accepted) -> int:
    """Into how many parts runs are cut, in the first of which others are tried in the place of an effect. Of one with
    states of its own in a quarter: beside these each fit of whole runs is dear, and next to no other is near."""
    number, shortest = parts(search.fitter.records)[0], min(len(record.t) for record in search.fitter.records)
    effect = entry.candidate.effect
    stateful = isinstance(effect, Force) and bool(effect.states)
    return QUARTER if number == 1 and stateful and shortest >= QUARTER * LEAST else number


def _looked(search: Search, among: Kind | None) -> Search:
    """With scores at the present fit of all that is ``among`` those which are asked for."""
    seen = search.seen
    if seen and seen.scan.at.parameters == search.at.parameters and seen.look.among in (None, among):
        return search
    return look(replace(search, shortest=1), among)


def _beside(scan: Scan, entry: Accepted) -> list[int]:
    """The columns of a scan's fit that are not the effect's."""
    return [i for i, f in enumerate(scan.at.free) if f.name not in entry.names]


def _takes(search: Search, entry: Accepted) -> Score:
    """What the present fit, which was looked at, would lose without an effect, to first order, the other parameters
    taking up what they can."""
    assert search.seen
    scan = search.seen.scan
    others = _beside(scan, entry)
    own = [i for i in range(scan.at.known) if i not in others]
    return score(scan.grams(scan.at, search.accepted.index(entry)), others, own, search.at.count)


def _begun_without(search: Search, entry: Accepted) -> Fitted:
    """The present fit, which was looked at, without an effect, to be fitted: as it is, or where others have taken up
    what they can, to first order: a delay what a filter has delayed."""
    begun = search.without_effect(search.at, entry)
    assert search.seen
    scan = search.seen.scan
    others = _beside(scan, entry)
    total = scan.grams(scan.at, search.accepted.index(entry)).sum(axis=0)
    moved = dict(begun.parameters)
    for i, step in zip(others, taken_up(total, others, (), ()), strict=True):
        own = scan.at.free[i]
        moved[own.name] = own.bounded(moved[own.name], moved[own.name] + float(step) * own.step)
    return min(begun, search.fitter.evaluated(replace(begun, parameters=moved)), key=lambda at: at.cost)


def _stand_ins(search: Search, entry: Accepted) -> list[Scored]:
    """Effects that explain what ``entry`` does nearly as well, by their columns at the present fit."""
    assert search.seen
    least, scan = _takes(search, entry), search.seen.scan
    others = _beside(scan, entry)
    further = {name for name, copy in search.given.copies.items() if copy.further and copy.after == entry.id}
    scored = scan.scores(others, search.accepted.index(entry))
    enough = least.gain - 4 * search.criteria.even * least.inflation - 0.1 * least.gain
    near = [(c, s) for c, s in scored if s.gain > enough and c.effect.id not in further]
    best = best_of(near, search.criteria)[:RIVALS]
    forms = [form for c, _ in best for form in other_forms(c, near)]
    return [*other_resistances(search, entry, scored), *best, *forms, *other_lags(search, entry, scored)]
