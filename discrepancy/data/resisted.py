"""A mass that hardly any spring holds, by integrals of its motion.

x = ∬(u - f sign x' + c)/m - d/m ∫x + a + b t is linear in 1/m, d/m, f/m, c/m and each run's a, b. No derivative of what
was measured is taken, and no window is needed, of which so short a motion has none.
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


def resisted(records: Sequence[Record], gain: float) -> Resisted | None:
    """What moves and resists a mass without a spring, by the fewest forces, for a sensor of ``gain`` [V/m]; None as
    ``alternatives`` has none."""
    return fewest(alternatives(records, gain))


def alternatives(records: Sequence[Record], gain: float) -> list[Resisted]:
    """The same with neither, with either and with both of the forces, the fewest first, as far as a mass explains the
    motion; none for two axes, a sensor that shows no position, and where no force acted."""
    if any(record.axes > 1 or record.order or not record.u.any() for record in records):
        return []
    columns, target = _joined(records, gain)
    return [
        found
        for friction, constant in ((False, False), (True, False), (False, True), (True, True))
        if (found := _solved(columns[:, [True, True, friction, constant]], target, friction, constant)) is not None
    ]


def fewest(found: Sequence[Resisted]) -> Resisted | None:
    """Of alternatives the one of fewest forces that leaves no more than twice what all do; None of none."""
    least = min((own.left for own in found), default=0.0)
    return next((own for own in found if PLAINLY * own.left <= least), None)


def one_way(records: Sequence[Record]) -> bool:
    """Whether no run turns round, so that a friction is a constant force against the motion while it moves."""
    for record in records:
        part = max(len(record.t) // SMOOTHED, 1)
        steps = np.diff(uniform_filter1d(record.v, 2 * part + 1, axis=0, mode="nearest")[::part], axis=0)
        ahead, back = np.clip(steps, 0, None).sum(axis=0), np.clip(-steps, 0, None).sum(axis=0)
        if (np.minimum(ahead, back) > BACK * (ahead + back)).any():
            return False
    return True


def _joined(records: Sequence[Record], gain: float) -> tuple[Floats, Floats]:
    """Columns of force, damping, friction and constant, and the motion, with each run's own start taken out."""
    columns, targets = [], []
    for record in records:
        n, step = len(record.t), 1 / record.sample_rate
        x, t = record.v[:, 0] / gain, np.arange(len(record.t)) / record.sample_rate
        speed = np.gradient(uniform_filter1d(x, 2 * (n // SMOOTHED) + 1, mode="nearest"))
        sign = np.tanh(speed / max(AT_REST * float(np.abs(speed).max()), 1e-300))
        u = record.u[:, 0] if record.hold == "zero" else 0.5 * (record.u[:, 0] + np.append(record.u[1:, 0], 0.0))
        push = _integral(np.concatenate(([0.0], np.cumsum(u[:-1]) * step)), step)
        own = np.column_stack((push, -_integral(x - x[0], step), -_integral(_integral(sign, step), step), 0.5 * t**2))
        start = np.linalg.qr(np.column_stack((np.ones(n), t)))[0]
        columns.append((own - start @ (start.T @ own))[record.valid])
        targets.append((x - start @ (start.T @ x))[record.valid])
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
