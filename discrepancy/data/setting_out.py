"""How a run sets out, as its first samples show it: place and speed of a mass that no spring holds.

A fit of such a mass has them free, and they are as good as the whole run tells them. Where the model lacks something,
or the mass rubs more on one day than on another, a start that never was makes up for it over the whole way.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np
from scipy.ndimage import uniform_filter1d

from discrepancy.data.record import Record

SAMPLES: Final = 50
"""First ones, that show it."""
FEWEST: Final = 10
"""Of these that must be valid."""
SURE, PLAINLY = 0.005, 0.01
"""Of the highest speed: deviation up to which these know the speed, and by how much another is plainly not that."""
DEVIATIONS: Final = 5.0
"""By which another is plainly not that either."""
SMOOTHED: Final = 100
"""Parts of a run over each of which its highest speed is taken."""


class Start(NamedTuple):
    """place [m] and speed [m/s] of x, each times the gain of its sensor [V/m], and the deviation of the speed."""

    place: float
    speed: float
    deviation: float


def shown(record: Record) -> Start:
    """What the first samples of a run of one axis show, whose sensor is of position or velocity."""
    first = record.valid[:SAMPLES]
    t, v = record.t[:SAMPLES][first] - record.t[0], record.v[:SAMPLES, 0][first]
    if len(t) < FEWEST:
        return Start(0.0, 0.0, np.inf)
    # Over so few samples force and speed change little, and what follows from them is a parabola.
    powers = np.vander(t, 3, increasing=True)
    scale = np.abs(powers).max(axis=0)
    found, *_ = np.linalg.lstsq(powers / scale, v, rcond=None)
    error = v - powers / scale @ found
    spread = np.linalg.inv((powers / scale).T @ (powers / scale)) * (error @ error) / max(len(t) - len(found), 1)
    term = 1 - record.order
    of_one = record.reference**record.order / scale[term]
    place = 0.0 if record.order else float(found[0] / scale[0])
    return Start(place, float(found[term] * of_one), float(np.sqrt(spread[term, term]) * of_one))


def contradicted(records: Sequence[Record], starts: Sequence[Mapping[str, float]], gain: float) -> bool:
    """Whether the ``starts`` of a fit, of runs whose sensor has this ``gain`` [V/m], are plainly none that the first
    samples show, which know all of them."""
    off = False
    for record, start in zip(records, starts, strict=True):
        told, top = shown(record), _highest(record)
        if not _known(record, told):
            return False
        off = off or abs(gain * start["x_dot_start"] - told.speed) > max(DEVIATIONS * told.deviation, PLAINLY * top)
    return off


def as_shown(record: Record) -> Record:
    """The run with that start, which no fit changes; as it is where its first samples do not know it."""
    told = shown(record)
    return replace(record, begun=told[:2]) if _known(record, told) else record


def _known(record: Record, told: Start) -> bool:
    return told.deviation <= SURE * _highest(record)


def _highest(record: Record) -> float:
    """The highest speed [V/s] over a part of a run."""
    part = len(record.t) // SMOOTHED + 1
    smooth = uniform_filter1d(record.v[:, 0], part, mode="nearest")
    if record.order:
        return float(np.abs(smooth).max()) * record.reference
    return float(np.abs(np.diff(smooth[::part])).max()) * record.sample_rate / part
