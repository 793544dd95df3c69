"""Forces that bend the response of a mass far from a linear one, and a friction beside them: in its model before
anything is fitted, since a linear fit ends at another mass, from where no column shows them."""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import combinations
from typing import Final

import numpy as np

from discrepancy.clock import OutOfTime
from discrepancy.data.linear_fit import PERIODS, fit, joined_form
from discrepancy.data.linear_start import FEW_PERIODS, Bent, bent_response
from discrepancy.data.record import is_driven
from discrepancy.data.resisted import PLAINLY as RESISTS
from discrepancy.fit.chaos import go_their_own_way
from discrepancy.fit.continuation import ASTRAY, ROUNDS, in_pieces, is_stuck, shortest, started, with_starts
from discrepancy.fit.fitted import Fitted
from discrepancy.fit.refit import Fitter, damped
from discrepancy.name.accepted import Taken
from discrepancy.name.columns import Candidate, Library
from discrepancy.name.cubic import cubic_sizes
from discrepancy.name.resistance import is_friction
from discrepancy.name.resisting import steepest_of
from discrepancy.name.resonators import all_free, fitted_from, with_all_shapes
from discrepancy.name.search import Search

FAR: Final = 0.2
"""Share of the force that a linear model leaves unexplained, from which its fit may end at another mass: at 0.12 one
was found, at 0.28 none."""
BOTH: Final = 0.02
"""The same where a friction shows beside what bends: each hides the other from a score. At 0.05 neither was found."""
LOST: Final = 0.5
"""Residual over signal, rms, from which a linear fit to pieces of a decay has lost the motion: out of step by a twelfth
of a turn. Of a decay the inertia is the force, of which a spring that bends leaves little to see."""
PLAINLY: Final = 0.25
"""Times the residual of the fit without, that one with effects leaves at most, to be taken before anything else is
scored."""
STRAIGHTER: Final = 0.25
"""Share of that which forces of third order may leave, to be what bends the response."""

SOMEWHAT: Final = 0.7
"""The same in decays, where it is the fit to whole runs that says whether they do."""
AS_LITTLE: Final = 1.5
"""Times the least that a model leaves of pieces, that one of fewer effects may leave."""


def bending(search: Search) -> Taken | None:
    """The model with those effects that are forces of third order in the motion of one axis, and a friction if there is
    one, where a weak form says that they bend the response and a fit with them leaves plainly less; None where not."""
    records, whole = search.dataset.fit, search.whole
    driven = is_driven(records)
    # In a decay, whose frequency goes with its amplitude, fewer periods are alike.
    periods = PERIODS if driven else FEW_PERIODS
    form, told = joined_form(records, search.nominal, periods=periods), bent_response(records, search.nominal, periods)
    if form is None or told is None:
        return None
    linear = fit(form, search.nominal)
    upright = all(told.linear[name] > 0 for name in ("m", "kxx", "kyy") if name in told.linear)
    far = BOTH if any(told.friction) else FAR
    straighter = told.left < (STRAIGHTER if driven else SOMEWHAT) * linear.unexplained
    if (driven and linear.unexplained < far) or not straighter or not upright:
        return None
    plain = whole.fit(replace(search.at, whiten=whole.plain(search.at.parameters)))
    if driven:
        return _of_driven(search, told, plain)
    if told.left < STRAIGHTER * linear.unexplained and (found := _of_decays(search, told, plain)):
        return found
    return _of_decays_in_step(search, told)


def _of_driven(search: Search, told: Bent, plain: Fitted) -> Taken | None:
    whole, ends = search.whole, []
    choices = _choices(search, whole, search.at, told)
    if not choices:
        return None
    *fewer, most = choices
    begun = whole.evaluated(replace(_begun(search, search.at, most, told), whiten=plain.whiten))
    likely = _begun(search, search.at, choices[0], told).parameters
    astray = whole.off(begun) > ASTRAY or go_their_own_way(whole.simulator, whole.records, likely)
    if astray and (found := _in_step(search, told, plain, choices)):
        return found
    ends.append(Taken(fitted_from(whole, begun), most, plain))
    goal = AS_LITTLE * ends[0].at.cost
    for taken in fewer:
        near = whole.evaluated(_with_only(ends[0].at, taken, most))
        ends.append(Taken(whole.fit(near, goal=goal), taken, plain))
    best = min(ends, key=lambda end: end.price(search.criteria))
    plainly = None
    if whole.off(best.at) <= PLAINLY * whole.off(plain):
        plainly = best
        # A friction as steep as it may be is smoother only now.
        with suppress(OutOfTime):
            plainly = with_all_shapes(whole, best)
    if astray or (plainly and not is_stuck(whole, plainly.at)):
        return plainly
    # Of fits that are stuck the one of more effects leaves less, needed or not.
    return _in_step(search, told, plain, choices) or plainly


