"""Records that are sampled far more often than anything moves: fewer samples, under a force that does the same.

A voltage between two others that hardly differ says little that these do not. The samples that stay are as they were
measured, so that noise, clipping and corners of the motion are what they are; the force is its mean between them.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from discrepancy.data.record import Floats, Record

MANY: Final = 100_000
"""Samples of all runs up to which none is left out. Of 1,500,000 samples, 10,000 a period, of a mass that rubs on a
bent spring, nothing was named rightly in 190 s, and both effects in less than a minute where these were left."""
ENOUGH: Final = 50.0
"""Samples a period of the fastest that moves or drives: what such a force drives is right to 1e-5 of the motion, and
corners of the motion are between few."""
POWER: Final = 1e-4
"""Share of the power beside noise that may be faster than that."""
SCATTER: Final = 5.0
"""Of a sum of noise, in its standard deviations."""
BROAD: Final = 0.2
"""Share of a force's power from which noise is no noise but the force, as of a generator of noise: a mean does as it
does."""


def spare(records: Sequence[Record]) -> int:
    """Every how many-th sample will do; 1 where none is to spare. Of accelerations under a force all stay: they show
    the force of each instant, which a mean is not."""
    if records[0].order == 2 and any(record.u.any() for record in records):
        return 1
    asked = sum(len(record.t) for record in records) // MANY
    if asked < 2:
        return 1
    most = [int(record.sample_rate / (ENOUGH * _top(record))) for record in records]
    return max(min(asked, *most), 1)


def _top(record: Record) -> float:
    """The frequency [Hz] above which hardly anything but noise is in voltage and force."""
    found = [_top_of(column, record.sample_rate, broad=1.0) for column in record.v.T]
    found += [_top_of(column, record.sample_rate, broad=BROAD) for column in record.u.T if column.any()]
    return max(found)


def _top_of(signal: Floats, rate: float, *, broad: float) -> float:
    """The same of ``signal`` (n,), of which noise is what the upper half of its frequencies has of it on average; the
    lowest of all for one that is noise to the share ``broad``."""
    power = np.abs(np.fft.rfft((signal - signal.mean()) * np.hanning(len(signal)))) ** 2
    noise = float(power[len(power) // 2 :].mean())
    if noise * len(power) >= broad * power.sum():
        return rate / len(signal)
    rest = np.cumsum(power - noise)
    # Sums of noise scatter as the root of their number, and so does what is taken for its mean.
    beside = max(POWER * rest[-1], SCATTER * noise * np.sqrt(len(power)))
    return float(np.argmax(rest >= rest[-1] - beside) + 1) * rate / len(signal)


def thinned(record: Record, every: int) -> Record:
    """One of ``every`` samples of ``record``, under a force that is held between them and pushes as that did."""
    kept = slice(None, None, every)
    held = {name: _means(column, every) for name, column in record.conditions.items()}
    u = np.column_stack([_as_held(column, every, runs=record.hold != "zero") for column in record.u.T])
    return replace(record, sample_rate=record.sample_rate / every, hold="zero", t=record.t[kept].copy(), u=u,
                   v=record.v[kept].copy(), valid=record.valid[kept].copy(), conditions=held)  # fmt: skip


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
