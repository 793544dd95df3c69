"""Single samples that are far off: bits lost on a bus, a spark. They are masked.

Found by their distance from the mean of their neighbours, over the median of such distances: F. R. Hampel, The
influence curve and its role in robust estimation, Journal of the American Statistical Association 69, 1974.
"""

from typing import Final

import numpy as np
from scipy.ndimage import binary_opening, maximum_filter, percentile_filter, rank_filter

from discrepancy.criteria import Criteria
from discrepancy.data.algebra import median_deviation
from discrepancy.data.record import Bools, Floats, Record
from discrepancy.fit.defect import Blemish, Data, Found, Left, Level, without_samples
from gyro_model.quantities import size

FAR: Final = 9.0
"""Robust deviations from the neighbours: one in 1e18 by chance, and far beyond what noise of growing size gives."""
ALONE, REACH, OTHER = 3.0, 6, 3
"""Times as far off as so many samples on both sides, but for the next and for those of one other outlier, which shows
in its neighbours too."""
BESIDE: Final = np.abs(np.arange(-REACH, REACH + 1)) > 1
"""Those samples."""
NEAR: Final = 81
"""Samples about one that say how much noise is there: four in five of them scatter by a tenth, whatever five outliers
do to themselves and to their neighbours."""
LOOKS: Final = 5
"""Looks at most, each at what those that are gone have hidden."""
LONGEST: Final = 3
"""Outliers next to each other."""
MOST: Final = 0.02
"""Share of a run above which they are no outliers."""
UPPER: Final = 1.2816
"""Normal deviations that four in five are below: more certain than their median of few that vary."""

SHARE = size("outliers", "1", "share of the samples that are far off", low=0.0, high=1.0)


def find(left: Left, criteria: Criteria) -> Found | None:
    """The samples of each run whose residual stands alone."""
    data = tuple(_far(record, residual) for record, residual in zip(left.records, left.residuals, strict=True))
    total, count = sum(len(r.t) for r in left.records), sum(len(own) for own in data)
    if count == 0 or count > MOST * total:
        return None
    share, width = count / total, 1.96 * count**0.5 / total
    return Found(data, {"outliers": Level(share, max(share - width, 0.0), share + width)})


def _far(record: Record, residual: Floats) -> Data:
    usable = record.valid.copy()
    for _ in range(LOOKS):
        alone = _alone(residual, usable)
        if not alone.any():
            break
        usable &= ~alone
    far = record.valid & ~usable
    # A stretch that was found sample by sample is none.
    longer = binary_opening(far, np.ones(LONGEST + 1))
    return tuple(float(k) for k in np.flatnonzero(far & ~longer))


def _alone(residual: Floats, usable: Bools) -> Bools:
    """Which of the ``usable`` samples (n,) stand alone."""
    places = np.flatnonzero(usable)
    if len(places) < NEAR:
        return np.zeros_like(usable)
    filled = np.column_stack([np.interp(np.arange(len(usable)), places, channel[places]) for channel in residual.T])
    off = np.zeros_like(residual)
    off[1:-1] = filled[1:-1] - 0.5 * (filled[2:] + filled[:-2])
    deviation = median_deviation(off[usable])
    if not (deviation > 0).all() or not (np.abs(off) > FAR * deviation).any():
        return np.zeros_like(usable)
    # Noise may grow with the motion: where it has, an outlier is one beside its own.
    beside = percentile_filter(np.abs(off), 80, (NEAR, 1), mode="nearest") / UPPER
    far = np.abs(off) / np.maximum(deviation, beside)
    # The neighbours of an outlier are half as far off; what is missing from a model shows in stretches.
    around = rank_filter(far, -1 - OTHER, footprint=BESIDE[:, None], mode="nearest")
    # Beside two that touch even the next but one seems far.
    next_to = maximum_filter(far, (5, 1), mode="nearest")
    alone = ((far > FAR) & (far >= next_to) & (far > ALONE * np.maximum(around, 1.0))).any(axis=1) & usable
    return np.asarray(alone)


DEFECT = Blemish(
    id="outliers",
    parameters=(SHARE,),
    signature="single samples far from both neighbours",
    source="F. R. Hampel, Journal of the American Statistical Association 69, 1974",
    find=find,
    without=without_samples,
    counted=True,
)
