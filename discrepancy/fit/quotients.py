"""What changed parameters add to the voltage of runs: difference quotients by simulation, or by the variation of a
motion (``variation.py``) for those kinds of columns that it has been seen to give as simulation does."""

from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Final, NamedTuple

import numpy as np
from sympy import sympify

from discrepancy.data.record import Bools, Floats, Record
from discrepancy.fit.defect import distortion_names, distortions
from discrepancy.fit.simulate import Followed, Simulator
from discrepancy.fit.variation import Kind
from gyro_model import symbols
from gyro_model.anatomy import Effect, Force, Law, Map
from gyro_model.model import Model

FAR: Final = 1e6
"""Times the signal from which a motion has left all bounds: no step of a quotient is so large."""
FEWEST: Final = 5
"""Columns of a run for which its motion is followed: that takes as long as two simulations."""
HEAD: Final = 4000
"""Samples at the start of a run on which a kind is tried, and only where nothing shows there on all of it."""
SHOWN: Final = 1e-11
"""Of the signal: below, a change is the rounding of two runs, 1e-13 of it."""
FIRST_ORDER: Final = 1e-3
"""Of the signal: what a column that is larger adds to the motion bends it by more than first order."""
ALIKE: Final = 3e-3
"""Share of a column's rms by which the two ways may differ: a quotient's own curvature and rounding make 1e-3 of it,
and a share of this size costs a score its square."""
JUMPS: Final = 1e-3
"""Share of the samples, where forces bend the motion in places, that are no test: an acceleration taken while dry
friction turns round goes from one side to the other within a thousandth of the motion, and no slope says how far."""
SHARES: Final = (1.0, 1e-2, 1e-4)
"""Of a change by which the two ways are compared, until they are alike: beside dry friction samples jump where the
motion turns round, and a change that moves that place makes 2e-2 of a quotient of 3e-5 of the signal; a first guess of
a step may be far too large."""

Changes = Mapping[str, float]


class Point(NamedTuple):
    """A run at some parameters [SI], initial state included, and the voltage (n, axes) [V] that they give."""

    record: Record
    parameters: Mapping[str, float]
    v: Floats

    def changed(self, changes: Changes) -> tuple[Record, Mapping[str, float]]:
        """For the simulator."""
        return self.record, {**self.parameters, **changes}


class Quotients:
    """Columns of runs of a ``simulator``; signal: theirs [V rms]."""

    def __init__(self, simulator: Simulator, signal: float) -> None:
        self.simulator, self.signal = simulator, signal
        self._names = _names_of(simulator.model)
        self._kinds, self._bases = simulator.seen.kinds, simulator.seen.bases

    def compare(self, points: Sequence[Point], probes: Sequence[Changes]) -> None:
        """Tries those ``probes`` both ways of which the names do not say that the variation serves, and one for each
        new base, on the first run that shows them."""
        base = self._names.acting(points[0].parameters)
        if len(probes) < FEWEST or not self._bases.get(base, True):
            return
        own = {self._names.kind(changes): changes for changes in probes}
        new = [kind for kind, changes in own.items() if kind not in self._kinds and not self._names.smooth(changes)]
        if base not in self._bases:
            new += [kind for kind in own if self._kinds.get(kind, True)][:1]
        left: Mapping[Kind, Changes] = {kind: own[kind] for kind in new}
        for point in points:
            left = self._tried(point, base, self._tried_early(point, base, left))

    def _tried_early(self, point: Point, base: frozenset[str], new: Mapping[Kind, Changes]) -> Mapping[Kind, Changes]:
        """``_tried`` on the first HEAD samples."""
        record, parameters, v = point
        if not new or len(v) <= HEAD or record.drift:
            return new
        head = self.simulator.part(record, 0, HEAD)
        try:
            return self._tried(Point(head, parameters, v[:HEAD]), base, new)
        finally:
            self.simulator.forget([head])

    def _tried(self, point: Point, base: frozenset[str], new: Mapping[Kind, Changes]) -> Mapping[Kind, Changes]:
        """Compares both ways on one run; gives what that does not show."""
        motion = self.simulator.follow(point.record, point.parameters) if new else None
        if motion is None:
            if new:
                self._bases[base] = False
            return {}
        found: dict[Kind, bool] = {}
        for share in SHARES:
            left = [kind for kind in new if self._kinds.get(kind, True) and not found.get(kind, False)]
            shorter = {kind: self._names.shortened(point.parameters, new[kind], share) for kind in left}
            found |= self._compared(point, motion, shorter)
        for kind, alike in found.items():
            self._kinds.setdefault(kind, alike)
            self._bases[base] = self._bases.get(base, False) or alike
        return {kind: own for kind, own in new.items() if kind not in found and self._kinds.get(kind, True)}

    def _compared(self, point: Point, motion: Followed, new: Mapping[Kind, Changes]) -> Mapping[Kind, bool]:
        """Whether both ways are alike, of those of which one run shows it; what can't be varied is known at once."""
        varied = self.simulator.vary(motion, [point.changed(own) for own in new.values()])
        columns = dict(zip(new, varied, strict=True))
        self._kinds.update({kind: False for kind, column in columns.items() if column is None})
        shown = {kind: column for kind, column in columns.items() if column is not None}
        # A motion is followed in whole steps.
        beside = self._beside(point, parts=False)
        simulated = self.simulator.try_all([point.changed(new[kind]) for kind in shown], parts=False)
        found = {}
        for (kind, column), v in zip(shown.items(), simulated, strict=True):
            quotient = v - beside if v is not None else np.full_like(column, np.inf)
            size = _rms(quotient)
            # What is too large for the first order, as the first guess of a step, is no test.
            if size > SHOWN * self.signal and self._small(quotient):
                error = column - quotient
                shows = _without_jumps(error) if motion.motion.is_bent else np.ones(error.shape, bool)
                found[kind] = _rms(error[shows]) <= ALIKE * _rms(quotient[shows])
        return found

    def _small(self, column: Floats) -> bool:
        return bool(np.abs(column).max() <= FIRST_ORDER * self.signal)

    def columns(self, point: Point, probes: Sequence[Changes]) -> Floats:
        """What each set of changed parameters adds: (probes, n, axes) [V]."""
        result = np.empty((len(probes), *point.v.shape))
        self.fill(point, probes, list(result))
        return result

    def fill(self, point: Point, probes: Sequence[Changes], found: Sequence[Floats]) -> None:
        """Puts what each set of changed parameters adds into ``found``, arrays (n, axes) [V]; zero where the FMU
        refuses one or the motion leaves all bounds."""
        left = self._vary(point, probes, found)
        simulator, limit = self.simulator, FAR * self.signal
        # Both runs of a difference go in the same steps.
        for parts in (False, True):
            chosen = [i for i in left if simulator.refines(probes[i]) is parts]
            beside = self._beside(point, parts) if chosen else point.v
            jobs = [point.changed(probes[i]) for i in chosen]
            for i, v in zip(chosen, simulator.try_all(jobs, parts=parts), strict=True):
                if v is None or np.abs(v).max() > limit:
                    found[i][:] = 0
                else:
                    np.subtract(v, beside, out=found[i])

    def _beside(self, point: Point, parts: bool) -> Floats:
        """The voltage at a point, in whole steps or in parts of these."""
        own = point.record, point.parameters
        return self.simulator.run(*own, parts=parts) if self.simulator.differs(*own, parts) else point.v

    def _vary(self, point: Point, probes: Sequence[Changes], found: Sequence[Floats]) -> list[int]:
        """Fills in the columns that the variation gives; numbers of the others."""
        names = self._names
        served = self._bases.get(names.acting(point.parameters), False)
        chosen = [i for i, own in enumerate(probes) if served and self._kinds.get(names.kind(own), names.smooth(own))]
        motion = self.simulator.follow(point.record, point.parameters) if len(chosen) >= FEWEST else None
        if motion is None:
            return list(range(len(probes)))
        columns = self.simulator.vary(motion, [point.changed(probes[i]) for i in chosen])
        left = set(range(len(probes))) - set(chosen)
        for i, column in zip(chosen, columns, strict=True):
            if column is not None and self._small(column):
                found[i][:] = column
            else:
                left.add(i)
        return sorted(left)


