"""Several effects that could be what is missing: each is refitted, and the best told from the others."""

from collections.abc import Sequence
from math import inf
from typing import Final

import numpy as np
from scipy.stats import chi2

from discrepancy.criteria import Criteria
from discrepancy.fit.continuation import IN_STEP, LAST_ROUNDS, beginnings, grown, leaves, whitened
from discrepancy.fit.defect import Defect
from discrepancy.fit.fitted import Fitted
from discrepancy.fit.locate import no_noise
from discrepancy.fit.openings import LONG, Opening, opened
from discrepancy.fit.refit import AS_PROMISED, Fitter
from discrepancy.name.accepted import RIVALS, Refit
from discrepancy.name.columns import Candidate, Fading, Probe, fading, without_part
from discrepancy.name.scan import Scored, next_peaks, other_forms, scanned
from discrepancy.name.search import Search
from gyro_model.anatomy import Force

RIVAL_SHARE: Final = 0.5
"""A rival is refitted, where the simulation is not close, if it takes at least this part of the best one's share of the
residual: there, linear scores tell half the truth."""
WEAK: Final = 0.999
"""Share of what is surely no noise in the residual, below which an effect may only imitate what is missing, or be a
part of it: of motions near a sine x² x' took 0.977 of what a drag x'|x'| makes, and 0.998 of a drag x'³."""
HALF: Final = 0.5
"""Of what an effect leaves of that, a term has to take so much besides all that the effect takes, to come before it."""
PART: Final = 1e-2
"""Of its usual size, by which a part of an effect that may vanish is probed: so little that its square is no matter."""


def rivals(search: Search, worth: list[Scored]) -> list[Scored]:
    """Those whose refit could be the best, all that the linear scores leave open, in the order of their refits.

    A plain one is soon fitted, and tells one that has shapes, which could imitate it, how far it has to come; of an
    effect and a defect of the record that promise the same the effect is named, of a force on the mass and the
    electronics the electronics (``best_refit``).
    """
    return sorted(_close(search, worth), key=lambda entry: (len(entry[0].searched), _of_record(entry[0]),
                                                            isinstance(entry[0].effect, Force)))  # fmt: skip


def _close(search: Search, worth: list[Scored]) -> list[Scored]:
    even, simpler = search.criteria.even, search.criteria.simpler
    best = max((s for _, s in worth), key=lambda s: s.gain - simpler * s.freedom)
    top = best.gain - simpler * best.freedom
    share = max(s.share for _, s in worth)
    linear = search.view.fitter.off(search.view.at) < IN_STEP

    def open_still(entries: Sequence[Scored]) -> list[Scored]:
        if not linear:
            return [(c, s) for c, s in entries if s.share >= RIVAL_SHARE * share]
        least = [top - 4 * even * max(s.inflation, best.inflation) - 0.1 * top for _, s in entries]
        return [(c, s) for (c, s), low in zip(entries, least, strict=True) if s.gain - simpler * s.freedom >= low]

    first = open_still(worth)[:RIVALS]
    peaks = [peak for c, _ in first for peak in open_still(next_peaks(c, search.scored))[:1]]
    forms = [form for c, _ in first for form in open_still(other_forms(c, search.scored))]
    # One of equal height with the best of its grid may be both.
    return list({id(c): (c, s) for c, s in (*first, *peaks, *forms)}.values())


