"""The values of shape parameters that a search tries: what the grids of an effect file mean on given runs."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Final

import numpy as np

from discrepancy.data.linear_fit import mode_frequencies
from discrepancy.data.modes import band_of
from discrepancy.data.record import Floats, Record
from discrepancy.fit.fitted import Fitted, Free
from gyro_model.quantities import Quantity

FINER: Final = 4.0
"""By which each refinement of a grid of resonances or instants is finer."""
STRIDE: Final = 3.0
"""By which a positive shape changes at most in one step of a refit: one that shows nowhere yet would leave for
infinity."""
FARTHEST: Final = 1000.0
"""Times the upper end of its grid, beyond which a refit does not follow a shape: a quality factor, whose grid is one
point, may go far up."""
ABOUT, WIDER = 5.0, 7
"""Of a grid for a part of an effect that may vanish: how far it reaches about its usual point, and its points; 1.7 from
one to the next."""
MOST: Final = 40
"""Points of an effect with several grids: beyond, the last grids keep to their middle."""


@dataclass(frozen=True)
class Points:
    """The grid of an effect: ``values`` of its shapes at each point, ``moved`` those that a refit moves, ``spacing`` of
    instants [s], 0 where there are none; ``middle`` a point at which most of the effect shows; ``ends`` of each
    shape."""

    values: tuple[Mapping[str, float], ...]
    moved: tuple[Quantity, ...]
    spacing: float
    middle: Mapping[str, float]
    ends: Mapping[str, tuple[float, float]]


def swing(records: Sequence[Record], frequency: float) -> float:
    """The ``frequency`` of a mode [Hz]; of one that no run is as long as a period of, since no spring holds the mass,
    the middle of what drives it."""
    longest = max(len(r.t) / r.sample_rate for r in records)
    return frequency if frequency * longest > 1 else 0.5 * max(band_of(r, r.u) for r in records)


class Grids:
    """Grids on ``records``; what the scales of signals are is found once, at the first fit."""

    def __init__(self, records: Sequence[Record], period: float) -> None:
        self.records, self.period = records, period
        self.duration = max(len(r.t) for r in records) * period
        self.begin = min(float(r.t[0]) for r in records)
        self._scales: dict[str, float] = {}

    def of(self, shapes: Sequence[Quantity], at: Fitted) -> Points:
        """The grid over all of ``shapes`` that are searched."""
        searched = [q for q in shapes if q.search is not None and q.search.tried]
        axes: list[Floats] = []
        ends: dict[str, tuple[float, float]] = {}
        for q in searched:
            own, so_far = self.along(q, at), int(np.prod([len(a) for a in axes]))
            ends[q.name] = float(own.min()), float(own.max())
            axes.append(own if len(own) * so_far <= MOST else own[len(own) // 2 : len(own) // 2 + 1])
        names = [q.name for q in searched]
        values = tuple(dict(zip(names, map(float, point), strict=True)) for point in product(*axes))
        instants = [q.search for q in searched if q.search is not None and q.search.kind == "instant"]
        spacing = self.duration / instants[0].points if instants else 0.0
        # An event at the start changes the whole run, a later one less of it.
        moved = tuple(q for q in searched if not q.integer)
        return Points(values, moved, spacing, values[0 if instants else len(values) // 4], ends)

    def forms(self, shapes: Sequence[Quantity], at: Fitted) -> list[Points]:
        """The grid of an effect, and for each shape that may move alone a further one: its middle, with that shape."""
        usual, found = self.of(shapes, at), []
        for q in shapes:
            if q.search is not None and q.search.alone:
                point = {**usual.values[len(usual.values) // 2], q.name: q.search.begins}
                found.append(replace(usual, values=(point,), moved=(*usual.moved, q)))
        return [usual, *found]

    @staticmethod
    def wider(shapes: Sequence[Quantity], middle: Mapping[str, float]) -> list[dict[str, float]]:
        """Points of ``shapes`` over a decade about a point ``middle`` of their grids."""
        factors = np.geomspace(1 / ABOUT, ABOUT, WIDER)
        axes = [np.clip(middle[q.name] * factors, q.low, q.high).tolist() for q in shapes]
        return [dict(zip((q.name for q in shapes), point, strict=True)) for point in product(*axes)]

    def along(self, q: Quantity, at: Fitted) -> Floats:
        """The values of one parameter that is searched."""
        grid = q.search
        assert grid is not None
        if grid.kind == "instant":
            return self.begin + self.duration * np.arange(grid.points) / grid.points
        if grid.kind == "resonance":
            top = self._highest(at)
            return np.geomspace(grid.low * top, min(grid.high * top, 0.4 / self.period), grid.points)
        if grid.kind == "quality":
            return np.array([grid.low])
        values = np.clip(np.geomspace(grid.low, grid.high, grid.points) * self._scale(q, grid.of, at), q.low, q.high)
        return np.unique(np.round(values)) if q.integer else values

    def _highest(self, at: Fitted) -> float:
        """The frequency of the device's highest mode [Hz], as ``swing`` has it."""
        return swing(self.records, float(mode_frequencies(at.parameters, self.records[0].axes)[-1]))

    def _scale(self, q: Quantity, of: str, at: Fitted) -> float:
        if of in ("itself", "1"):
            return q.typical if of == "itself" else 1.0
        if of == "duration":
            return self.duration
        if of not in self._scales:
            size = self._size(of, at)
            # Two digits: the same grid whatever the fit at hand, so that what was found for it serves again.
            self._scales[of] = float(f"{size:.1e}") if size > 0 else q.typical
        return self._scales[of]

    def _simulated(self, at: Fitted) -> list[Floats]:
        """The voltage by the fit, run by run or, where it is one of pieces, piece by piece."""
        ends = np.cumsum([len(e) for e in at.residuals])[:-1]
        measured = np.split(np.concatenate([r.v for r in self.records]), ends)
        return [v - e for v, e in zip(measured, at.residuals, strict=True)]

    def _size(self, of: str, at: Fitted) -> float:
        """What the device has of such a name, or how far a signal goes at most in these runs; in its unit."""
        if of == "dxx":
            return at.parameters[of]
        if of == "radian":
            return 1 / (2 * np.pi * self._highest(at))
        gain = abs(at.parameters["sense_gain_x"])
        if of in ("x", "y"):
            return max(float(np.max(np.abs(r.v - np.median(r.v, axis=0))[r.valid])) for r in self.records) / gain
        if of in ("x_dot", "y_dot") and self.records[0].order:
            # Of a sensor of velocity it is what is seen, of acceleration what that is at the reference.
            return self._size(of[0], at) * self.records[0].reference
        if of in ("x_dot", "y_dot"):
            steps = [np.abs(np.diff(v, axis=0)).max() for v in self._simulated(at)]
            return float(max(steps)) / (gain * self.period)
        if of in ("u_x", "u_y"):
            axis = min("xy".index(of[-1]), self.records[0].axes - 1)
            return max(float(np.max(np.abs(r.u[:, axis]))) for r in self.records)
        return max((float(np.ptp(r.conditions[of])) for r in self.records if of in r.conditions), default=0.0)


