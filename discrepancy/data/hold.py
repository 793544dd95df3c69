"""How the force ran between samples, by the response to it.

A force that is held until the next sample acts half a sample later than one that runs on between them, as a generator's
does that was recorded beside the sensor. No mass, spring or damper imitates half a sample over a band.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Final, NamedTuple, get_args

from discrepancy.data.linear_fit import LOWEST, is_held
from discrepancy.data.linear_start import response
from discrepancy.data.modes import answering
from discrepancy.data.record import Hold, Record, is_driven
from discrepancy.data.residues import answered
from discrepancy.data.resisted import Resisted, alternatives, fewest, leaves_noise

RUNS_ON: Final[Hold] = "band-limited"
"""How a force runs on between samples that nobody has said a word about."""
DECISIVE: Final = 3.0
"""Times less of the force that another hold must leave unexplained. Measured on 14 devices, ten of them not linear: a
wrong one leaves 9 times what the right one leaves where the right one explains nearly all, and 0.96 times at the least
where a further mode or a strong effect covers it."""
ENOUGH: Final = 0.05
"""Share above which the other hold explains too little to be believed."""
OF_MODES, MOST_OF_MODES = 1.25, 0.2
"""The same two where several modes explain the response: of 47 structures, 18 of which rub, the wrong hold leaves 1.07
to 36 times what the right one leaves, which is 0.003 to 0.2."""


SURE: Final = 100.0
"""Variances of noise by which what a mass that no spring holds leaves must differ, where it leaves nothing else."""


class Better(NamedTuple):
    """A hold that explains the response better than the one that is given, and the shares of the force, or, of more
    modes than one an axis, of the voltage, that both leave unexplained."""

    hold: Hold
    left: float
    given: float


def better_hold(records: Sequence[Record], nominal: Mapping[str, float]) -> Better | None:
    """The hold that the runs show, where it is plainly another than they are given; None where it is not."""
    if not records or not is_driven(records):
        return None
    by_one = _better(records, _by_one_mode(records, nominal), DECISIVE, ENOUGH)
    return by_one or _better(records, _by_modes(records), OF_MODES, MOST_OF_MODES) or _by_mass(records, nominal)


def _by_one_mode(records: Sequence[Record], nominal: Mapping[str, float]) -> dict[Hold, float]:
    """By hold, the share of the force that one mode an axis, forces that bend its response and a friction leave: such
    forces hide half a sample, and are none themselves."""
    found = {
        hold: response(own, nominal, driven=True, lowest=LOWEST, bent=True, rubbing=True)
        for hold, own in _held(records)
    }
    return {hold: own[1] for hold, own in found.items() if own is not None}


def _by_modes(records: Sequence[Record]) -> dict[Hold, float]:
    """By hold, the share of the voltage that more modes than one an axis leave; none where it shows no more."""
    modes = answering(records)
    if len(modes) <= records[0].axes:
        return {}
    return {hold: answered(own, modes, higher=True).left for hold, own in _held(records)}


def _by_mass(records: Sequence[Record], nominal: Mapping[str, float]) -> Better | None:
    """The hold with which a mass that no spring holds, and what resists it, leave nothing but noise, which hides how
    much less that is."""
    if is_held(records, nominal):
        return None
    gain, found = nominal["sense_gain_x"], dict[Hold, Resisted]()
    for hold, own in _held(records):
        told = fewest(alternatives(own, gain))
        if told is None:
            return None
        found[hold] = told
    decisive = 1 + SURE / sum(int(record.valid.sum()) for record in records)
    better = _better(records, {hold: told.left**2 for hold, told in found.items()}, decisive, ENOUGH)
    run_on = [replace(record, hold=better.hold) for record in records] if better else []
    return better if better and leaves_noise(run_on, gain, found[better.hold]) else None


def _held(records: Sequence[Record]) -> list[tuple[Hold, list[Record]]]:
    return [(hold, [replace(record, hold=hold) for record in records]) for hold in get_args(Hold)]


def _better(records: Sequence[Record], left: Mapping[Hold, float], decisive: float, enough: float) -> Better | None:
    """The hold that leaves so many times less, and no more than ``enough``."""
    if len(left) < len(get_args(Hold)):
        return None
    given = records[0].hold
    best = min(left, key=lambda hold: left[hold])
    # A straight line and a smooth course differ little: the smooth one, unless the line is plainly better.
    if best == "first" and left["first"] * decisive > left["band-limited"]:
        best = "band-limited"
    if best == given or left[best] > enough or left[best] * decisive > left[given]:
        return None
    return Better(best, left[best], left[given])
