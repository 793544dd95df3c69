"""Fits parameters and initial states by full simulation: output error with innovations, Levenberg-Marquardt.

Initial states belong to one run each and are taken out of every linear problem by projection, run by run, so that its
size does not grow with the number of runs (G. H. Golub, V. Pereyra, SIAM J. Numerical Analysis 10, 1973).
"""

from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import replace
from itertools import pairwise
from math import inf
from typing import Final, NamedTuple

import numpy as np

from discrepancy.clock import OutOfTime
from discrepancy.criteria import Criteria
from discrepancy.data.algebra import inverse_scaled
from discrepancy.data.linear_fit import WeakForm, joined_form
from discrepancy.data.linear_fit import fit as fit_weak_form
from discrepancy.data.linear_start import BADLY, response
from discrepancy.data.record import LEVELS, Floats, Record, is_driven
from discrepancy.fit.colour import autoregression
from discrepancy.fit.fitted import Fitted, Free, bare
from discrepancy.fit.passive import passive
from discrepancy.fit.patience import CREEP, Patience
from discrepancy.fit.quotients import Point, Quotients
from discrepancy.fit.simulate import Job, Simulator
from discrepancy.fit.slow import adrift, as_slow, moved_along
from discrepancy.fit.whitening import Setting, Whitener, likeliest, whitener
from gyro_model.errors import InputError

BLOCKS: Final = 24
"""Blocks of a run for block statistics: enough for a variance from few runs, each many periods long."""
DEFAULT: Final = Criteria()
STATES: Final = ("x_start", "x_dot_start", "y_start", "y_dot_start")
SMALL, SMALLEST = 0.1, 1e-9
"""What a difference quotient may change the voltage by: over the noise, and over the signal (rounding of a run leaves
1e-13 of it). Errors of second order are then 1e-6 of a column and less, which matters where 1 - 1e-6 of it lies along
other parameters."""
DEAD: Final = 1e-15
"""Of the signal: below lies no change but rounding."""
UNSEEN: Final = 1e-10
"""Square of a column over that of the largest, below which a parameter shows nowhere: steps are set so that all are
alike to a factor of 1e3 after the noise filter; what a step of rounding leaves is 1e-7 of one and less."""
LINEAR: Final = 1e-5
"""The same over the signal where the residual is far above the noise."""
FAINT: Final = 2e-3
"""Residual over signal below which it may be a flicker of the sensor: above, a model is wrong, and a filter for flicker
would take an offset for a part of it."""
CLOSE: Final = 0.05
"""The same below which noise is seen alone where the motion has nothing: above, what is simulated and what is left are
alike at too many frequencies."""
HOPE: Final = 10.0
"""Times what the next step promises, that all steps together may bring."""
AS_PROMISED: Final = 0.05
"""Of what a step promised, by which what it brought may be off where columns serve once more: those were then right to
about as much, and what is left after the next step is the square of it."""
EXACTLY: Final = 1e-3
"""The same, below which the columns count as those of the point that was reached: deviations are then right to it."""
PART: Final = 0.1
"""Residual over signal from which they do not: columns are in proportion to the motion, and from rest, where a decay
shows neither stiffness nor damping, a fit of the initial states brings all that it promised."""
ATTEMPTS: Final = 10
"""Dampings tried until a step lowers the cost. With columns of an earlier point one is: new ones cost as much as a few
tries, and are what a step that fails lacks."""
PATIENT: Final = 5
HELD: Final = 1e-2
SHORTER: Final = (0.3, 0.1, 0.03, 0.01)
"""Where so many larger dampings have not helped either, shares of a step of damping HELD are tried: they hold the
initial states too, which no damping does."""
NEXT: Final = 2.0
"""Times its cost, up to which a fit begins with places at zero: it has found a spring that goes with others, and finds
that for these in a step or two."""
PARTLY: Final = (1.0, 0.3, 0.1)
"""Shares of a step without damping that are tried where one with it creeps."""
ALIKE: Final = 3.0
"""By which a difference quotient's step may be off and its column, scaled, still serve."""
FARTHEST: Final = 30.0
"""Times the motion at the reference frequency, how far off a mass begins where no sensor sees places: what samples say
of that is held back by as much as it is less sure. Of twelve fits of a free mass by an accelerometer three ended at the
noise without, and ten with any from 3 to 100."""
SETTLED: Final = 0.02
"""A fit has ended when a further step would take less than this many variances of an innovation from the cost: an
error of 0.14 standard deviations of one parameter at most."""