def refitted(
    search: Search, view: Opening, begun: Sequence[Refit], *, elsewhere: bool = False, rounds: int = LAST_ROUNDS
) -> list[Refit]:
    """Each fitted, or one of those that begin ``elsewhere``; one that can't come near the best so far, or be
    significant, is left where that shows. Where columns promise what a fit then brings, one without shapes that
    promises no more is not fitted: which of the two it is, is asked when all else is in the model (``exchange``)."""
    fits: list[Refit] = []
    brought: dict[str, float] = {}
    for fit in begun:
        own = fit.candidate.effect.id
        promised = fit.score.gain - price(search.criteria, fit.candidate, fit.score.freedom)
        # Of orders of one filter, which small lags do not tell apart, each is fitted here or never.
        others = max((gain for name, gain in brought.items() if name != own), default=-inf)
        if promised < others + search.criteria.even and _linear(fit.candidate):
            continue
        enough = view.at.cost - _needed(search.criteria, fit) * view.at.variance
        goal = min((f.at.cost + 4 * search.criteria.even * f.at.variance for f in fits), default=enough)
        ends = [view.of(fit.at, goal, rounds)]
        ends += _otherwise(search, view, fit, goal, fits) if elsewhere else []
        fits.append(fit._replace(at=_simplest(search.criteria, ends, fit.score.inflation)))
        gained = (view.at.cost - fits[-1].at.cost) / fits[-1].at.variance
        if _linear(fit.candidate) and abs(gained / fit.score.gain - 1) < AS_PROMISED:
            brought[own] = max(brought.get(own, -inf), promised)
    # A fit that predicts a sample ahead what the model lacks may leave the motion: by that no effect is missing. What
    # a model in step lacks besides takes it as far: an angular gain without the cubic spring, from 0.011 to 0.020.
    return [fit for fit in fits if not leaves(view.fitter, fit.at, view.at)]


def _simplest(criteria: Criteria, ends: Sequence[Fitted], inflation: float) -> Fitted:
    """The best of fits of one effect; a part of it that may vanish has to earn its parameters, where chance brings
    ``inflation`` times what it brings of white noise."""
    best = min(ends, key=lambda at: at.cost)
    owed = criteria.simpler * inflation * best.variance
    return min(ends, key=lambda at: at.cost + owed * len(at.free)) if best.cost < np.inf else best


def _otherwise(search: Search, view: Opening, fit: Refit, goal: float, before: Sequence[Refit]) -> list[Fitted]:
    """Fits that begin elsewhere, where one of all parameters at once may end in a wrong minimum: of a resonance
    from where it is broad, of a force with a part that may vanish from where it has, unless one ``before`` did."""
    part = fading(fit.candidate)
    if part is not None:
        begun = fit.candidate.effect.id in {other.candidate.effect.id for other in before}
        return [] if begun else _in_stages(search, view, fit, goal, part)
    resonant = any(q.search is not None and q.search.kind == "resonance" for q in fit.candidate.searched)
    if search.fitter is not search.whole or not resonant:
        return []
    return [view.of(grown(view.fitter, fit.at), goal)]


def _in_stages(search: Search, view: Opening, fit: Refit, goal: float, part: Fading) -> list[Fitted]:
    """The effect without a part of it, then that part where it shows most beside."""
    plain = view.of(search.with_effect(view.fitter, view.at, without_part(fit.candidate, part), fit.score))
    best = most_of_part(search, Opening(view.fitter, plain), fit.candidate, part)
    if best is None or best[1].gain < search.criteria.simpler * (1 + len(part.shapes)):
        return [plain]
    return [plain, view.of(search.with_effect(view.fitter, plain, *best), goal)]


def most_of_part(search: Search, view: Opening, candidate: Candidate, part: Fading) -> Scored | None:
    """Where on its grid a part of the effect that may vanish shows most, beside a fit that has none; None where it
    shows nowhere."""
    points = search.library.grids.wider(part.shapes, candidate.shapes)
    probe = Probe(part.size, part.size.typical * PART, 1)
    found = [Candidate(candidate.effect, (probe,), point, part.shapes, len(points)) for point in points]
    # A damping that stands in for what is missing has gone to its bound: it can take nothing up.
    stuck = {f.name for f in view.at.free if view.at.parameters[f.name] in (f.low, f.high)}
    stuck |= {"dxy"} if stuck & {"dxx", "dyy"} else set()
    beside = [i for i, f in enumerate(view.at.free) if f.name not in stuck]
    scored = scanned(view.fitter, view.at, [], found).scores(beside)
    return max(scored, key=lambda entry: entry[1].gain, default=None)