def _rms(v: Floats) -> float:
    # A motion near all bounds has a size of infinity.
    with np.errstate(over="ignore"):
        return float(np.sqrt(np.mean(v**2)))


def _without_jumps(error: Floats) -> Bools:
    """Where an error (n, axes) is not among the largest JUMPS, one at least."""
    size = np.abs(error)
    kept = size.size - max(1, int(JUMPS * size.size))
    return np.asarray(size < np.partition(size.ravel(), kept)[kept])


def is_smooth(effect: Effect) -> bool:
    """Whether an effect acts without a corner, an event or anything that it carries along, so that what it changes is
    as smooth as the motion."""
    if effect.memories:
        return False
    if isinstance(effect, Force):
        motion = (symbols.x, symbols.x_dot, symbols.y, symbols.y_dot)
        rational = all(sympify(term).is_rational_function(*motion) for term in effect.force)
        return rational and not effect.states and effect.impulse is None
    # What a map changes is found at the samples themselves; the force is held between them.
    return isinstance(effect, Map) or (isinstance(effect, Law) and effect.event is None)


class _Names:
    """What the parameters of a model are."""

    def __init__(self, model: Model) -> None:
        own = [q for effect in model.effects for q in effect.parameters]
        self._starts = {q.name: q.start for q in own if q.role == "size"}
        self._shapes = {q.name for q in own if q.role == "shape"}
        rough = {q.name for effect in model.effects if not is_smooth(effect) for q in effect.parameters}
        self._rough = rough | distortion_names()

    def acting(self, parameters: Mapping[str, float]) -> frozenset[str]:
        """Names of the sizes that are not neutral, and of what acts on the record."""
        own = {name for name, start in self._starts.items() if parameters.get(name, start) != start}
        return frozenset(own | {defect.id for defect in distortions() if defect.acts(parameters)})

    def kind(self, changes: Changes) -> Kind:
        """Of a column."""
        alone = self._shapes.issuperset(changes)
        return tuple(sorted((n, v if n in self._shapes and not alone else None) for n, v in changes.items()))

    def shortened(self, parameters: Mapping[str, float], changes: Changes, share: float) -> Changes:
        """A share of what they change; shapes beside a size stay."""
        if share == 1.0:
            return changes
        alone = self._shapes.issuperset(changes)
        own = {name: parameters.get(name, self._starts.get(name, 0.0)) for name in changes}
        return {n: own[n] + share * (v - own[n]) if alone or n not in self._shapes else v for n, v in changes.items()}

    def smooth(self, changes: Changes) -> bool:
        """Whether what they change is as smooth as the motion."""
        return self._rough.isdisjoint(changes)


@lru_cache(maxsize=8)
def _names_of(model: Model) -> _Names:
    """Kept, since fits of pieces are many and a library of terms is long."""
    return _Names(model)