class _Linear(NamedTuple):
    """Of a run: grams (p, p) of each block without the states, the states' share of each column (states, p), and the
    square of what each free parameter changes [V²]."""

    grams: list[Floats]
    fill: Floats
    square: Floats


class _Lower(NamedTuple):
    """A model of lower cost, None where no step led to one; the damping for the next step; whether only a share of a
    step that also holds the initial states did."""

    at: Fitted | None
    damping: float
    held: bool = False


class _Kept(NamedTuple):
    """Of a run, where it was linearised last: all parameters, there and where they are alike, and by name the step and
    what it changes, (n, axes) [V]."""

    points: list[Mapping[str, float]]
    columns: dict[str, tuple[float, Floats]]


class Fitter:
    """Fits the runs ``records`` with one simulator. What it found by difference quotients it keeps until a fit has
    moved on."""

    def __init__(
        self,
        simulator: Simulator,
        records: Sequence[Record],
        blocks: int = BLOCKS,
        criteria: Criteria = DEFAULT,
    ) -> None:
        self.simulator, self.records, self.blocks, self.criteria = simulator, tuple(records), blocks, criteria
        self.axes = self.records[0].axes
        self.period = 1 / self.records[0].sample_rate
        self._longest = self.period * max(len(record.t) for record in self.records)
        self._driven = is_driven(self.records)
        self._stateful = [e for e in simulator.model.effects if e.starts]
        self.signal = _rms(self.records) or _rms([simulator.run_of(record) for record in self.records])
        self.quotients = Quotients(simulator, self.signal)
        self._kept: dict[int, _Kept] = {}

    def begin(
        self, nominal: Mapping[str, float], more: Sequence[Free] = (), shown_by: Sequence[Record] | None = None
    ) -> Fitted:
        """The start of a fit: m, k, d by the weak form, which has no other minimum, at rest. ``more``: parameters to
        fit beside them; shown_by: runs that show m, k, d, where they are others."""
        records = self.records if shown_by is None else tuple(shown_by)
        form = joined_form(records, nominal)
        parameters = dict(nominal)
        if form is not None:
            parameters |= damped(_response(records, form, nominal), nominal)
        one = self.axes == 1
        names: tuple[str, ...] = ("m", "kxx", "dxx") if one else ("m", "kxx", "kyy", "kxy", "dxx", "dyy", "dxy")
        if not is_driven(self.records):
            # A free decay is the same for every mass: it is held, as the gauge of all forces.
            names = names[1:]
        free = (*(_nominal(name, parameters) for name in names), *more)
        return self.whitened(
            self.evaluated(Fitted(parameters, self.starts(parameters), free, self.plain(parameters), ()))
        )

    def plain(self, parameters: Mapping[str, float]) -> Whitener:
        """No whitening."""
        return self.whitener(parameters, Setting())

    def whitener(self, parameters: Mapping[str, float], setting: Setting) -> Whitener:
        """The filter of a setting for these runs."""
        return whitener(parameters, self.axes, self.period, setting, max(len(r.t) for r in self.records))

    def starts(self, parameters: Mapping[str, float]) -> tuple[Mapping[str, float], ...]:
        """Initial states of every run: as known, or zero."""
        names, gain = STATES[: 2 * self.axes], parameters["sense_gain_x"]
        return tuple({**dict.fromkeys(names, 0.0), **_known(record, gain)} for record in self.records)

    def passive(self, parameters: Mapping[str, float]) -> dict[str, float]:
        """``parameters`` of a device that makes no energy, as far as these runs are long."""
        return passive(parameters, self.axes, self.simulator.model, self._longest)

    def held(self) -> "Fitter":
        """The same of a device that nothing makes run away, however slowly: far from the minimum a fit that may use
        that ends there."""
        found = copy(self)
        found._longest = inf
        return found

    def state_names(self, at: Fitted) -> list[str]:
        """Of the initial states that a fit of ``at`` finds: those of the device, and of effects that act; and of the
        levels of runs of which the mean was taken out."""
        now, free = at.parameters, {own.name for own in at.free}
        acting = (e for e in self._stateful if any(now.get(q.name, q.start) != q.start for q in e.sizes))
        # Of a free decay the start of a mode makes up for how it is coupled, which no sample shows then.
        shown = (e for e in acting if self._driven or free.isdisjoint(q.name for q in e.sizes))
        levels = LEVELS[: self.axes] if any(record.centred for record in self.records) else ()
        return [*STATES[: 2 * self.axes], *(q.name for e in shown for q in e.starts), *levels]

    def evaluated(self, at: Fitted) -> Fitted:
        """``at`` with residuals and cost of its parameters."""
        try:
            simulated = self.simulator.run_all(self._jobs(at, {}))
        except InputError:
            # Parameters that the FMU refuses: no better than a motion out of bounds.
            simulated = [np.full_like(r.v, np.nan) for r in self.records]
        residuals = tuple(r.v - v for r, v in zip(self.records, simulated, strict=True))
        return self._costed(replace(at, residuals=residuals))

    def _costed(self, at: Fitted) -> Fitted:
        cost, count = 0.0, 0
        for record, residual in zip(self.records, at.residuals, strict=True):
            if not np.isfinite(residual).all():
                return bare(replace(at, cost=np.inf, count=1))
            # A motion near all bounds has a cost of infinity.
            with np.errstate(over="ignore"):
                cost += float(np.sum(at.whiten(residual[None], record.valid) ** 2))
            count += int(record.valid.sum()) * self.axes
        return bare(replace(at, cost=cost, count=count))

    def whitened(self, at: Fitted) -> Fitted:
        """``at`` with the whitening that its residuals ask for."""
        off, valid = self.off(at), [r.valid for r in self.records]
        colour = autoregression([r.v for r in self.records], at.residuals, valid) if off < CLOSE else ()
        found = likeliest(at.parameters, self.period, at.residuals, valid, self.simulator.each, faint=off < FAINT,
                          colour=colour)  # fmt: skip
        return self._costed(replace(at, whiten=found))

    def still(self, at: Fitted) -> Fitted:
        """``at`` under its filter without the motion that it tracks, not fitted under it."""
        setting = at.whiten.setting
        if not setting.bandwidth:
            return at
        return self._costed(replace(at, whiten=self.whitener(at.parameters, replace(setting, bandwidth=0.0))))

    def off(self, at: Fitted) -> float:
        """The residual over the signal, rms; where nothing moves there is none to be off."""
        # A motion near all bounds is off by infinity, and so is one that left them.
        with np.errstate(over="ignore"):
            error = sum(float(np.sum(e[r.valid] ** 2)) for e, r in zip(at.residuals, self.records, strict=True))
        signal = sum(float(np.sum(r.v[r.valid] ** 2)) for r in self.records)
        off = float(np.sqrt(error / signal)) if signal else 0.0
        return off if np.isfinite(off) else float(np.inf)

    def target(self, at: Fitted) -> float:
        """The change of the voltage [V rms] that a difference quotient should make."""
        return max(min(SMALL * at.variance**0.5, LINEAR * self.signal), SMALLEST * self.signal)

    def _jobs(self, at: Fitted, changes: Mapping[str, float], only: int | None = None) -> list[Job]:
        chosen = range(len(self.records)) if only is None else (only,)
        return [(self.records[i], {**at.parameters, **at.starts[i], **changes}) for i in chosen]

    def _point(self, at: Fitted, run: int) -> Point:
        record = self.records[run]
        return Point(record, {**at.parameters, **at.starts[run]}, record.v - at.residuals[run])

    def columns(self, at: Fitted, run: int, probes: Sequence[Mapping[str, float]]) -> Floats:
        """What each set of changed parameters adds to the simulated voltage of a run: (probes, n, axes) [V]."""
        return self.quotients.columns(self._point(at, run), probes)

    def by_states(self, at: Fitted, run: int) -> Floats:
        """What initial states of a run add to its voltage, (states, n, axes) [V], each by LINEAR of the signal."""
        here = self._point(at, run).parameters
        return self.columns(at, run, self._changes(at, here, self._state_steps(at)))

    def _fill(self, at: Fitted, run: int, extra: Sequence[Mapping[str, float]], columns: Floats, *, near: bool) -> None:
        """Columns (p, n, axes) [V] by each state of this run and each free parameter, a full ``step`` of it, then of
        the ``extra`` probes; ``near``: those of the last point serve for the model's own."""
        point, steps = self._point(at, run), self._steps(at)
        here = point.parameters
        kept = self._kept.get(run)
        if kept is None or (here not in kept.points and not near):
            kept = self._kept[run] = _Kept([here], {})
        new = [n for n, step in steps.items() if not 1 / ALIKE < kept.columns.get(n, (0.0,))[0] / step < ALIKE]
        made = {name: np.empty_like(point.v) for name in new}
        own = self._changes(at, here, {name: steps[name] for name in new})
        self.quotients.fill(point, [*own, *extra], [*made.values(), *columns[len(steps) :]])
        kept.columns.update({name: (steps[name], column) for name, column in made.items()})
        sizes = self._state_steps(at) | {free.name: free.step for free in at.free}
        for column, (name, size) in zip(columns, sizes.items(), strict=False):
            step, quotient = kept.columns[name]
            np.multiply(quotient, size / step, out=column)

    def _vouch(self, at: Fitted) -> None:
        """Has what it keeps count as found at ``at``."""
        for run, kept in self._kept.items():
            kept.points.append({**at.parameters, **at.starts[run]})

    def forget(self) -> None:
        """Lets go of what it keeps."""
        self._kept.clear()

    @staticmethod
    def _side(at: Fitted, free: Free) -> float:
        """Up, but where a bound or passivity is in the way."""
        p = at.parameters
        cross = free.name in ("kxy", "dxy") and p[free.name] > 0
        return -1.0 if cross or p[free.name] + free.step > free.high else 1.0

    def _steps(self, at: Fitted) -> dict[str, float]:
        """Of difference quotients, by name."""
        return self._state_steps(at) | {free.name: self._side(at, free) * free.step for free in at.free}

    @staticmethod
    def _changes(at: Fitted, here: Mapping[str, float], steps: Mapping[str, float]) -> list[dict[str, float]]:
        """What each of the ``steps`` [SI], by name, changes of the parameters ``here``."""
        free = {own.name: own for own in at.free}
        return [
            free[name].at(here[name] + step, here) if name in free else {name: here.get(name, 0.0) + step}
            for name, step in steps.items()
        ]

    def _state_steps(self, at: Fitted) -> dict[str, float]:
        size = LINEAR * self.signal / abs(at.parameters["sense_gain_x"])
        speed = size * float(np.sqrt(at.parameters["kxx"] / at.parameters["m"]))
        level = dict.fromkeys(LEVELS, LINEAR * self.signal)
        return {name: level.get(name, speed if "dot" in name else size) for name in self.state_names(at)}

    def with_grams(self, at: Fitted, extra: Sequence[Mapping[str, float]] = (), *, near: bool = False) -> Fitted:
        """``at`` linearised, with columns in the order: free, ``extra`` probes (changed parameters), residual; the
        model's own may be those of a point that is ``near``.

        Steps of ``free`` that have become too large or small for their difference quotients are set anew.
        """
        points = [self._point(at, run) for run in range(len(self.records))]
        own = self._changes(at, points[0].parameters, self._steps(at))
        self.quotients.compare(points, [*own, *extra])
        runs = self.simulator.each(lambda run: self._linear(at, run, extra, near), range(len(self.records)))
        grams, fills = [g for run in runs for g in run.grams], [run.fill for run in runs]
        square = np.sum([run.square for run in runs], axis=0)
        return self._rescaled(replace(at, grams=np.array(grams), fill=tuple(fills)), square)

    def _linear(self, at: Fitted, run: int, extra: Sequence[Mapping[str, float]], near: bool) -> "_Linear":
        states, (n, axes) = len(self.state_names(at)), at.residuals[run].shape
        own = states + len(at.free)
        # One array, filtered in place: with some hundred columns it is most of the memory.
        columns = np.empty((own + len(extra) + 1, n, axes))
        self._fill(at, run, extra, columns[:-1], near=near)
        columns[-1] = at.residuals[run]
        # A change after which the device swings ever more has a column that is no slope.
        with np.errstate(over="ignore", invalid="ignore"):
            square = np.sum(columns[states:own] ** 2, axis=(1, 2))
            flat = at.whiten(columns, self.records[run].valid, columns).reshape(len(columns), -1)
            wild = ~np.isfinite(np.einsum("ij,ij->i", flat, flat))
        wild[-1] = False
        flat[wild], square[wild[states:own]] = 0.0, 0.0
        edges = np.linspace(0, n, self.blocks + 1).astype(int) * axes
        grams = [flat[:, begin:end] @ flat[:, begin:end].T for begin, end in pairwise(edges)]
        total = np.sum(grams, axis=0)
        # Those of the device come first, and may be known.
        known, fill = 2 * axes if self.records[run].begun else 0, np.zeros((states, len(columns) - states))
        unseen = self._adrift(at)
        names = self.state_names(at)
        sought = [i for i, name in enumerate(names) if i >= known and name not in unseen]
        unsure = [self._held_back(at, run, names[i]) for i in sought]
        fill[sought] = inverse_scaled(total[np.ix_(sought, sought)] + np.diag(unsure)) @ total[sought, states:]
        # Each column without what the states do of it.
        lift = np.hstack((-fill.T, np.eye(len(columns) - states)))
        return _Linear([lift @ gram @ lift.T for gram in grams], fill, square)

    def _rescaled(self, at: Fitted, square: Floats) -> Fitted:
        """``at`` with steps that change the voltage by ``target``; square: what the present ones do, summed [V²]."""
        assert at.grams is not None
        size = np.sqrt(square / sum(r.v.size for r in self.records))
        # What changes nothing keeps its step.
        factor = np.where(size > DEAD * self.signal, self.target(at) / np.maximum(size, DEAD * self.signal), 1.0)
        full = np.ones(at.grams.shape[1])
        full[: at.known] = factor
        free = tuple(replace(f, step=f.step * s) for f, s in zip(at.free, factor, strict=True))
        grams = at.grams * full[:, None] * full
        scaled = replace(at, free=free, grams=grams, fill=tuple(fill * full for fill in at.fill))
        step = self._step(scaled, 0.0)
        total = grams.sum(axis=0)
        own = np.array([*range(at.known), -1])
        ahead = np.append(step, -1.0)
        gain = float(total[-1, -1] - ahead @ total[np.ix_(own, own)] @ ahead)
        states = self._state_gain(scaled)
        return replace(scaled, left=max(gain + states, 0.0) / max(at.variance, 1e-300))

    @staticmethod
    def _state_gain(at: Fitted) -> float:
        assert at.grams is not None
        return at.cost - float(at.grams[:, -1, -1].sum())

    def fit(self, at: Fitted, rounds: int = 30, goal: float = np.inf, share: float = 0.0) -> Fitted:
        """The minimum near ``at``, linearised there, to a ``share`` of the cost. ``left`` says how far it is from a
        minimum: above SETTLED that was enough, the rounds were used up, no step helped, steps crept or were jagged, the
        time was over, or none could reach the ``goal``, a cost below which alone the fit matters."""
        at, enough = self._from_zero(at), max(SETTLED, share * at.count)
        damping, near, patience = 0.0, False, Patience(goal)
        try:
            at = self.with_grams(at) if at.cost < np.inf else at
            for _ in range(rounds):
                if near and (at.left < enough or self._far(at, goal)):
                    # Old columns show no end and no hope.
                    at, near = self.with_grams(at), False
                far = self._far(at, goal)
                if patience.is_over or at.left < enough or at.grams is None or far:
                    break
                moved, after, held = self._lower(at, damping, attempts=1 if near else ATTEMPTS)
                if moved is None:
                    if not near:
                        break
                    at, near = self.with_grams(at), False
                    continue
                damping, gained = after, self._gained(at, moved)
                patience.count(at.cost, moved.cost, gained, held=held)
                exact = abs(gained - 1) < EXACTLY and self.off(at) < PART
                near = abs(gained - 1) < AS_PROMISED and not exact
                if exact:
                    self._vouch(moved)
                at = self.with_grams(moved, near=near)
            at = self.with_grams(at) if near else at
        except OutOfTime:
            pass
        return at

    def _held_back(self, at: Fitted, run: int, state: str) -> float:
        """What is added to the square of a state's column, which holds a step back along a place that no sample
        shows: beside a spring that is nearly none it goes anywhere, and the spring with it."""
        if not self.records[run].order or "dot" in state or state in LEVELS:
            return 0.0
        return at.variance * (LINEAR / FARTHEST) ** 2

    def _adrift(self, at: Fitted) -> tuple[str, ...]:
        """Initial displacements that no sample shows: of a mass that nothing holds, where sensors do not see places. A
        fit of them goes as far as what is found of a spring beside them is too little."""
        if not all(record.order for record in self.records):
            return ()
        duration = self.period * max(len(self.simulator.run_of(record).t) for record in self.records)
        return adrift(at.parameters, self.axes, self.simulator.model, duration)

    def _from_zero(self, at: Fitted) -> Fitted:
        """``at`` with these displacements zero, where the motion is next to the same."""
        moved = at
        for name in self._adrift(at):
            if any(start.get(name) for start in moved.starts):
                starts = (moved_along(start, name, at.parameters, self.simulator.model) for start in moved.starts)
                moved = self.evaluated(replace(moved, starts=tuple(starts)))
        return moved if moved.cost < NEXT * at.cost else at

    @staticmethod
    def _far(at: Fitted, goal: float) -> bool:
        return at.cost - HOPE * at.left * at.variance > goal

    def _lower(self, at: Fitted, damping: float, attempts: int) -> _Lower:
        """A step that lowers the cost, where one of so many attempts does."""
        for attempt in range(attempts):
            moved = self.evaluated(self._moved(at, damping))
            if moved.cost < at.cost:
                lower = _Lower(moved, damping / 10 if damping > 1e-6 else 0.0)
                return self._along_valley(at, lower) if damping and self._gained(at, moved) < CREEP else lower
            damping = max(1e-5, 10 * damping)
            if attempt == PATIENT:
                # A force at rest is far from linear in the states.
                for share in SHORTER:
                    moved = self.evaluated(self._moved(at, HELD, share))
                    if moved.cost < at.cost:
                        return _Lower(moved, HELD, held=True)
        return _Lower(None, damping)

    def _along_valley(self, at: Fitted, lower: _Lower) -> _Lower:
        """``lower``, a damped step that brought next to nothing, or what leads further: of a bent valley a damping
        leaves nothing of the way along it, a share of a whole step goes it."""
        assert lower.at is not None
        for share in PARTLY:
            moved = self.evaluated(self._moved(at, 0.0, share))
            if moved.cost < lower.at.cost:
                return _Lower(moved, 0.0)
        return lower

    @staticmethod
    def _gained(at: Fitted, moved: Fitted) -> float:
        """Of what a step promised, what it brought."""
        return (at.cost - moved.cost) / (at.left * at.variance)

    def _step(self, at: Fitted, damping: float) -> Floats:
        """Changes of the free parameters in their steps: towards the minimum as far as the first bound, on from there
        along it, and so forth. So what is linear falls all the way, however many bounds are met: parameters that
        make up for each other, each put to its own bound, could end anywhere."""
        assert at.grams is not None
        total = at.grams.sum(axis=0)
        values = np.array([at.parameters[free.name] for free in at.free])
        step, own = np.zeros(at.known), list(range(at.known))
        while own:
            held = [i for i in range(at.known) if i not in own]
            right = total[own, -1] - total[np.ix_(own, held)] @ step[held]
            aim = inverse_scaled(total[np.ix_(own, own)], damping) @ right
            limits = np.array([self._limited(at.free[i], values[i], a) for i, a in zip(own, aim, strict=True)])
            if not np.isfinite((aim, limits)).all():
                # Columns or steps beyond all numbers say of no way how far it goes.
                break
            stopped = limits != aim
            if not stopped.any():
                step[own] = aim
                break
            way = np.where(aim != step[own], aim - step[own], 1.0)
            shares = np.where(stopped, np.clip((limits - step[own]) / way, 0.0, 1.0), 1.0)
            first = shares <= shares.min()
            step[own] = np.where(first, limits, step[own] + shares.min() * (aim - step[own]))
            own = [i for i, stays in zip(own, first, strict=True) if not stays]
        return step

    @staticmethod
    def _limited(free: Free, value: float, step: float) -> float:
        """A change of a parameter, in its steps, as far as its bounds let it."""
        aim = value + free.step * step
        bounded = free.bounded(value, aim)
        # Of a step that is next to none a bound may be beyond all numbers.
        with np.errstate(over="ignore"):
            return step if bounded == aim else (bounded - value) / free.step

    def _moved(self, at: Fitted, damping: float, share: float = 1.0) -> Fitted:
        """A ``share`` of the way to the minimum of what is linear at ``at``."""
        step = share * self._step(at, damping)
        parameters = dict(at.parameters)
        for free, change in zip(at.free, step, strict=True):
            # A step to a bound may miss it by a rounding.
            value = float(np.clip(parameters[free.name] + free.step * change, free.low, free.high))
            parameters.update(free.at(value, parameters))
        straight, bounds = parameters, {free.name: (free.low, free.high) for free in at.free}
        bent = as_slow(at.parameters, straight, bounds.keys(), self.simulator.model)
        bent |= {name: float(np.clip(bent[name], *own)) for name, own in bounds.items()}
        parameters = self.passive(bent)
        # What passivity took back counts for the states as well.
        step = np.array([(straight[f.name] + parameters[f.name] - bent[f.name] - at.parameters[f.name]) / f.step
                         for f in at.free])  # fmt: skip
        sizes, starts = self._state_steps(at), []
        for run, start in enumerate(at.starts):
            change = share * at.fill[run][:, -1] - at.fill[run][:, : at.known] @ step
            moved = zip(sizes.items(), change, strict=True)
            starts.append({**start, **{name: start.get(name, 0.0) + size * float(c) for (name, size), c in moved}})
        return bare(replace(at, parameters=parameters, starts=tuple(starts)))

    def covariance(self, at: Fitted) -> Floats:
        """Covariance of the free parameters: that by white innovations, widened in each direction where block
        statistics say more."""
        linear = at if at.grams is not None else self.with_grams(at)
        assert linear.grams is not None
        own = np.s_[: linear.known]
        inverse = inverse_scaled(linear.grams[:, own, own].sum(axis=0))
        scores = linear.grams[:, own, -1]
        blocks = inverse @ (scores.T @ scores) @ inverse
        white = inverse * linear.variance
        size = np.sqrt(np.maximum(np.diag(blocks) / np.maximum(np.diag(white), 1e-300), 1.0))
        step = np.array([free.step for free in linear.free]) * size
        return np.asarray(white * np.outer(step, step))

    def deviations(self, at: Fitted) -> dict[str, float]:
        """Standard deviation of each free parameter; infinite where its step, which should change the voltage as much
        as that of the others, changes nothing."""
        linear = at if at.grams is not None else self.with_grams(at)
        assert linear.grams is not None
        square = np.diag(linear.grams.sum(axis=0))[: linear.known]
        size = np.sqrt(np.diag(self.covariance(linear)))
        size = np.where(square > UNSEEN * np.max(square, initial=0.0), size, np.inf)
        return {free.name: float(value) for free, value in zip(at.free, size, strict=True)}