def longer(search: Search, view: Opening, *, sole: bool) -> Opening:
    """Longer openings, or the whole runs, where rivals are told apart; for a ``sole`` one the whole."""
    number = len(search.whole.records[0].t) // len(view.fitter.records[0].t) // LONG
    if sole or number < 2 or search.fitter is not search.whole:
        return Opening(search.fitter, search.at)
    return opened(beginnings(search.whole, number), search.at)


def best_refit(criteria: Criteria, view: Opening, fits: Sequence[Refit]) -> Refit | None:
    """The best of ``fits``; None where it is not worth it."""
    # Where nothing tells two apart the electronics are more often at fault than a force on the mass.
    best = min(near(criteria, fits, 1.0), key=lambda fit: isinstance(fit.candidate.effect, Force), default=None)
    worth = best is not None and view.at.count * (view.at.unlikely - best.at.unlikely) > _needed(criteria, best)
    return best if worth else None


def own_filter(fitter: Fitter, at: Fitted) -> Fitted:
    """``at`` under the filter that its own residuals ask for, where the one it has takes motion for noise: that of a
    model that lacks something hides in what one rival is right and another wrong."""
    return whitened(fitter, at) if at.whiten.setting.bandwidth and at.cost < np.inf else at


def _needed(criteria: Criteria, fit: Refit) -> float:
    """What an effect has to take to be significant, as a chi-square."""
    chance = criteria.effect_chance / fit.candidate.trials
    return float(chi2.isf(chance, fit.score.freedom)) * fit.score.inflation


def weak(search: Search, view: Opening, best: Refit) -> float:
    """The share of what is surely no noise that a term has to take to come before the best effect; 0 where that is no
    effect of a file, or takes nearly all of it, alone or with another: beside an offset |x| takes more than x² does. A
    motion that a filter tracks is no noise here: it may be what is missing."""
    if best.candidate.effect.id in {term.id for own in search.terms for term in own}:
        return 0.0
    before, after = view.fitter.still(view.at), view.fitter.still(best.at)
    surely = no_noise(before, view.fitter.records)
    taken = (before.cost - after.cost) / surely if surely > 0 else 1.0
    together = search.seen.scan.together(best.candidate) if search.seen and taken < WEAK else 0.0
    return max(taken + HALF * (1 - taken), together) if max(taken, together) < WEAK else 0.0


def near(criteria: Criteria, fits: Sequence[Refit], chi_square: float) -> list[Refit]:
    """Those whose likelihood and price are within so much of the best's; none where no motion stays within bounds."""
    fits = [fit for fit in fits if np.isfinite(fit.at.cost)]
    prices = [
        fit.at.count * fit.at.unlikely
        + price(criteria, fit.candidate, fit.score.freedom)
        + price_of_shapes(criteria, fit.candidate)
        for fit in fits
    ]
    return [fit for fit, own in zip(fits, prices, strict=True) if own < min(prices) + chi_square]


def price(criteria: Criteria, candidate: Candidate, sizes: int) -> float:
    """What so many sizes have to earn, as a chi-square; a defect of the record a little more, so that where it
    can't be told from an effect the effect is named."""
    more = criteria.even if _of_record(candidate) else 0.0
    return criteria.simpler * sizes + more


def price_of_shapes(criteria: Criteria, candidate: Candidate) -> float:
    """The same of the shapes that are fitted with them: of two names that are even the plainer stands first. How
    probable each is does not hang on it: a shape that data hardly show is as free as none."""
    return criteria.simpler * len(candidate.searched)


def _of_record(candidate: Candidate) -> bool:
    return isinstance(candidate.effect, Defect)


def _linear(candidate: Candidate) -> bool:
    """Whether the voltage changes in proportion to all that a fit moves, where that is small. Of a size that is tried
    far from neutral too the columns promise more than small steps do, and say nothing of what those of others do."""
    near = all(p.power == 1 and p.quantity.search is None for p in candidate.probes)
    return near and not candidate.searched and not candidate.partner
