"""Resonators that a mass carries: in its model before anything else is scored, since a linear fit ends at the mass of
one mode an axis, beside which no column shows another."""

from collections.abc import Sequence
from contextlib import suppress

from discrepancy.clock import OutOfTime
from discrepancy.data.absorbers import Carried, carried
from discrepancy.data.courses import beside as beside_courses
from discrepancy.data.courses import left_by, may_act, views
from discrepancy.data.inverse import structures
from discrepancy.data.modes import Mode
from discrepancy.data.record import Record, is_driven
from discrepancy.data.speeds import are_displacements, as_speeds
from discrepancy.name.accepted import Taken
from discrepancy.name.resonators import begun_with, beside, fitted_from, price, resonators, with_all_shapes
from discrepancy.name.search import Search


def resonating(search: Search) -> Taken | None:
    """The model with a resonator for each further mode of the runs, as far as there are files for them, where these
    answer as a mass that carries them and a fit with them leaves plainly less; None where not."""
    records, whole = search.dataset.fit, search.whole
    gains = [search.nominal[f"sense_gain_{axis}"] for axis in "xy"[: whole.axes]]
    if not is_driven(records):
        return None
    first, further = search.given.modes
    answers = _answers(records, sorted([*first, *further]), gains)
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
    shaped = best
    with suppress(OutOfTime):
        shaped = with_all_shapes(held, best)
    # A friction may become so steep over openings that no whole run ends in time.
    return against.taken(search, shaped) or against.taken(search, None if shaped is best else best)


def _answers(records: Sequence[Record], modes: Sequence[Mode], gains: Sequence[float]) -> list[Carried]:
    """What the mass carries by its response to the force, and by the force that its motion asks for where it may
    rub."""
    found = []
    if len(modes) > len(gains):
        shown = [*views(records, modes), *(views(as_speeds(records), modes) if are_displacements(records) else ())]
        found += [told for own in shown if (told := carried(own, modes, gains))]
    if len(gains) == 1 and may_act(left_by(records, modes), beside_courses(records, ("friction",)), modes):
        found += structures(records, gains[0])
    return found
