"""A sensor that shows where it stands: an offset far beyond the motion is no answer to any force, and is taken off; of
a sensor of velocity or acceleration a far smaller one is none.

Left in, mass, stiffness and initial states imitate it, and nothing else is seen beside.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np

from discrepancy.data.record import Floats, Record, unheld
from gyro_model.anatomy import SLOTS, Map
from gyro_model.model import Model
from gyro_model.quantities import Quantity

BEYOND: Final = 3.0
"""Times the motion's rms that the mean voltage of every run is, at the least. What an asymmetric spring or pickoff
makes of a motion is below the motion itself."""
MOVING: Final = 0.05
"""The same of a velocity or an acceleration: their mean over a run is what the end differs from the begin by, over its
length, which of a mass that a spring holds is 0.01 of the motion's rms after 45 periods."""
LOUDER, APART, ALIKE = 2.0, 0.05, 1.0
"""Times the motion of one run that another has at least, and of the least of these that the means of all differ by at
most, where a mean of so many times the largest is an offset too."""
SAME: Final = 1.0
"""Times the motion's rms by which the means of the runs may differ: else the mass itself has moved."""
STILL: Final = 0.03
"""Mean of the force over its rms about it, above which the deflection may be its answer."""
LEFT: Final = 1e-6
"""Of the motion's rms, from where what the mean leaves of an offset is fitted."""


class Levelled(NamedTuple):
    """Runs without offsets, the parameters that stand for what is left of these, and what to say."""

    records: tuple[Record, ...]
    left: dict[str, float]
    said: tuple[str, ...]


def levelled(records: Sequence[Record], stated: Mapping[str, float], model: Model) -> Levelled:
    """The runs without an offset beyond the motion of those to fit, which alone are looked at; all the runs as they
    are where the lab states what is always there (``stated``: nominal values)."""
    own, said = tuple(records), []
    left: dict[str, float] = {}
    fit = [record for record in own if record.role == "fit"]
    unlike = len({record.axes for record in own}) > 1
    free = any(r.senses == "velocity" and unheld(r.u, r.v) for r in fit)
    if not fit or unlike or free or not _still(fit) or _standing(stated, model):
        return Levelled(own, {}, ())
    for axis, name in enumerate("xy"[: own[0].axes]):
        means = np.array([np.mean(r.v[r.valid, axis]) for r in fit])
        motion = max(float(np.std(r.v[r.valid, axis])) for r in fit)
        least = MOVING if fit[0].order else BEYOND
        if _is_alike(means, [float(np.std(r.v[r.valid, axis])) for r in fit]):
            least = min(least, ALIKE)
        if np.ptp(means) > SAME * motion or np.abs(means).min() <= least * motion or motion == 0:
            continue
        offset = np.zeros(own[0].axes)
        offset[axis] = float(np.mean(means))
        own = tuple(replace(record, v=record.v - offset) for record in own)
        # What acts on the pickoff of the model adds to a position alone.
        left |= {} if fit[0].order else {q.name: LEFT * motion for q in _offsets(model, axis)}
        times = abs(offset[axis]) / motion
        said.append(f"v_{name} stands at {offset[axis]:.6g} V, {times:.3g} times its motion: taken off as an offset")
    return Levelled(own, left, tuple(said))


def _is_alike(means: Floats, motions: Sequence[float]) -> bool:
    """Whether runs of unlike strength stand at one place: what bends in a motion goes with its square."""
    return max(motions) > LOUDER * min(motions) and float(np.ptp(means)) < APART * min(motions)


def _still(records: Sequence[Record]) -> bool:
    return all(np.all(np.abs(r.u.mean(axis=0)) <= STILL * r.u.std(axis=0).max()) for r in records)


def _standing(stated: Mapping[str, float], model: Model) -> bool:
    """Whether the lab says of a voltage or a force that it is always there."""
    sizes = [q for e in model.effects if not e.nominal and not e.noise for q in e.sizes if q.unit in ("V", "N")]
    return any(stated.get(q.name, q.start) != q.start for q in sizes)


def _offsets(model: Model, axis: int) -> list[Quantity]:
    """Parameters that are added to the voltage of an axis, and do nothing else."""
    maps = [e for e in model.effects if isinstance(e, Map)]
    added = [(e, e.output[axis] - SLOTS[e.slot].enters[axis]) for e in maps]
    return [q for e, more in added for q in e.sizes if more == q.symbol]
