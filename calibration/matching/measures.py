"""What a run with its bias tuned has reached, by the true split."""

from math import nan, sqrt
from typing import Final, NamedTuple

import numpy as np

from calibration.matching.holding import Matched
from cosim.rate.allan import allan_deviation
from cosim.rate.run import RateRun
from gyro_model.errors import InputError

MATCHED: Final = 0.01
"""Split below which the modes are called matched [Hz] (Micromachines 16, 704, 2025)."""
SETTLING: Final = 5.0
"""From the start on in which the bias may still be looking for the match [s] (the same)."""


class Measures(NamedTuple):
    """matched_at: from when on no row shows more than MATCHED [s], nan where the last does; rms, largest: of the true
    split after ``since`` [s], in Hz; ratio: rms error of the blocks' own splits over their deviations; over_bound: over
    their Cramér–Rao bounds, nan where there are none; missed: blocks without an answer; walk: angle random walk at rest
    [rad/√s] with its standard error, nan where it turns or is too short."""

    matched_at: float
    since: float
    rms: float
    largest: float
    ratio: float
    over_bound: float
    missed: int
    walk: float
    walk_error: float


def measures(run: RateRun, matched: Matched, since: float | None = None) -> Measures:
    """The figures of a run; ``since`` [s]: by default when it has matched, at the latest SETTLING or two blocks."""
    record = matched.record
    t, split = record["t"].to_numpy(), record["split_true"].to_numpy()
    off = np.flatnonzero(np.abs(split) > MATCHED)
    at = 0.0 if not len(off) else float(t[off[-1] + 1]) if off[-1] + 1 < len(t) else nan
    since = max(SETTLING, matched.blocks[min(2, len(matched.blocks)) - 1].t) if since is None else since
    held = split[t > since]
    if not len(held):
        raise InputError(f"duration {run.duration:g} s: the bias is set from {since:.4g} s on; give more than that")
    errors = np.array([(b.answer.split - truth_of(matched, b.t, b.length), b.answer.deviation, b.answer.bound or nan)
                       for b in matched.blocks if b.answer is not None]).reshape(-1, 3)  # fmt: skip
    return Measures(
        at,
        since,
        sqrt(float(np.mean(held**2))),
        float(np.abs(held).max()),
        _rms(errors[:, 0] / errors[:, 1]),
        _rms(errors[:, 0] / errors[:, 2]),
        sum(b.answer is None for b in matched.blocks),
        *_walk(run, record["rate"].to_numpy()[t > since], bool(record["rate_true"].to_numpy().any())),
    )


def truth_of(matched: Matched, end: float, length: float) -> float:
    """Mean of the true split over the measurement of ``length`` [s] that ends at ``end`` [s], in Hz."""
    t, split = (matched.record[name].to_numpy() for name in ("t", "split_true"))
    inside = (t > end - length * (1 - 1e-9)) & (t <= end * (1 + 1e-9))
    return float(split[inside].mean())


def _rms(values: np.ndarray) -> float:
    return sqrt(float(np.mean(values**2))) if len(values) else nan


def _walk(run: RateRun, rate: np.ndarray, turns: bool) -> tuple[float, float]:
    if turns or not run.closed:
        # In the open loop the answer at the match is as slow as the sense mode: its noise is that of a walk, not white.
        return nan, nan
    try:
        found = allan_deviation(rate, run.interval, run.white_from)
    except InputError:
        return nan, nan
    return found.angle_random_walk, found.angle_random_walk_error
