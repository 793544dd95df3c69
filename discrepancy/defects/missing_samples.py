"""Samples of the voltage that were lost or doubled while the count of time went on: from there on v is early or late.

To first order v_k = v(t_k + n T) differs by n (v_k+1 - v_k) from some k on; the k that explains most is a change point
(E. S. Page, Biometrika 41, 1954).
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from discrepancy.criteria import Criteria
from discrepancy.defect import Blemish, Data, Found, Level
from discrepancy.record import Floats, Record
from gyro_model.quantities import size

SHARE: Final = 0.3
"""Of the residual's square of a run, that one jump must explain."""
LEAST: Final = 0.3
"""Samples of a jump as first seen: the fit has taken up part of it."""
MOST: Final = 50
"""Samples lost at once; more is another run."""
BLIND: Final = 2
"""Samples masked on both sides of a jump."""

COUNT = size("missing_samples", "1", "samples lost (negative: doubled) in all runs")


def find(records: Sequence[Record], residuals: Sequence[Floats], criteria: Criteria) -> Found | None:
    """The largest jump of each run."""
    data = tuple(_jump(record, residual) for record, residual in zip(records, residuals, strict=True))
    total = float(sum(own[1] for own in data if own))
    return Found(data, {"missing_samples": Level(total, total, total)}) if any(data) else None


def without(record: Record, data: Data) -> Record:
    """The run with v put back by the samples lost, what is unknown masked; data: sample and number of each jump."""
    v, valid = record.v.copy(), record.valid.copy()
    for k, n in zip(map(int, data[::2]), map(int, data[1::2]), strict=True):
        moved, count = np.arange(k, len(v)) - n, len(v)
        known = (moved >= k if n > 0 else moved < count) & (moved < count)
        v[k:][known] = v[np.clip(moved[known], 0, count - 1)].copy()
        seen = valid[np.clip(moved, 0, count - 1)] & known
        valid[k:] = seen
        valid[max(k - BLIND, 0) : k + abs(n) + BLIND] = False
    return replace(record, v=v, valid=valid)


def _jump(record: Record, residual: Floats) -> Data:
    slope = np.gradient(record.v - residual, axis=0)
    usable = record.valid[:, None]
    # From the end: what each k would explain of all that comes after.
    product = np.cumsum((residual * slope * usable).sum(axis=1)[::-1])[::-1]
    square = np.maximum(np.cumsum((slope**2 * usable).sum(axis=1)[::-1])[::-1], 1e-300)
    total = float(np.sum((residual * usable) ** 2))
    inner = slice(len(product) // 50, -max(len(product) // 50, 1))
    # A jump beside a common shift, which a delay makes: the contrast of both sides.
    before = product[0] - product[inner]
    left = np.maximum(square[0] - square[inner], 1e-300)
    step = product[inner] / square[inner] - before / left
    gain = step**2 * square[inner] * left / square[0]
    k = int(np.argmax(gain))
    n = float(step[k])
    if gain[k] < SHARE * total or not LEAST <= abs(n) <= MOST:
        return ()
    return float(k + (inner.start or 0)), float(np.sign(n) * max(round(abs(n)), 1))


DEFECT = Blemish(
    id="missing_samples",
    parameters=(COUNT,),
    signature="from an instant on the residual is the voltage's slope, for a whole number of samples",
    source="E. S. Page, Biometrika 41, 1954",
    find=find,
    without=without,
)
