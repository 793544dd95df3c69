"""What no compensation can remove, from repeated cycles.

White noise is one floor. Two more lie above it: what no function of the *present* inputs can tell (it holds hysteresis
and lags, too), and what no function of their *history* can (left: turn-on, walk, noise). Where cycles repeat, every
function of history says the same in each, and the best of them is their mean: what one cycle differs by from the mean
of the others is what such a function leaves of it. The function of present inputs is a local plane through the nearest
blocks of the other cycles, or a sum of splines fitted on them: whichever leaves less.
"""

from collections.abc import Iterator
from functools import partial
from itertools import combinations
from typing import Final, NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial import cKDTree
from scipy.stats import chi2

from calibration.compensation.measures import spread_over_temperature
from calibration.compensation.methods import spline
from calibration.compensation.record import SIGNALS, Blocks, Floats, joined

REPEATS: Final = 0.02
"""Cycles repeat where their temperatures differ by less than this, rms, of the range."""
SHIFT: Final = 0.1
"""They are laid upon each other by a shift of at most this share of their length."""
GAP: Final = 5.0
"""Times the usual distance of two blocks at rest: nothing is read off between."""
NEIGHBOURS: Final = (6, 10, 16, 32, 64)
"""Blocks of which a local plane is made: the number that leaves least counts."""
SMOOTH: Final = 1e-4
"""Penalty of those splines: the middle of what the choice of a spline looks at."""
TAIL: Final = 0.025


class Floor(NamedTuple):
    """What is left at least. per_c: (max - min)/range [unit/°C], rms [unit], means over ``cycles``; low, high: factors
    of both that end their 95 % interval, by χ² of cycles - 1 degrees of freedom: a turn-on is one draw a cycle."""

    per_c: float
    rms: float
    low: float
    high: float
    cycles: int


class Floors(NamedTuple):
    """present, history: the two floors, or why there is none."""

    present: Floor | str
    history: Floor | str


def floors(cycles: list[Blocks], compensated: list[Blocks] | None = None, *, remembers: bool = True) -> Floors:
    """Of cycles of one device, the one held out among them.

    compensated: the same after a compensation. It is a function of the inputs' history, so that the floor stays, but
    cycles that repeat only nearly, or have a gap, differ by less; the same holds of the present inputs unless it
    ``remembers``.
    """
    rests = _at_rest(cycles)
    if len(rests) < 2:
        reason = "needs repeated cycles: record two or more, better three (±50 %)"
        return Floors(reason, reason)
    after = rests if compensated is None else _at_rest(compensated)
    return Floors(_present(rests if remembers else after), _history(after))


def _at_rest(cycles: list[Blocks]) -> list[Blocks]:
    rests = [cycle.part(cycle.at_rest) for cycle in cycles]
    return [rest for rest in rests if len(rest) >= NEIGHBOURS[0]]


def _pooled(cycles: list[Blocks], left: list[Floats]) -> Floor:
    spreads = [spread_over_temperature(cycle, values) for cycle, values in zip(cycles, left, strict=True)]
    rms = [float(np.mean(values**2)) for values in left]
    free = len(cycles) - 1
    low, high = (float(np.sqrt(free / chi2.ppf(share, free))) for share in (1 - TAIL, TAIL))
    return Floor(float(np.sqrt(np.mean(np.square(spreads)))), float(np.sqrt(np.mean(rms))), low, high, len(cycles))


def _history(cycles: list[Blocks]) -> Floor | str:
    span = max(float(np.ptp(cycle.temperature)) for cycle in cycles)
    shifts = [_shift(cycles[0], cycle) for cycle in cycles]
    worst = max(off for _, off in shifts)
    if worst > REPEATS * span:
        return f"needs cycles with the same course of temperature: these differ by {worst:.3g} rms"
    times = [cycle.t - cycle.t[0] - shift for cycle, (shift, _) in zip(cycles, shifts, strict=True)]
    curves = [partial(_between, CubicSpline(t, cycle.rate)) for t, cycle in zip(times, cycles, strict=True)]
    left, kept = [], []
    for k, (t, cycle) in enumerate(zip(times, cycles, strict=True)):
        others = np.stack([curve(t) for j, curve in enumerate(curves) if j != k])
        values = cycle.rate - others.mean(axis=0)
        inside = np.isfinite(values)
        kept.append(cycle.part(inside))
        left.append(values[inside])
    return _pooled(kept, left)