def free_shape(q: Quantity, value: float, period: float, ends: tuple[float, float]) -> Free:
    """A searched shape that stands at ``value``, for a refit; ``ends`` of its grid."""
    assert q.search is not None
    if q.search.kind == "instant":
        # An instant may go anywhere.
        return Free(q.name, period, max(q.low, 0.0), q.high)
    if q.search.alone:
        return Free(q.name, 1e-3 * abs(value), *q.search.alone)
    if q.low == 0.0:
        # One that may vanish is moved as a size is.
        return Free(q.name, 1e-3 * value, 0.0, q.high)
    return Free(q.name, 1e-3 * value, max(q.low, ends[0] / q.search.below), min(q.high, ends[1] * FARTHEST), STRIDE)


def free_usual(q: Quantity, shapes: Sequence[Quantity], values: Mapping[str, float]) -> Free:
    """A shape that stands at its usual one of ``values``, for a refit; ``shapes``: all of its effect."""
    if not values[q.name]:
        # One that is usually absent is moved as a size is.
        return Free(q.name, 1e-3 * q.typical, q.low, q.high)
    against = "".join(o.name for o in shapes if o.search and o.search.kind == "rest" and o.search.of == q.name)
    return replace(free_shape(q, values[q.name], 0.0, (q.typical, q.typical)), against=against)


def around(values: Mapping[str, float], moved: Sequence[Quantity], spacing: float) -> list[dict[str, float]]:
    """Points about ``values``, FINER times closer than where those come from, if that is a grid of resonances or of
    instants, ``spacing`` [s] apart; else none."""
    steps = np.arange(-FINER, FINER + 1)
    by_kind = {q.search.kind: q.name for q in moved if q.search is not None and q.name in values}
    if "resonance" in by_kind:
        name = by_kind["resonance"]
        widths = {w: values[w] * FINER for w in [by_kind.get("quality")] if w is not None}
        quality = next(iter(widths.values()), 10.0 * FINER)
        return [{**values, **widths, name: float(f)} for f in values[name] * (1 + steps / quality)]
    if "instant" in by_kind:
        name = by_kind["instant"]
        return [{**values, name: float(t)} for t in values[name] + spacing / FINER * steps if t >= 0]
    return []