def _in_step(search: Search, told: Bent, plain: Fitted, choices: Sequence[tuple[Candidate, ...]]) -> Taken | None:
    """Of ``choices`` the same where no model follows the whole runs, as in chaos: judged over the shortest pieces, and
    of those models that leave next to the least of them the one of fewest effects."""
    whole = search.whole
    for all_taken in reversed(choices):
        pieces, most = in_pieces(whole, _begun(search, search.at, all_taken, told))
        # What the weak form takes for a damping may make a device that leaves all bounds.
        if not np.isfinite(most.cost):
            continue
        linear = pieces.fit(started(pieces, plain), ROUNDS)
        if pieces.off(most) > PLAINLY * pieces.off(linear):
            continue
        some = [taken for taken in choices if all(own in all_taken for own in taken) and taken != all_taken]
        fewer = [(pieces.evaluated(_with_only(most, taken, all_taken)), taken) for taken in some]
        goal = AS_LITTLE**2 * most.cost
        ends = [*((pieces.fit(at, ROUNDS, goal), taken) for at, taken in fewer), (most, all_taken)]
        enough = AS_LITTLE * min(pieces.off(at) for at, _ in ends)
        at, taken = next((at, taken) for at, taken in ends if pieces.off(at) <= enough)
        starts = at.starts[:: len(pieces.records) // len(whole.records)]
        return Taken(whole.evaluated(replace(at, starts=starts)), taken, plain)
    return None


def _with_only(at: Fitted, taken: Sequence[Candidate], among: Sequence[Candidate]) -> Fitted:
    """``at``, without the sizes of those effects ``among`` its own that are not ``taken``."""
    gone = {p.quantity.name for own in among if own not in taken for p in own.probes}
    parameters = {name: value for name, value in at.parameters.items() if name not in gone}
    return replace(at, parameters=parameters, free=tuple(own for own in at.free if own.name not in gone))


def _of_decays(search: Search, told: Bent, plain: Fitted) -> Taken | None:
    """The same of free decays, judged over the shortest pieces: what is left to a force of third order puts it out of
    step in longer ones, and a linear model is in none."""
    whole = search.whole
    number, pieces = shortest(whole, search.at)
    linear = with_starts(pieces, search.at, ROUNDS)
    if pieces.off(linear) < LOST and not any(told.friction):
        return None
    ends = []
    for taken in _choices(search, pieces, linear, told):
        # The weak form has fitted all but the initial states.
        ends.append(Taken(with_starts(pieces, _begun(search, search.at, taken, told), ROUNDS), taken, plain))
    best = min(ends, key=lambda end: end.price(search.criteria), default=None)
    # An offset of the sensor, which is left either way here, hides no friction from the weak form.
    enough = RESISTS if any(told.friction) else PLAINLY
    if best is None or pieces.off(best.at) > enough * pieces.off(linear):
        return None
    begun = _begun(search, search.at, best.taken, told)
    found = best._replace(at=whole.evaluated(replace(begun, starts=best.at.starts[::number])))
    return found._replace(at=all_free(whole, found))


def _of_decays_in_step(search: Search, told: Bent) -> Taken | None:
    """The same where whole runs stay in step: noise leaves a weak form little to see of what bends by the width of a
    resonance, and a score sees neither of two such forces without the other."""
    whole, ends = search.whole, []
    begun = with_starts(whole, search.at, ROUNDS)
    linear = fitted_from(whole, whole.evaluated(replace(begun, free=search.at.free)))
    for taken in _choices(search, whole, linear, told):
        begun = _begun(search, linear, taken, told)
        # The weak form has fitted all but the initial states.
        starts = with_starts(whole, begun, ROUNDS).starts
        ends.append(Taken(whole.evaluated(replace(begun, starts=starts)), taken, linear))
    best = min(ends, key=lambda end: end.price(search.criteria), default=None)
    if best is None or whole.off(best.at) > PLAINLY * whole.off(linear):
        return None
    return best._replace(at=all_free(whole, best))


def _choices(search: Search, fitter: Fitter, at: Fitted, told: Bent) -> list[tuple[Candidate, ...]]:
    """The effects that are such forces, alone and together, each with the friction if there is one, or that alone."""
    library = Library(fitter)
    known = library.candidates(fitter, at, search.present, lambda e: bool(cubic_sizes(e, told.cubic)))
    frictions = library.candidates(fitter, at, search.present, is_friction) if any(told.friction) else []
    rubs = tuple(steepest_of(frictions).values())
    counts = range(0 if rubs else 1, len(known) + 1)
    return [(*own, *rubs) for count in counts for own in combinations(known, count)]


def _begun(search: Search, at: Fitted, taken: Sequence[Candidate], told: Bent) -> Fitted:
    """``at`` with the forces of ``told``."""
    values, free = {**at.parameters, **damped(told.linear, search.nominal)}, [*at.free]
    for own in taken:
        values |= {**own.shapes, **_sizes(own, told)}
        # As steep as it is: while the rest is far off a fit would smooth a friction, and end there.
        free += [probe.free() for probe in own.probes]
    return replace(at, parameters=values, free=tuple(free))


def _sizes(own: Candidate, told: Bent) -> dict[str, float]:
    """Sizes of what is ``told``, by name."""
    if is_friction(own.effect):
        return {p.quantity.name: size for p, size in zip(own.probes, told.friction, strict=True)}
    sizes = cubic_sizes(own.effect, told.cubic)
    return {p.quantity.name: sizes[p.quantity.name] for p in own.probes}
