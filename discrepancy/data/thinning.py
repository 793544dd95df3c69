"""Records that are sampled far more often than anything moves: fewer samples, under a force that does the same.

A voltage between two others that hardly differ says little that these do not. The samples that stay are as they were
measured, so that noise, clipping and corners of the motion are what they are; the force is its mean between them.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from discrepancy.data.record import Floats, Record
from discrepancy.data.top import top_of_force, top_of_motion

MANY: Final = 100_000
"""Samples of all runs up to which none is left out. Of 1,500,000 samples, 10,000 a period, of a mass that rubs on a
bent spring the friction alone was named in 190 s, with 142 times the noise left; of a fifteenth of them both were named
in 41 s."""
ENOUGH: Final = 50.0
"""Samples a period of the fastest that moves or drives: what such a force drives is right to 1e-5 of the motion, and
corners of the motion are between few."""


def spare(records: Sequence[Record]) -> int:
    """Every how many-th sample will do; 1 where none is to spare. Of accelerations under a force all stay: they show
    the force of each instant, which a mean is not."""
    if records[0].order == 2 and any(record.u.any() for record in records):
        return 1
    asked = sum(len(record.t) for record in records) // MANY
    if asked < 2:
        return 1
    # Of a force that is noise a mean does as it does.
    tops = [(record.sample_rate, max(top_of_motion(record), top_of_force(record) or 0.0)) for record in records]
    most = [int(rate / (ENOUGH * top)) for rate, top in tops]
    return max(min(asked, *most), 1)


def thinned(record: Record, every: int) -> Record:
    """One of ``every`` samples of ``record``, under a force that is held between them and pushes as that did."""
    kept = slice(None, None, every)
    held = {name: _means(column, every) for name, column in record.conditions.items()}
    u = np.column_stack([_as_held(column, every, runs=record.hold != "zero") for column in record.u.T])
    drift = record.drift and record.drift._replace(taken=record.drift.taken[kept].copy())
    return replace(record, sample_rate=record.sample_rate / every, hold="zero", t=record.t[kept].copy(), u=u,
                   v=record.v[kept].copy(), valid=record.valid[kept].copy(), conditions=held,
                   drift=drift)  # fmt: skip


def _as_held(u: Floats, every: int, *, runs: bool) -> Floats:
    """The force of each step of ``every`` samples for u (n,), which ``runs`` straight from sample to sample or is held
    over each. It has the mean of u; where u acts earlier or later in a step than its middle, the steps before and after
    have what moves it there, so that all together push as u does, and when it does."""
    own, slope = (u, 0 * u) if not runs else ((u + np.append(u[1:], u[-1])) / 2, np.diff(u, append=u[-1]))
    place = np.arange(len(u)) % every - (every - 1) / 2
    # The first moment of a step over the square of its length, about its middle.
    moment = _means(own * place + slope / 12, every) / every
    found = _means(own, every)
    found[1:-1] += (moment[:-2] - moment[2:]) / 2
    if len(found) > 1:
        # At its ends a run has a neighbour on one side.
        found[0] -= moment[0] + moment[1] / 2
        found[1] += moment[0] / 2
        found[-2] -= moment[-1] / 2
        found[-1] += moment[-1] + moment[-2] / 2
    return found


def _means(values: Floats, every: int) -> Floats:
    """Of each ``every`` of ``values`` (n,), the last of fewer."""
    ends = np.append(np.arange(0, len(values), every), len(values))
    return np.add.reduceat(values, ends[:-1]) / np.diff(ends)
