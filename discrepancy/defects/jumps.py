"""Samples beside a jump of what the sensor sees. They are masked.

An accelerometer sees a dry friction jump where the mass turns round. On which side of it a sample lies that is next to
it follows from the motion, but no further than the motion is known: a sample on the wrong side is off by all of the
jump, a hundred times the noise, though the motion be off by nothing that another sample shows, and no slope says so. A
fit that has one on the wrong side stays where the others are on the right one (an outlier has that power in least
squares: P. J. Huber, Robust Statistics, 1981, section 7.1).
"""

from typing import Final

import numpy as np
from scipy.ndimage import maximum_filter1d

from discrepancy.criteria import Criteria
from discrepancy.data.algebra import median_deviation
from discrepancy.data.record import Bools, Floats, Record
from discrepancy.fit.defect import Blemish, Data, Found, Left, Level, without_samples
from gyro_model.quantities import size

BESIDE: Final = 0.1
"""Of a sample period: what a fit that has found the motion is off by is far less."""
JUMP: Final = 6.0
"""Deviations of the noise, and of what the second difference of the motion is without jumps."""
MOST: Final = 0.1
"""Share of a run above which nothing jumps, but everything moves so fast."""

SHARE = size("jumps", "1", "share of the samples that lie beside a jump", low=0.0, high=1.0)


def find(left: Left, criteria: Criteria) -> Found | None:
    """The samples of each run beside which the model jumps."""
    data = tuple(_beside(record, residual, left.between(run))
                 for run, (record, residual) in enumerate(zip(left.records, left.residuals, strict=True)))  # fmt: skip
    total, count = sum(len(r.t) for r in left.records), sum(map(len, data))
    if count == 0 or count > MOST * total:
        return None
    return Found(data, {"jumps": Level(count / total, count / total, count / total)})


def _beside(record: Record, residual: Floats, between: Floats | None) -> Data:
    if between is None or not np.isfinite(between).all():
        return ()
    samples, parts, axes = between.shape
    bend = np.zeros((samples * parts, axes))
    bend[1:-1] = np.abs(np.diff(_without_force(record, between).reshape(-1, axes), 2, axis=0))
    usual = np.maximum(median_deviation(residual[record.valid]), median_deviation(bend))
    jumps = _nearby(bend > JUMP * usual, max(1, round(BESIDE * parts)))
    return tuple(float(k) for k in np.flatnonzero(jumps[::parts] & record.valid))


def _without_force(record: Record, between: Floats) -> Floats:
    """Without the jumps of a force that is held, each of which comes after its sample, and so on a known side."""
    if record.hold != "zero":
        return between
    jumps = np.diff(record.u, axis=0)
    gain = np.linalg.lstsq(jumps, between[1:, 1] - between[1:, 0], rcond=None)[0]
    u = np.repeat(record.u, between.shape[1], axis=0)
    acting = np.concatenate((u[:1], u[:-1])).reshape(between.shape)
    return np.asarray(between - acting @ gain)


def _nearby(jumps: Bools, reach: int) -> Bools:
    """Where a channel (n, axes) jumps within so many places."""
    return np.asarray(maximum_filter1d(jumps.any(axis=1), 2 * reach + 1))


DEFECT = Blemish(
    id="jumps",
    parameters=(SHARE,),
    signature="samples off by all of a jump, where a mass turns round against dry friction",
    source="P. J. Huber, Robust Statistics, 1981, section 7.1",
    find=find,
    without=without_samples,
    counted=True,
    by_motion=True,
)
