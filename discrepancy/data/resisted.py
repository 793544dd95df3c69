"""A mass that hardly any spring holds, by integrals of its motion.

x = ∬(u - f sign x' + c)/m - d/m ∫x + a + b t is linear in 1/m, d/m, f/m, c/m and each run's a, b. No derivative of what
was measured is taken, and no window is needed, of which so short a motion has none. While friction holds the mass at
rest it takes up all of the force. Of a sensor of velocity it is the derivative of this.
"""

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from scipy.ndimage import uniform_filter1d

from discrepancy.data.record import Floats, Record

PLAINLY: Final = 0.5
"""Of what is left without it (rms), that is left at most with a force which resists plainly."""
SMOOTHED: Final = 200
"""Parts of a run over two of which its speed is smoothed before its sign is taken: noise has none."""
AT_REST: Final = 0.02
"""Of the highest speed, over which the sign changes: below, a smoothed speed is as well at rest."""


BACK: Final = 0.02
"""Share of the way that smoothed noise goes back while a mass moves one way."""


class Resisted(NamedTuple):
    """mass [kg], damping [N s/m]; friction and constant force [N], 0 where it does not plainly show; left: of the
    motion's rms."""

    m: float
    d: float
    friction: float
    constant: float
    left: float


def alternatives(records: Sequence[Record], gain: float) -> list[Resisted]:
    """What moves and resists a mass without a spring, for a sensor of ``gain`` [V/m], with neither, with either and
    with both of friction and a constant force, the fewest first, as far as a mass explains the motion; none for two
    axes, a sensor of acceleration, and where no force acted."""
    if any(record.axes > 1 or record.order > 1 or not record.u.any() for record in records):
        return []
    columns, target = _joined(records, gain)
    found = (
        _solved(columns[:, [not friction, friction, True, friction, constant]], target, friction, constant)
        for friction, constant in ((False, False), (True, False), (False, True), (True, True))
    )
    return [own for own in found if own is not None]


def fewest(found: Sequence[Resisted]) -> Resisted | None:
    """Of alternatives the one of fewest forces that leaves no more than twice what all do; None of none."""
    least = min((own.left for own in found), default=0.0)
    return next((own for own in found if PLAINLY * own.left <= least), None)


def one_way(records: Sequence[Record]) -> bool:
    """Whether no run turns round, so that a friction is a constant force against the motion while it moves."""
    for record in records:
        part = max(len(record.t) // SMOOTHED, 1)
        way = np.cumsum(record.v, axis=0) if record.order else record.v
        steps = np.diff(uniform_filter1d(way, 2 * part + 1, axis=0, mode="nearest")[::part], axis=0)
        ahead, back = np.clip(steps, 0, None).sum(axis=0), np.clip(-steps, 0, None).sum(axis=0)
        if (np.minimum(ahead, back) > BACK * (ahead + back)).any():
            return False
    return True


def _joined(records: Sequence[Record], gain: float) -> tuple[Floats, Floats]:
    """Columns of the force, of the force while the mass moves, of damping, friction and constant, and the motion, with
    each run's own start taken out."""
    columns, targets = [], []
    for record in records:
        n, step, position = len(record.t), 1 / record.sample_rate, record.order == 0
        moved: Floats = record.v[:, 0] * record.reference**record.order / gain
        t: Floats = step * np.arange(n, dtype=np.float64)
        smooth = uniform_filter1d(moved, 2 * (n // SMOOTHED) + 1, mode="nearest")
        speed = np.gradient(smooth) if position else smooth
        sign = np.tanh(speed / max(AT_REST * float(np.abs(speed).max()), 1e-300))
        u = record.u[:, 0] if record.hold == "zero" else 0.5 * (record.u[:, 0] + np.append(record.u[1:, 0], 0.0))
        way = moved - moved[0] if position else _integral(moved, step)
        push, moving = (np.concatenate(([0.0], np.cumsum(f[:-1]) * step)) for f in (u, u * np.abs(sign)))
        # What each gives to the speed, or to the position.
        given = (push, moving, -way, -_integral(sign, step), t)
        own = np.column_stack([_integral(column, step) for column in given] if position else given)
        start = np.linalg.qr(np.column_stack((np.ones(n), t))[:, : 1 + position])[0]
        columns.append((own - start @ (start.T @ own))[record.valid])
        targets.append((moved - start @ (start.T @ moved))[record.valid])
    return np.vstack(columns), np.concatenate(targets)


def _solved(columns: Floats, target: Floats, friction: bool, constant: bool) -> Resisted | None:
    size = np.linalg.norm(columns, axis=0)
    if not (size > 0).all():
        return None
    found = np.linalg.lstsq(columns / size, target, rcond=None)[0] / size
    if found[1] < 0:
        # Friction alone slows it: a damping then comes out on either side of zero.
        undamped = np.array([True, False, *[True] * (columns.shape[1] - 2)])
        found[~undamped] = 0.0
        found[undamped] = np.linalg.lstsq((columns / size)[:, undamped], target, rcond=None)[0] / size[undamped]
    left = float(np.linalg.norm(target - columns @ found) / np.linalg.norm(target))
    if found[0] <= 0:
        return None
    m, more = 1 / found[0], list(found[2:] / found[0])
    f, c = more.pop(0) if friction else 0.0, more.pop(0) if constant else 0.0
    return Resisted(float(m), float(found[1] * m), float(f), float(c), left) if f >= 0 else None


def _integral(y: Floats, step: float) -> Floats:
    return np.concatenate(([0.0], np.cumsum(0.5 * (y[1:] + y[:-1])) * step))
