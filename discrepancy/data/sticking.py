"""A mass on a spring that friction holds for most of the time, by what is linear while it moves.

At rest a friction takes up all of the force, so that no response is seen in a record that is mostly rest. Where the
mass moves, u = m x'' + d x' + k x + f sign x' - c holds at every sample, and is linear in m, d, k, f and c. The
derivatives are those of parabolas of the third degree through samples about each (A. Savitzky and M. J. E. Golay,
Analytical Chemistry 36, 1964), as wide as leaves least of the force.
"""

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from scipy.signal import savgol_filter

from discrepancy.data.record import Floats, Record

WIDTHS: Final = (5, 9, 17, 33, 65, 129)
"""Samples of a parabola."""
DEGREE: Final = 3
MOVES: Final = 0.2
"""Of the speed's rms: what is slower may as well be at rest, where friction has any size."""
FEWEST: Final = 100
"""Samples that move, at least."""


class Sticking(NamedTuple):
    """mass [kg], damping [N s/m], stiffness [N/m], friction and constant force [N]; left: share of the force's square
    that they leave while the mass moves."""

    m: float
    d: float
    k: float
    friction: float
    constant: float
    left: float


def sticking(records: Sequence[Record], gain: float) -> Sticking | None:
    """That of runs of one axis whose sensor, of ``gain`` [V/m], sees the place; None where no such mass comes out."""
    if any(record.axes > 1 or record.order for record in records):
        return None
    found = [own for width in WIDTHS if (own := _by(records, gain, width)) is not None]
    return min(found, key=lambda own: own.left, default=None)


def _by(records: Sequence[Record], gain: float, width: int) -> Sticking | None:
    """The same by parabolas of so many samples."""
    rows = [_rows(record, gain, width) for record in records if len(record.t) > width]
    if sum(map(len, rows)) < FEWEST:
        return None
    columns, force = np.split(np.concatenate(rows), [5], axis=1)
    size = np.linalg.norm(columns, axis=0)
    if not (size > 0).all():
        return None
    solution = np.linalg.lstsq(columns / size, force[:, 0], rcond=None)[0]
    left = float(np.sum((force[:, 0] - columns / size @ solution) ** 2) / np.sum(force**2))
    m, d, k, friction, minus = (solution / size).tolist()
    return Sticking(m, d, k, friction, -minus, left) if min(m, k, friction) > 0 else None


def _rows(record: Record, gain: float, width: int) -> Floats:
    """x'', x', x, sign x', 1 and u (n, 6) of the samples at which the mass moves."""
    x = np.interp(record.t, record.t[record.valid], record.v[record.valid, 0]) / gain
    place, speed, acceleration = (
        savgol_filter(x, width, DEGREE, deriv=order, delta=1 / record.sample_rate) for order in range(3)
    )
    u = record.u[:, 0]
    if record.hold == "zero":
        # At a sample the force changes, and with it what the parabola through both sides bends by.
        u = 0.5 * (u + np.append(u[:1], u[:-1]))
    moves = record.valid & (np.abs(speed) > MOVES * np.sqrt(np.mean(speed**2)))
    # A parabola at an end is none about its sample.
    moves[: width // 2] = moves[len(moves) - width // 2 :] = False
    columns = (acceleration, speed, place, np.sign(speed), np.ones_like(speed), savgol_filter(u, width, DEGREE))
    return np.asarray(np.stack(columns, axis=1)[moves])