def _between(curve: CubicSpline, at: Floats) -> Floats:
    """The curve at times, shape (n,); NaN beyond its ends and in its gaps."""
    steps = np.diff(curve.x)
    last = np.clip(np.searchsorted(curve.x, at) - 1, 0, len(steps) - 1)
    outside = (at < curve.x[0]) | (at > curve.x[-1]) | (steps[last] > GAP * np.median(steps))
    return np.where(outside, np.nan, curve(at))


def _shift(first: Blocks, other: Blocks) -> tuple[float, float]:
    """By how much ``other`` starts later in its course than ``first`` [s], and by how much the temperatures then
    differ, rms."""
    t, step = first.t - first.t[0], float(np.median(np.diff(first.t)))
    most = int(SHIFT * t[-1] / step)
    best = (0.0, np.inf)
    for shift in step * np.arange(-most, most + 1):
        at = t + shift
        inside = (at >= 0) & (at <= other.t[-1] - other.t[0])
        if inside.sum() > 0.5 * len(t):
            apart = np.interp(at[inside], other.t - other.t[0], other.temperature) - first.temperature[inside]
            off = float(np.sqrt(np.mean(apart**2)))
            best = min(best, (float(shift), off), key=lambda found: found[1])
    return best


def _present(cycles: list[Blocks]) -> Floor:
    names = [name for name in SIGNALS if all(name in cycle.inputs for cycle in cycles)]
    spans = [max(float(np.ptp(np.concatenate([c.inputs[n] for c in cycles]))), 1e-12) for n in names]
    points = [np.stack([c.inputs[n] / s for n, s in zip(names, spans, strict=True)], axis=1) for c in cycles]
    found = []
    for neighbours in NEIGHBOURS:
        left = []
        for k, cycle in enumerate(cycles):
            seen = np.concatenate([p for j, p in enumerate(points) if j != k])
            rate = np.concatenate([c.rate for j, c in enumerate(cycles) if j != k])
            if len(seen) > neighbours:
                left.append(cycle.rate - _local_plane(seen, rate, points[k], neighbours))
        if len(left) == len(cycles):
            found.append(_pooled(cycles, left))
    found += [_pooled(cycles, left) for left in _curves(cycles, names)]
    return min(found, key=lambda floor: floor.rms)


def _curves(cycles: list[Blocks], names: list[str]) -> Iterator[list[Floats]]:
    """What sums of splines of the present inputs leave of each cycle, fitted on the others."""
    for inputs in [(name,) for name in names] + [pair for pair in combinations(names, 2)]:
        left = []
        for k, cycle in enumerate(cycles):
            others = joined([other for j, other in enumerate(cycles) if j != k])
            curve = spline.fit(others, 0.0, inputs, SMOOTH)
            left.append(cycle.rate - curve.at(cycle, "clamp").bias)
        yield left


def _local_plane(seen: Floats, values: Floats, at: Floats, neighbours: int) -> Floats:
    """Planes of least squares through the nearest points, shape of ``at`` (m, d) -> (m,)."""
    _, nearest = cKDTree(seen).query(at, k=neighbours)
    near = seen[nearest] - at[:, None, :]
    size = np.maximum(np.sqrt(np.mean(near**2, axis=(1, 2))), 1e-9)[:, None, None]
    design = np.concatenate([np.ones((*near.shape[:2], 1)), near / size], axis=2)
    gram = np.einsum("mki,mkj->mij", design, design)
    # Signals that move together make the plane's tilt unsure across them: a ridge of 1 % keeps it level there.
    gram += 0.01 * neighbours * np.diag([0.0, *np.ones(at.shape[1])])
    return np.linalg.solve(gram, np.einsum("mki,mk->mi", design, values[nearest])[..., None])[:, 0, 0]
