"""Samples are not taken when their time stamps say: by a software timer, each off by an amount of its own.

v_k = v(t_k) + v' δ_k: noise in proportion to the slope of the voltage (F. Eng, F. Gustafsson, Identification with
stochastic sampling time jitter, Automatica 44, 2008). Both channels are off by the same δ_k, and no δ_k says anything
of the next: so it is told from what a model lacks, which is as smooth as the motion.
"""

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np

from discrepancy.criteria import Criteria
from discrepancy.data.record import Floats, Record
from discrepancy.fit.defect import Disturbance, Level
from discrepancy.fit.fitted import Fitted
from discrepancy.fit.noise import jitter
from gyro_model.quantities import size

LAGS: Final = 5
"""Samples over which one must say nothing of the next: a motion of fewer than 10 a period turns within them."""
ALIKE: Final = 0.15
"""Correlation of δ_k over LAGS up to which it is none: that of a motion is near 1 at the first, of 8000 samples with
nothing in common below 0.04."""

JITTER = size("timestamp_jitter", "s", "rms by which samples are off their time stamps", low=0.0)


def find(at: Fitted, records: Sequence[Record], criteria: Criteria) -> Mapping[str, Level] | None:
    """The scatter of the sampling instants, where it is too large for a converter's clock."""
    level = jitter(at, records)
    if level is None or level.low * records[0].sample_rate < criteria.timer or _smooth(at, records):
        return None
    return {"timestamp_jitter": Level(level.value, level.low, level.high)}


def _smooth(at: Fitted, records: Sequence[Record]) -> bool:
    """Whether what the samples are late by goes on from one to the next."""
    products, square = np.zeros(LAGS), 0.0
    for residual, record in zip(at.residuals, records, strict=True):
        own = _weighted(at.whiten(residual[None], record.valid)[0], record)
        products += [float(np.sum(own[lag:] * own[:-lag])) for lag in range(1, LAGS + 1)]
        square += float(np.sum(own**2))
    return bool((np.abs(products) > ALIKE * square).any())


def _weighted(innovation: Floats, record: Record) -> Floats:
    """δ_k of all channels, each weighed by how surely it shows: v' of all, rms."""
    slope = np.gradient(record.v, 1 / record.sample_rate, axis=0)
    return np.asarray((innovation * slope).sum(axis=1) / np.sqrt(np.maximum((slope**2).sum(axis=1), 1e-300)))


DEFECT = Disturbance(
    id="timestamp_jitter",
    parameters=(JITTER,),
    signature="white noise in proportion to the slope of the voltage, the same delay on both channels",
    source="F. Eng, F. Gustafsson, Automatica 44, 2008",
    find=find,
    instead=("sampling_jitter",),
)
