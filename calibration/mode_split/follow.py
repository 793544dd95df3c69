"""The split of a whole record through time: Q and the strength of the wander are found in the record itself."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy.optimize import minimize_scalar

from calibration.mode_split.checks import check_thermal, thermal_ratio
from calibration.mode_split.estimate import NothingFoundError, Question, about_line, check_length
from calibration.mode_split.record import Envelope, VoltageRecord
from calibration.mode_split.tracking import SplitTracker, Tracked, block_split, track
from gyro_model.errors import InputError
from gyro_model.progress import Progress

FEWEST_BLOCKS: Final = 3
"""Of a track: two for the split and its rate, one to tell a wander."""
Q_BLOCKS: Final = 30
"""Blocks in which Q is looked for: a median of 30 scatters by a quarter of one block's deviation."""
STEADIEST: Final = 1e-6
"""Of the loosest wander: a split that does not move in hours."""


@dataclass(frozen=True)
class Track:
    """A whole track. steps: from the first block with a hump on; blocks: in the record; block: length of one [s]; q: of
    the sense mode, given or the median over blocks; wander: as in ``SplitTracker``, the most likely one; doubts:
    what to know of the record."""

    steps: list[Tracked]
    blocks: int
    block: float
    q: float
    wander: float
    doubts: tuple[str, ...] = ()


def follow_split(
    record: VoltageRecord, question: Question, block: float, progress: Progress = lambda done, total: None
) -> Track:
    """The split of a record through time, by blocks of ``block`` [s]. progress: told the blocks done, and how many
    there are, those looked at for Q included.

    Raises InputError where the record holds fewer than FEWEST_BLOCKS or a block can't resolve the line width, saying
    how long each must be, and where the humps are not thermal, and NothingFoundError where no block shows a hump.
    """
    if not (np.isfinite(block) and block > 0):
        raise InputError(f"--track {block:g}: give the length of a block in s")
    if record.duration < FEWEST_BLOCKS * block:
        raise InputError(
            f"the record is {record.duration:.4g} s long: a track of blocks of {block:g} s needs at least "
            f"{FEWEST_BLOCKS} of them; record {FEWEST_BLOCKS * block:.4g} s or more, or give a shorter --track"
        )
    part, f_x, doubts = about_line(record, question, block, "a block of the track")
    known = replace(question, drive_frequency=f_x)
    count = int(part.duration / block)
    looks = 0 if question.q else min(count, Q_BLOCKS)
    q = question.q or _block_q(part, known, block, lambda done: progress(done, looks + count))
    check_length(block, f_x, q, "a block of the track")
    half_width = 0.5 * f_x / q
    loosest = half_width / block**1.5
    first = []
    for step in track(part, replace(known, q=q), block, loosest):
        first.append(step)
        progress(looks + step.t / block, looks + count)
    if not first:
        raise _nothing(block)
    if question.mass is not None and question.sense_gain is not None:
        mass, gain, kelvin = question.mass, question.sense_gain, question.temperature
        found = [thermal_ratio(step.block.model, mass, gain, kelvin) for step in first if step.block is not None]
        check_thermal(float(np.median(found)))
    wander = likely_wander(first, block, half_width, loosest)
    return Track(_filtered(first, block, half_width, wander)[0], count, block, q, wander, doubts)


def likely_wander(steps: Sequence[Tracked], block: float, half_width: float, loosest: float) -> float:
    """The strength of the random walk, up to ``loosest`` [Hz/s per √s], under which the answers of the blocks are most
    likely."""
    found = minimize_scalar(
        lambda log: _filtered(steps, block, half_width, float(np.exp(log)))[1],
        bounds=(np.log(loosest * STEADIEST), np.log(loosest)),
        method="bounded",
    )
    return float(np.exp(found.x))


def _filtered(steps: Sequence[Tracked], block: float, half_width: float, wander: float) -> tuple[list[Tracked], float]:
    """The track through the answers of the blocks, and minus its log-likelihood by the innovations."""
    tracker, surprise, result = SplitTracker(wander), 0.0, []
    for step in steps:
        tracker.predict(block)
        if step.block is not None:
            if tracker.covariance is not None:
                variance = tracker.covariance[0, 0] + step.block.deviation**2
                surprise += 0.5 * float(np.log(variance) + (step.block.split - tracker.mean[0]) ** 2 / variance)
            tracker.update(step.block.split, step.block.deviation, half_width)
        result.append(replace(step, split=float(tracker.mean[0]), deviation=tracker.deviation))
    return result, surprise


def _block_q(part: Envelope, question: Question, block: float, looked: Callable[[float], None]) -> float:
    """Median of the Q found in up to Q_BLOCKS blocks across the record; ``looked`` is told how many are done."""
    count = int(part.duration / block)
    found = []
    for done, index in enumerate(np.unique(np.linspace(0, count - 1, min(count, Q_BLOCKS)).astype(int))):
        looked(done)
        split = block_split(part.part(index * block, (index + 1) * block), question, SplitTracker(0.0))
        found += [] if split is None else [split.q]
    if not found:
        raise _nothing(block)
    return float(np.median(found))


def _nothing(block: float) -> NothingFoundError:
    return NothingFoundError(
        f"no thermal hump found in any block of {block:g} s: give a longer --track, --q, or another --span"
    )
