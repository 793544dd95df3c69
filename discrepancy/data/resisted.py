"""A mass that hardly any spring holds, by what its forces make of its motion.

With a = d/m the speed is v' = -a v + (u - f sign x' + c)/m, so that the motion of a given a is linear in 1/m, f/m, c/m
and in each run's own start; a itself is found by trial (variable projection: G. Golub and V. Pereyra, SIAM Journal on
Numerical Analysis 10, 1973). Of what was measured only the sign of its speed is taken: where the same torque turned a
motor a tenth faster in one run than in another, an equation of integrals of the motion gave sixteen times the inertia.
While friction holds the mass at rest it takes up all of the force. Of a sensor of velocity it is the speed itself.
"""

from collections.abc import Sequence
from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d
from scipy.optimize import minimize_scalar
from scipy.signal import lfilter

from discrepancy.data.record import Floats, Record
from discrepancy.data.rubbed import sign

PLAINLY: Final = 0.5
"""Of what is left without it (rms), that is left at most with a force which resists plainly."""
SMOOTHED: Final = 200
"""Parts of a run over two of which its speed is smoothed before its sign is taken: noise has none."""
BACK: Final = 0.02
"""Share of the way that smoothed noise goes back while a mass moves one way."""
SLOWEST, FASTEST, TRIALS = 0.05, 1e3, 24
"""Times that damping takes the speed away within a run, and how many are tried besides none: each is half as much again
as the one before."""
SETTLED: Final = 1e-4
"""Of the logarithm of that, to which the best is found."""
BEYOND: Final = 1e9
"""Share of the motion, that a place leaves at most where no force will do."""
ALONE: Final = 0.05
"""Share of the motion's rms that is left at most by a mass and forces which are all that moves it: 0.013 of an axis in
its loop with friction and a constant force, 0.28 and more of shafts that carry a load by a spring."""
NEW: Final = 0.9
"""Share of twice its square that the square of the steps of noise has at least. White noise has all of it; 0.61 where
half a sample of a force, which is smooth, makes a rest of 0.0064 of noise of 0.0050."""
HELD: Final = [1, 2, 4]
"""Forces that rest acts on, of those of a motion."""


class Resisted(NamedTuple):
    """mass [kg], damping [N s/m]; friction and constant force [N], 0 where it does not plainly show; left: of the
    motion's rms."""

    m: float
    d: float
    friction: float
    constant: float
    left: float


def alternatives(records: Sequence[Record], gain: float) -> list[Resisted]:
    """What moves and resists a mass without a spring, for a sensor of ``gain`` [V/m], with neither, with either and
    with both of friction and a constant force, the fewest first, as far as a mass explains the motion; none for two
    axes, a sensor of acceleration, and where no force acted."""
    if any(record.axes > 1 or record.order > 1 or not record.u.any() for record in records):
        return []
    slow, still = ([_Motion(record, gain, at_rest=own) for record in records] for own in (1, None))
    found = _alternatives(records, slow)
    if [own.rests for own in slow] != [own.rests for own in still]:
        # A mass that turns round as the run begins has a speed of its own.
        moving = _alternatives(records, still)
        if moving and found and min(own.left for own in moving) < PLAINLY * min(own.left for own in found):
            return moving
    return found


def _alternatives(records: Sequence[Record], motions: Sequence["_Motion"]) -> list[Resisted]:
    length = max(len(record.t) / record.sample_rate for record in records)
    rates = [0.0, *np.geomspace(SLOWEST / length, FASTEST / length, TRIALS).tolist()]
    tried = [(rate, _products(motions, rate)) for rate in rates]
    kinds = ((False, False), (True, False), (False, True), (True, True))
    found = (_best(motions, tried, friction, constant) for friction, constant in kinds)
    return [own for own in found if own is not None]


def fewest(found: Sequence[Resisted]) -> Resisted | None:
    """Of alternatives the one of fewest forces that leaves no more than twice what all do; None of none."""
    least = min((own.left for own in found), default=0.0)
    return next((own for own in found if PLAINLY * own.left <= least), None)


def moves_alone(found: Sequence[Resisted]) -> bool:
    """Whether by these alternatives a mass and a force that resists, or is always there, are all that moves: what else
    a linear model sees, as the tones of a loop's reference, the force has made."""
    told = fewest(found)
    return told is not None and bool(told.friction or told.constant) and told.left <= ALONE


def leaves_noise(records: Sequence[Record], gain: float, told: Resisted) -> bool:
    """Whether what is ``told`` leaves no more of the motion than noise of the sensors, which is new at each sample."""
    own = [1 if told.friction else 0, 2, 4 if told.friction else 3]
    sizes = np.array([1.0, told.friction, told.constant]) / told.m
    left = [columns[:, -1] - columns[:, own] @ sizes for record in records
            for columns in (_Motion(record, gain).columns(told.d / told.m),)]  # fmt: skip
    steps = sum(float(np.sum(np.diff(rest) ** 2)) for rest in left)
    return steps > NEW * 2 * sum(float(rest @ rest) for rest in left)


