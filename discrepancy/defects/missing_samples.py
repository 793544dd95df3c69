"""Samples of the voltage that were lost or doubled while the count of time went on: from there on v is early or late.

Where little noise is on it, the record shows it by itself: an autoregression with the force as its input predicts each
sample, and fails where some are lost (outliers in time series: A. J. Fox, J. Royal Statistical Society B 34, 1972);
their number is that which makes the prediction right again. Where noise hides that, a fit shows it: to first order
v_k = v(t_k + n T) differs by n (v_k+1 - v_k) from some k on; the k that explains most is a change point (E. S. Page,
Biometrika 41, 1954).
"""

from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from discrepancy.criteria import Criteria
from discrepancy.data.algebra import median_deviation
from discrepancy.data.record import Bools, Floats, Record
from discrepancy.fit.defect import Blemish, Data, Found, Left, Level
from gyro_model.quantities import size

SHARE: Final = 0.5
"""Of the residual's square of a run, that one jump must explain: where most of it is something else, that comes first.
Measured: the phase that dry friction adds at a resonance looks like a jump to 0.32 of it."""
LEAST: Final = 0.3
"""Samples of a jump as first seen: the fit has taken up part of it."""
MOST: Final = 50
"""Samples lost at once; more is another run."""
BLIND: Final = 2
"""Samples masked on both sides of a jump."""

ORDER: Final = 12
"""Of the autoregression: two modes, their noise and a filter."""
ROWS, ROUNDS = 3000, 3
"""Samples from which it is taken, and how often those that it predicts badly are left out."""
NORMAL, FAR = 6.0, 12.0
"""Robust deviations above which a sample is left out of it, and from which some may be lost there: far beyond what
rounding and clipping give."""
STARTS: Final = 0.05
"""Of the largest deviation that follows, from which a sample may be the first after a loss: what bends the motion is
not predicted either, a little before it too."""
PLACES: Final = 20
"""Of a run that are looked at, where the prediction fails most."""
AROUND: Final = 40
"""Samples to both sides by which a number is judged."""
AMONG: Final = 0.1
"""Of the largest deviation, above which another one beside has a cause of its own: with less it has 1 % of the power.
"""
MENDED, AS_BESIDE = 0.02, 10.0
"""Share of the square of what is not predicted there, and times that of the samples beside, above which a number
explains nothing."""

CLEARLY: Final = 3.0
"""Times as much that any other number must leave: a knock is bridged by several."""

SEEN: Final = 3.0
"""Times FAR that a loss is off at the mean slope, from which the prediction shows it wherever it is in a period."""

COUNT = size("missing_samples", "1", "samples lost (negative: doubled) in all runs")


class _Prediction(NamedTuple):
    """Of a run: numbers (2 ORDER axes, axes) for the last samples of v and u; deviation (axes,) [V] of what they do not
    tell; far (n,) in deviations, 0 where a sample or one before it is not valid."""

    numbers: Floats
    deviation: Floats
    far: Floats


def find(left: Left, criteria: Criteria) -> Found | None:
    """The jumps that runs show by themselves, or, where none does, the largest in each run's residual."""
    data = tuple(map(_jumps, left.records))
    if not any(data):
        data = tuple(_jump(record, residual) for record, residual in zip(left.records, left.residuals, strict=True))
    total = float(sum(sum(own[1::2]) for own in data))
    return Found(data, {"missing_samples": Level(total, total, total)}) if any(data) else None


def again(found: Found, record: Record, residual: Floats) -> Data:
    """The jumps of another run, whose simulation no fit has bent towards them."""
    return _jumps(record) or _shifted(record, residual) or _jump(record, residual)


def without(record: Record, data: Data) -> Record:
    """The run with v put back by the samples lost, what is unknown masked; data: sample and number of each jump, the
    last first."""
    v, valid = record.v.copy(), record.valid.copy()
    for k, n in zip(map(int, data[::2]), map(int, data[1::2]), strict=True):
        moved, count = np.arange(k, len(v)) - n, len(v)
        known = (moved >= k if n > 0 else moved < count) & (moved < count)
        v[k:][known] = v[np.clip(moved[known], 0, count - 1)].copy()
        seen = valid[np.clip(moved, 0, count - 1)] & known
        valid[k:] = seen
        valid[max(k - BLIND, 0) : k + abs(n) + BLIND] = False
    return replace(record, v=v, valid=valid)