def _known(record: Record, gain: float) -> dict[str, float]:
    """The initial states that a run is known to have, for a sensor of that ``gain`` [V/m]."""
    return dict(zip(STATES, (own / gain for own in record.begun), strict=False)) if record.begun else {}


def _rms(records: Sequence[Record]) -> float:
    return float(np.sqrt(np.mean([np.mean(r.v**2) for r in records])))


def _response(records: Sequence[Record], form: WeakForm, nominal: Mapping[str, float]) -> Mapping[str, float]:
    """m, k, d by the weak form; beside forces that bend the response where a linear one explains next to nothing."""
    linear = fit_weak_form(form, nominal)
    driven = is_driven(records)
    if linear.unexplained > BADLY and driven:
        bent = response(records, nominal, driven, lowest=0, bent=True)
        if (
            bent
            and bent[1] <= BADLY
            and all(bent[0][name] > 0 for name in linear.values if name in ("m", "kxx", "kyy"))
        ):
            return bent[0]
    return linear.values


def damped(values: Mapping[str, float], nominal: Mapping[str, float]) -> dict[str, float]:
    """Damping well inside what a passive device has, so that a search can leave from there in every direction."""
    d = {name: max(values[name], 0.2 * nominal[name]) for name in values if name in ("dxx", "dyy")}
    if "dxy" in values:
        room = 0.5 * float(np.sqrt(d["dxx"] * d["dyy"]))
        d["dxy"] = float(np.clip(values["dxy"], -room, room))
    return {**values, **d}


def _nominal(name: str, parameters: Mapping[str, float]) -> Free:
    """With a step by which a mode of Q = 2000 turns by 1e-3: the first linearisation sets it anew."""
    if name == "m":
        return Free(name, 1e-6 * parameters["m"], low=1e-3 * parameters["m"])
    kind = name[0]
    low = -np.inf if name[1:] == "xy" else 1e-6 * parameters[name]
    return Free(name, (1e-6 if kind == "k" else 1e-3) * parameters[kind + "xx"], low)