def one_way(records: Sequence[Record]) -> bool:
    """Whether no run turns round and all go the same way, so that a friction is a constant force against the motion
    while it moves."""
    ahead = back = 0.0
    for record in records:
        part = max(len(record.t) // SMOOTHED, 1)
        way = np.cumsum(record.v, axis=0) if record.order else record.v
        steps = np.diff(uniform_filter1d(way, 2 * part + 1, axis=0, mode="nearest")[::part], axis=0)
        own = np.clip(steps, 0, None).sum(axis=0), np.clip(-steps, 0, None).sum(axis=0)
        if (np.minimum(*own) > BACK * (own[0] + own[1])).any():
            return False
        ahead, back = ahead + own[0], back + own[1]
    return bool((np.minimum(ahead, back) <= BACK * (ahead + back)).all())


class _Motion:
    """What a run shows of a mass [m or m/s], and the forces [N] on it: that of the record, the same while the mass
    moves, friction of 1 N, and a constant force of 1 N, also while it moves. at_rest: samples that it must stand still
    for to rest as the run begins, None for as long as a rest between strokes."""

    def __init__(self, record: Record, gain: float, at_rest: int | None = None) -> None:
        self.count, self.step, self.position = len(record.t), 1 / record.sample_rate, record.order == 0
        self.valid = record.valid
        self.moved: Floats = record.v[:, 0] * record.reference**record.order / gain
        smooth = uniform_filter1d(self.moved, 2 * (self.count // SMOOTHED) + 1, mode="nearest")
        speed = np.gradient(smooth) if self.position else smooth
        way = sign(speed)
        u = record.u[:, 0] if record.hold == "zero" else 0.5 * (record.u[:, 0] + np.append(record.u[1:, 0], 0.0))
        moves = np.abs(way)
        self.forces = np.vstack((u, u * moves, -way, np.ones(self.count), moves))
        still, least = moves < np.tanh(1.0), 2 * (self.count // SMOOTHED) + 1
        self.rests = bool(still[: at_rest or least].all())
        self.strokes = _strokes(still, least)

    def columns(self, rate: float) -> Floats:
        """What each force makes of the motion of 1 kg whose speed is taken away at that ``rate`` [1/s], and the motion,
        (n, 6), without what the run's start makes."""
        kept = np.exp(-rate * self.step)
        given = (1 - kept) / rate if rate > 0 else self.step
        made = lfilter([0.0, given], [1.0, -kept], self.forces, axis=1)
        # What friction has stopped begins anew.
        for begin, end in self.strokes:
            stroke = self.forces[HELD, begin:end]
            made[HELD, begin:end] = lfilter([0.0, given], [1.0, -kept], stroke, axis=1)
        begun = [] if self.rests else [kept ** np.arange(self.count, dtype=np.float64)]
        if self.position:
            made = _integral(made, self.step)
            begun = [np.ones(self.count), *(_integral(own, self.step) for own in begun)]
        columns = np.column_stack((*made, self.moved))
        if begun:
            start = np.linalg.qr(np.column_stack(begun))[0]
            columns -= start @ (start.T @ columns)
        return np.asarray(columns[self.valid])


def _strokes(at_rest: NDArray[np.bool_], least: int) -> list[tuple[int, int]]:
    """Where the samples between rests of so many samples at ``least`` begin and end, and the rests."""
    turns = np.flatnonzero(np.diff(at_rest)) + 1
    edges = [0, *turns.tolist(), len(at_rest)]
    long = {edge for begin, end in pairwise(edges) if at_rest[begin] and end - begin >= least for edge in (begin, end)}
    return list(pairwise(sorted({0, *long, len(at_rest)})))


def _products(motions: Sequence[_Motion], rate: float) -> Floats:
    """Products of all columns over all runs, (6, 6)."""
    return np.asarray(sum((c.T @ c for c in (own.columns(rate) for own in motions)), np.zeros((6, 6))))


def _best(motions: Sequence[_Motion], tried: Sequence[tuple[float, Floats]], friction: bool, constant: bool
          ) -> Resisted | None:  # fmt: skip
    """The damping, of those ``tried`` and between the best and its neighbours, that leaves least."""
    found = [_solved(products, rate, friction, constant) for rate, products in tried]
    best = min(range(len(found)), key=lambda i: found[i].left)
    between = [np.log(max(tried[i][0], tried[1][0] / 10)) for i in (max(best - 1, 0), min(best + 1, len(found) - 1))]
    if between[0] < between[1]:

        def at(log: float) -> Resisted:
            rate = float(np.exp(log))
            return _solved(_products(motions, rate), rate, friction, constant)

        def left(log: float) -> float:
            # Between two places at which no force will do a search has no difference of infinities to go by.
            return min(at(log).left, BEYOND)

        end = minimize_scalar(left, bounds=between, method="bounded", options={"xatol": SETTLED})
        found.append(at(float(end.x)))
    least = min(found, key=lambda own: own.left)
    return least if least.left < np.inf else None


def _solved(products: Floats, rate: float, friction: bool, constant: bool) -> Resisted:
    """The forces that leave least; all is left where the mass or the friction would be negative."""
    none = Resisted(np.inf, np.inf, 0.0, 0.0, np.inf)
    own = [1 if friction else 0, *([2] if friction else []), *([4 if friction else 3] if constant else [])]
    size = np.sqrt(np.diag(products))
    if not (size[own] > 0).all():
        return none
    scaled = products / np.outer(size, size)
    found = np.linalg.lstsq(scaled[np.ix_(own, own)], scaled[own, -1], rcond=None)[0]
    left = float(np.sqrt(max(1 - found @ scaled[own, -1], 0.0)))
    pushed, *more = found * size[-1] / size[own]
    if pushed <= 0:
        return none
    m, f = float(1 / pushed), float(more.pop(0) / pushed) if friction else 0.0
    c = float(more.pop(0) / pushed) if constant else 0.0
    return Resisted(m, rate * m, f, c, left) if f >= 0 else none


def _integral(y: Floats, step: float) -> Floats:
    """Along the last axis, from zero."""
    between = 0.5 * step * (y[..., 1:] + y[..., :-1])
    return np.concatenate((np.zeros((*y.shape[:-1], 1)), np.cumsum(between, axis=-1)), axis=-1)
