"""Single samples that are far off: bits lost on a bus, a spark. They are masked.

Found by their distance from the mean of their neighbours, over the median of such distances: F. R. Hampel, The
influence curve and its role in robust estimation, Journal of the American Statistical Association 69, 1974.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from scipy.ndimage import percentile_filter

from discrepancy.criteria import Criteria
from discrepancy.data.record import Floats, Record
from discrepancy.fit.defect import Blemish, Data, Found, Level
from gyro_model.quantities import size

FAR: Final = 9.0
"""Robust deviations from the neighbours: one in 1e18 by chance, and far beyond what noise of growing size gives."""
ALONE, REACH = 3.0, 6
"""Times as far off as any of so many samples on both sides, but for the next."""
NEAR: Final = 41
"""Samples about one that say how much noise is there: four in five of them scatter by a tenth."""
MOST: Final = 0.02
"""Share of a run above which they are no outliers."""
MEDIAN, UPPER = 0.6745, 1.2816
"""Of a normal deviation's size, and what four in five are below: the more certain of few that vary."""

SHARE = size("outliers", "1", "share of the samples that are far off", low=0.0, high=1.0)


def find(records: Sequence[Record], residuals: Sequence[Floats], criteria: Criteria) -> Found | None:
    """The samples of each run whose residual stands alone."""
    data = tuple(_far(record, residual) for record, residual in zip(records, residuals, strict=True))
    total, count = sum(len(r.t) for r in records), sum(len(own) for own in data)
    if count == 0 or count > MOST * total:
        return None
    share, width = count / total, 1.96 * count**0.5 / total
    return Found(data, {"outliers": Level(share, max(share - width, 0.0), share + width)})


def without(record: Record, data: Data) -> Record:
    """The run with these samples masked."""
    valid = record.valid.copy()
    valid[[int(k) for k in data if 0 <= k < len(valid)]] = False
    return replace(record, valid=valid)


def _far(record: Record, residual: Floats) -> Data:
    off = np.zeros_like(residual)
    off[1:-1] = residual[1:-1] - 0.5 * (residual[2:] + residual[:-2])
    deviation = np.median(np.abs(off[record.valid]), axis=0) / MEDIAN
    if not (deviation > 0).all():
        return ()
    # Noise may grow with the motion: where it has, an outlier is one beside its own.
    beside = percentile_filter(np.abs(off), 80, (NEAR, 1), mode="nearest") / UPPER
    far = np.abs(off) / np.maximum(deviation, beside)
    # The neighbours of an outlier are half as far off; what is missing from a model shows in stretches.
    around = np.zeros_like(far)
    for side in (*range(-REACH, -1), *range(2, REACH + 1)):
        around = np.maximum(around, np.roll(far, side, axis=0))
    next_to = np.maximum(np.roll(far, 1, axis=0), np.roll(far, -1, axis=0))
    alone = (far > FAR) & (far >= next_to) & (far > ALONE * np.maximum(around, 1.0))
    found = np.flatnonzero(alone.any(axis=1) & record.valid)
    return tuple(float(k) for k in found)


DEFECT = Blemish(
    id="outliers",
    parameters=(SHARE,),
    signature="single samples far from both neighbours",
    source="F. R. Hampel, Journal of the American Statistical Association 69, 1974",
    find=find,
    without=without,
    counted=True,
)
