"""A kind of run: how its rate goes, and what that shows. Each is a file of ``kinds`` with ``KIND``, found by a scan."""

import importlib
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from calibration.datasheet.figure import Outcome
from cosim.angle_record import AngleRecord
from gyro_model.errors import InputError

Floats = NDArray[np.float64]

FOLDER: Final = Path(__file__).parent / "kinds"
MOST: Final = 0.5
"""A stretch of constant rate is what a run is about if it lasts for this share of it."""
SETTLING: Final = 0.1
"""After a step of the rate the loop is followed by this time [s]: fifty of its slowest."""
SHORTEST: Final = 2 * SETTLING
"""A rate that stands still for less than this [s] is no plateau."""


class Stretch(NamedTuple):
    """Of constant rate: begin, end [s]; rate [rad/s]; turned: by how much the pattern turned meanwhile by what was
    asked of it, the largest less the least [rad]."""

    begin: float
    end: float
    rate: float
    turned: float

    @property
    def duration(self) -> float:
        """[s]"""
        return self.end - self.begin


class Course(NamedTuple):
    """What a run went through: its stretches of constant rate that last for SHORTEST or longer, and its duration
    [s]."""

    stretches: tuple[Stretch, ...]
    duration: float

    @property
    def main(self) -> Stretch | None:
        """The stretch that makes up most of the run, None where none does."""
        longest = max(self.stretches, key=lambda one: one.duration, default=None)
        return longest if longest is not None and longest.duration >= MOST * self.duration else None


def course(t: Floats, rate: Floats, turned: Floats, angular_gain: float) -> Course:
    """Of rows at ``t`` [s] with the true ``rate`` [rad/s] and the angle by which the controller has ``turned`` the
    pattern [rad], shapes (n,)."""
    borders = [0, *(np.flatnonzero(np.diff(rate) != 0) + 1).tolist(), len(t)]
    found = []
    for first, last in pairwise(borders):
        end = float(t[min(last, len(t) - 1)])
        if end - t[first] >= SHORTEST:
            rows = slice(first, last)
            pattern = turned[rows] - angular_gain * rate[first] * t[rows]
            found.append(Stretch(float(t[first]), end, float(rate[first]), float(np.ptp(pattern))))
    return Course(tuple(found), float(t[-1] - t[0]))


class Kind(NamedTuple):
    """title; is_of: whether a run is of this kind; measure: what a record of it shows, InputError where it is too
    short."""

    title: str
    is_of: Callable[[Course], bool]
    measure: Callable[[AngleRecord, Course], Outcome]


def kinds() -> dict[str, Kind]:
    """All kinds by name."""
    names = sorted(path.stem for path in FOLDER.glob("[a-z]*.py"))
    return {name: importlib.import_module(f"calibration.characteristics.kinds.{name}").KIND for name in names}


def characteristics(record: AngleRecord, through: Course) -> dict[str, tuple[str, Outcome]]:
    """Title and outcome of every kind that a run is of, by name."""
    if not through.stretches:
        return {}
    return {
        name: (kind.title, _outcome(kind, record, through)) for name, kind in kinds().items() if kind.is_of(through)
    }


def _outcome(kind: Kind, record: AngleRecord, through: Course) -> Outcome:
    if record.valid_at is None:
        return Outcome(reason=f"no valid angle: {record.reason}")
    try:
        return kind.measure(record, through)
    except InputError as error:
        return Outcome(reason=str(error))


def longest_valid(record: AngleRecord, stretch: Stretch, settling: float = 0.0) -> AngleRecord:
    """The longest part of ``stretch``, from ``settling`` [s] after its begin on, through which the angle was valid.

    Raises InputError where there is none."""
    # A stretch with which the record begins has no step before it.
    begin = stretch.begin + (settling if stretch.begin > 0 else 0.0)
    within = record.between(begin, stretch.end)
    runs = [one for one in _runs(within.valid) if within.valid[one.start]]
    if not runs:
        raise InputError(f"no valid angle from {begin:.3g} to {stretch.end:.3g} s: {record.reason or 'see withdrawn'}")
    longest = max(runs, key=lambda one: one.stop - one.start)
    return within.between(within.t[longest.start], np.nextafter(within.t[longest.stop - 1], np.inf))


def _runs(flags: NDArray[np.bool_]) -> list[slice]:
    borders = [0, *(np.flatnonzero(np.diff(flags)) + 1).tolist(), len(flags)]
    return [slice(first, last) for first, last in pairwise(borders) if last > first]