def _jumps(record: Record) -> Data:
    """All of a run, the last first, by its own prediction."""
    if len(record.t) < 10 * AROUND:
        return ()
    told = _predicted(record)
    if told is None:
        return ()
    places: list[int] = []
    for k in np.flatnonzero(told.far > FAR):
        # One loss is seen as long as samples before it are used.
        if not places or k - places[-1] > ORDER:
            places.append(int(k))
    inner = [k for k in places if 2 * AROUND < k < len(record.t) - 2 * AROUND]
    worst = sorted(inner, key=lambda k: told.far[k : k + ORDER + 1].max())[-PLACES:]
    found = sorted({own for place in worst if (own := _at(record, told, place))})
    return tuple(float(value) for pair in reversed(found) for value in pair)


def _at(record: Record, told: _Prediction, place: int) -> tuple[int, int] | None:
    """Sample and number of a loss that is seen from ``place`` on: there, or where it is seen well."""
    far = told.far[place : place + ORDER + 1]
    starts = place, place + int(np.argmax(far > STARTS * far.max()))
    return next(((k, n) for k in starts if (n := _number(record, told, k))), None)


def _predicted(record: Record) -> _Prediction | None:
    """The autoregression, None where there is nothing to predict from."""
    signals, n = np.hstack((record.v, record.u)), len(record.t)
    past = sliding_window_view(signals, ORDER, axis=0)[:-1].reshape(n - ORDER, -1)
    now = record.v[ORDER:]
    usable = sliding_window_view(record.valid, ORDER + 1).all(axis=1)
    scale = np.sqrt(np.mean(past**2, axis=0))
    scale[scale == 0] = 1.0
    rows = np.flatnonzero(usable)
    if len(rows) < 10 * past.shape[1]:
        return None
    few = rows[:: max(len(rows) // ROWS, 1)]
    kept = np.ones(len(few), np.bool_)
    for _ in range(ROUNDS):
        numbers = np.linalg.lstsq(past[few][kept] / scale, now[few][kept], rcond=1e-13)[0]
        error = now[few] - past[few] / scale @ numbers
        # The median of a normal deviation's size.
        deviation = median_deviation(error)
        if not (deviation > 0).all():
            return None
        kept = (np.abs(error) < NORMAL * deviation).all(axis=1)
        if kept.sum() < 5 * past.shape[1]:
            return None
    far = np.zeros(n)
    error = now - past / scale @ numbers
    far[ORDER:] = np.where(usable, np.max(np.abs(error) / deviation, axis=1), 0.0)
    return _Prediction(numbers / scale[:, None], deviation, far)


def _number(record: Record, told: _Prediction, k: int) -> int:
    """How many samples were lost before ``k``, negative: doubled; 0 where none of up to ORDER explains what happens:
    more the prediction does not bridge."""
    begin, end = _window(told.far, k)
    v, u = record.v[begin : end + ORDER], record.u[begin : end + ORDER]
    if len(v) < end + ORDER - begin or not record.valid[begin : end + ORDER].all():
        return 0
    place, length = k - begin, end - begin
    beside = float(np.mean(np.delete(told.far[begin + ORDER : end], slice(place - ORDER, place + 1)) ** 2))
    none = np.zeros(length, np.bool_)
    # What is left comes no lower than what is beside.
    limit = min(max(MENDED * _unexplained(v[:length], u[:length], none, told), beside), AS_BESIDE * beside)
    left = {}
    for n in (0, *(n for count in range(1, ORDER + 1) for n in (count, -count))):
        kept = v[place - min(n, 0) :][: length - place - max(n, 0)]
        moved = np.vstack((v[:place], np.zeros((max(n, 0), v.shape[1])), kept))
        # Of none it may be the one sample that is off.
        unknown = np.zeros(len(moved), np.bool_)
        if n >= 0:
            unknown[place : place + max(n, 1)] = True
        left[n] = _unexplained(moved, u[: len(moved)], unknown, told)
    first, second, *_ = sorted(left, key=lambda n: left[n])
    return first if left[first] < min(limit, left[second] / CLEARLY) else 0


def _window(far: Floats, k: int) -> tuple[int, int]:
    """First sample and end of the surroundings of a loss before ``k``, without another thing that happens there, as a
    step of the force; all of them where that leaves too few."""
    begin, end = k - AROUND - ORDER, k + AROUND
    other = far > max(FAR, AMONG * far[k : k + ORDER + 1].max())
    before, after = np.flatnonzero(other[begin + ORDER : k - 1]), np.flatnonzero(other[k + ORDER + 1 : end])
    first = begin + 1 + int(before[-1]) if len(before) else begin
    last = k + ORDER + 1 + int(after[0]) if len(after) else end
    return (first if k - first >= ORDER else begin), (last if last - k > 2 * ORDER else end)


def _unexplained(v: Floats, u: Floats, unknown: Bools, told: _Prediction) -> float:
    """Mean square, in deviations, of what is not predicted of v with its ``unknown`` samples chosen for the least."""
    axes, rows = v.shape[1], len(v) - ORDER
    past = sliding_window_view(np.hstack((v, u)), ORDER, axis=0)[:-1].reshape(rows, -1)
    rest = ((v[ORDER:] - past @ told.numbers) / told.deviation).ravel()
    places = np.flatnonzero(unknown)
    if len(places) == 0:
        return float(np.mean(rest**2))
    # What one sample changes: itself, and the predictions of those that follow.
    made = np.zeros((len(places), axes, rows + ORDER + 1, axes))
    for axis in range(axes):
        follow = -told.numbers[axis * ORDER : (axis + 1) * ORDER][::-1]
        change = np.vstack((np.eye(axes)[axis], follow)) / told.deviation
        for own, k in zip(made[:, axis], places, strict=True):
            own[k - ORDER : k + 1] = change
    columns = made[:, :, :rows].reshape(len(places) * axes, -1).T
    rest = rest - columns @ np.linalg.lstsq(columns, rest, rcond=None)[0]
    return float(np.sum(rest**2) / max(len(rest) - columns.shape[1], 1))


def _jump(record: Record, residual: Floats) -> Data:
    """The largest that the residual shows, unless the record itself would show it and does not."""
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
    place, number = k + (inner.start or 0), float(np.sign(n) * max(round(abs(n)), 1))
    return () if _refuted(record, slope, place, number) else (float(place), number)


def _shifted(record: Record, residual: Floats) -> Data:
    """The place and number by which what was simulated comes nearest, of all; not to first order, which a few samples
    are beyond where a period has ten."""
    simulated, usable, count = record.v - residual, record.valid, len(residual)
    own = np.concatenate(([0.0], np.cumsum(np.sum(residual**2, axis=1) * usable)))
    best = (float(own[-1]) * (1 - SHARE), 0, 0)
    for n in (n for n in range(-MOST, MOST + 1) if n):
        at = np.clip(np.arange(count) + n, 0, count - 1)
        moved = np.sum((record.v - simulated[at]) ** 2, axis=1) * usable * (at == np.arange(count) + n)
        total = own[:-1] + np.cumsum(moved[::-1])[::-1]
        inner = slice(count // 50, count - max(count // 50, 1))
        k = int(np.argmin(total[inner])) + (inner.start or 0)
        best = min(best, (float(total[k]), k, n))
    _, k, n = best
    slope = np.gradient(simulated, axis=0)
    return () if n == 0 or _refuted(record, slope, k, float(n)) else (float(k), float(n))


def _refuted(record: Record, slope: Floats, place: int, number: float) -> bool:
    """Whether so many samples lost would be far off the record's own prediction, and none is near ``place``: then the
    model is off there, as one that lacks an effect is after a change of the force."""
    told = _predicted(record)
    if told is None:
        return False
    near = slice(max(place - len(slope) // 50, 0), place + len(slope) // 50)
    steps = np.max(np.sqrt(np.mean(slope[near] ** 2, axis=0)) / told.deviation)
    return bool(abs(number) * steps > SEEN * FAR and told.far[near].max() < FAR)


DEFECT = Blemish(
    id="missing_samples",
    parameters=(COUNT,),
    signature="from an instant on the residual is the voltage's slope, for a whole number of samples",
    source="A. J. Fox, J. Royal Statistical Society B 34, 1972; E. S. Page, Biometrika 41, 1954",
    find=find,
    without=without,
    again=again,
    counted=True,
)
