"""Resonators that a mass carries: in its model before anything else is scored, since a linear fit ends at the mass of
one mode an axis, beside which no column shows another."""

from contextlib import suppress

from discrepancy.clock import OutOfTime
from discrepancy.data.absorbers import carried
from discrepancy.data.courses import views
from discrepancy.data.record import is_driven
from discrepancy.data.speeds import are_displacements, as_speeds
from discrepancy.name.accepted import Taken
from discrepancy.name.resonators import begun_with, beside, fitted_from, price, resonators, with_all_shapes
from discrepancy.name.search import Search


def resonating(search: Search) -> Taken | None:
    """The model with a resonator for each further mode of the runs, as far as there are files for them, where these
    answer as a mass that carries them and a fit with them leaves plainly less; None where not."""
    records, whole = search.dataset.fit, search.whole
    gains = [search.nominal[f"sense_gain_{axis}"] for axis in "xy"[: whole.axes]]
    first, further = search.given.modes
    modes = sorted([*first, *further])
    if not (is_driven(records) and len(modes) > whole.axes):
        return None
    shown = [*views(records, modes), *(views(as_speeds(records), modes) if are_displacements(records) else ())]
    answers = [told for own in shown if (told := carried(own, modes, gains))]
    found = [(told, taken) for told in answers if (taken := resonators(search, told))]
    if not found:
        return None
    against = beside(search)
    near, held, without = against.near, against.near.held(), against.without
    starts = [
        begun_with(search, near, told, taken, without, jointed=own) for told, taken in found for own in (False, True)
    ]
    nearer, other, *_ = sorted(starts, key=lambda own: near.off(own.at))
    ends = [nearer._replace(at=fitted_from(held, nearer.at))]
    # Without the time for both, that which was nearer to begin with stands.
    with suppress(OutOfTime):
        ends.append(other._replace(at=fitted_from(held, other.at)))
    best = min(ends, key=lambda own: price(search, own))
    with suppress(OutOfTime):
        best = with_all_shapes(held, best)
    return against.taken(search, best)
