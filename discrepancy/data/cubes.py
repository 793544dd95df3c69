"""The cube of a place as columns of the weak form: what bends a spring, whatever sees the motion.

Of speeds and accelerations the place is their integral, but for what is slower than the device: of that they hold
little but noise.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.polynomial.chebyshev import chebvander
from scipy.signal import butter, sosfiltfilt

from discrepancy.data.linear_fit import Complexes, Windows, mode_frequencies, windows
from discrepancy.data.record import Floats, Record
from discrepancy.data.rubbed import integral, summed

SLOW: Final = 0.1
"""Of the lowest mode's frequency, below which what is integrated is no place. Of 20 chaotic and regular motions by
their speed or acceleration forces of third order left 0.015 of the force at most, with k3 to 4 %; with half of it 0.10
of accelerations, whose noise grows with the inverse of the square, with k3 to 27 %, and with three times as much 0.012,
with k3 to 11 %."""
CURVED: Final = 3
"""Degree of what is taken out of an integral before it is filtered."""


def cubes(
    records: Sequence[Record], nominal: Mapping[str, float], lowest: int, periods: float, top_hz: float
) -> Complexes:
    """Columns (axes * rows, 2 * axes) of the forces x³ and 3 x² x' [m³, m³/s] in the equation of each axis, for the
    rows that ``joined_form`` has of the same records."""
    found = (windows(record, nominal, lowest, periods, top_hz) for record in records)
    runs = [_cubes(own, SLOW * float(mode_frequencies(nominal, own.record.axes)[0])) for own in found if own]
    force, slope = (np.concatenate(parts, axis=1) for parts in zip(*runs, strict=True))
    axes, rows = force.shape
    columns = np.zeros((axes, rows, 2 * axes), np.complex128)
    for axis in range(axes):
        columns[axis, :, 2 * axis], columns[axis, :, 2 * axis + 1] = force[axis], slope[axis]
    return columns.reshape(axes * rows, 2 * axes)


def _cubes(own: Windows, slow_hz: float) -> tuple[Complexes, Complexes]:
    """Of a run x³ and its derivative (axes, rows), as the motion in its voltage is differentiated."""
    order = own.record.order
    cube = places(own.record, own.gains, slow_hz) ** 3
    *_, force, slope = own.window.derivatives(cube / own.record.reference**order, own.starts, order + 1)
    return own.weighted(force), own.weighted(slope)


def bowed(records: Sequence[Record]) -> list[Record]:
    """The records with the course of the force -x³ at the sensors, as if they had 1 V/m [V³]."""
    return [replace(record, courses={**record.courses, "cube": -(_shown(record) ** 3)}) for record in records]


def _shown(record: Record) -> Floats:
    return places(record, [1.0] * record.axes, SLOW * record.reference / (2 * np.pi))


def places(record: Record, gains: Sequence[float], slow_hz: float) -> Floats:
    """The place [m] (n, axes) that sensors of so many ``gains`` [V/m] show, of speeds and accelerations without what is
    slower than ``slow_hz``."""
    shown = replace(record, v=record.v / gains)
    if record.order == 0:
        return shown.v
    # What noise adds up to is most at the ends, where a filter begins: a cubic, and a mirror, leave little there.
    level = np.linalg.qr(chebvander(np.linspace(-1, 1, len(record.t)), CURVED))[0]

    def levelled(values: Floats) -> Floats:
        return np.asarray(values - level @ (level.T @ values))

    speed = shown.v if record.order == 1 else integral(shown) / record.sample_rate
    place = levelled(summed(levelled(speed)) / record.sample_rate) * record.reference**record.order
    slow = butter(2, 2 * slow_hz / record.sample_rate, "highpass", output="sos")
    mirrored = min(int(record.sample_rate / slow_hz), len(record.t) - 1)
    return np.asarray(sosfiltfilt(slow, place, axis=0, padtype="even", padlen=mirrored))
