"""What each effect would add to the simulated voltage, found from the effect files alone: columns of the test.

A column is the change that the FMU shows when a size parameter leaves neutral by a probe, chosen so that the change is
small beside the residual's noise. So every stage (law, force with states, map, delay, lag) has its column without a
rule of its own, and an effect file that a user adds is scored as it stands. Sizes that act by a power (1/g by its
square) show it in how the change grows. Shape parameters are searched on the grids that their
effect files give: each grid point is a column, and each counts as a trial. An effect that changes
nothing alone, but reads or feeds another, is tried together with that one.
"""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Final, NamedTuple

import numpy as np
from sympy import sympify

from discrepancy.data.record import Floats, Record
from discrepancy.fit.defect import Defect, Distortion, distortions
from discrepancy.fit.fitted import Fitted, Free
from discrepancy.fit.refit import Fitter
from discrepancy.fit.simulate import OTHER_AXIS
from discrepancy.name.grids import FINER, Grids, around, free_shape, swing
from gyro_model.anatomy import SLOTS, Delay, Effect, Follow, Force, Lag, Law, Map
from gyro_model.model import Model
from gyro_model.quantities import Quantity
from gyro_model.units import dimension

NEVER: Final = 1e100
"""A neutral value beyond this is a limit that is never reached: no small step leaves it."""
STEEP: Final = 8
"""Power by which a change is taken to grow about a level, where none below it changes anything; the highest of all."""
LEVELLED: Final = 1e-3
"""Of a level, for a difference quotient."""
FARTHEST: Final = 1e6
"""Times the first guess, at which a probe is no size of anything: what changes nothing there never does."""
ATTEMPTS: Final = 8
"""Tries at a probe of the right size."""
GROWS: Final = 1.1
"""By how much twice a step changes more at least. What grows by less, and is too small, is no change of the device, but
rounding, or shorter steps of the plant beside what acts within them."""
Kind = Callable[[Effect | Defect], bool]
"""Says of an effect whether it is one of those that are asked for."""
HEAD: Final = 2000
"""Samples at the start of each run on which a probe is tried first."""
LONGER: Final = 2
"""Times as long as that, from which a probe is tried on whole runs too: what grows from their start is larger there, up
to six times in runs of twice the length, which is no matter for a quotient."""


def on_the_way(effect: Effect | Defect) -> bool:
    """Whether it acts on the way of force or voltage: a defect of the record, a delay or a lag."""
    return isinstance(effect, Defect | Delay | Lag)


@dataclass(frozen=True)
class Probe:
    """A size parameter away from neutral by ``step`` [its unit]; the voltage changes as its ``power``."""

    quantity: Quantity
    step: float
    power: int

    @property
    def one_sided(self) -> bool:
        """Whether the column can act with one sign only."""
        return (
            self.power % 2 == 0 or self.quantity.low >= self.quantity.start or self.quantity.high <= self.quantity.start
        )

    def value(self, amplitude: float) -> float:
        """The parameter whose column is ``amplitude`` times that of the probe."""
        size = self.step * abs(amplitude) ** (1 / self.power)
        signed = size if self.power % 2 == 0 or amplitude > 0 else -size
        return float(np.clip(self.quantity.start + signed, self.quantity.low, self.quantity.high))

    def free(self) -> Free:
        """The parameter for a refit."""
        step = abs(self.step) * (LEVELLED if self.power == STEEP else 1.0)
        return Free(self.quantity.name, step, self.quantity.low, self.quantity.high)


@dataclass(frozen=True)
class Candidate:
    """An effect with its probes at one choice of shape parameters; ``searched`` are those that the refit may move.

    trials: grid points of the search that it belongs to. partner: an effect without which it changes nothing. spacing:
    of the grid [s], where that is one of instants; ends: of the grid of each shape, where it has one.
    """

    effect: Effect | Defect
    probes: tuple[Probe, ...]
    shapes: Mapping[str, float]
    searched: tuple[Quantity, ...] = ()
    trials: int = 1
    partner: "Candidate | None" = None
    spacing: float = 0.0
    ends: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    @property
    def all_probes(self) -> tuple[Probe, ...]:
        """The partner's probes, then its own: a column each."""
        return (*(self.partner.probes if self.partner else ()), *self.probes)

    def changes(self) -> list[dict[str, float]]:
        """The changed parameters of each column; a column of its own has the partner's changes too."""
        before = self.partner.changes() if self.partner else []
        joint = {name: value for change in before for name, value in change.items()}
        own = [{**joint, **self.shapes, p.quantity.name: p.quantity.start + p.step} for p in self.probes]
        return [*before, *own]

    def values(self, amplitudes: Sequence[float], deviations: Sequence[float]) -> dict[str, float]:
        """The size parameters of these column amplitudes (with standard deviations)."""
        split = len(self.all_probes) - len(self.probes)
        own = dict(zip(self.probes, amplitudes[split:], strict=True))
        values = {}
        for probe, amplitude, deviation in zip(self.all_probes[:split], amplitudes, deviations, strict=False):
            # Columns of its own hold the partner's; a product is shared so that both keep a size.
            total = amplitude + sum(own.values())
            least = deviation if np.isfinite(deviation) else 1.0
            kept = max(total, least) if probe.one_sided else (total or least)
            values[probe.quantity.name] = probe.value(kept)
            share = (values[probe.quantity.name] - probe.quantity.start) / probe.step
            own = {p: a / share if share else a for p, a in own.items()}
        return values | {p.quantity.name: p.value(a) for p, a in own.items()}

    def renamed(self, effect: Effect | Defect, names: Mapping[str, str]) -> "Candidate":
        """The same of another effect of its kind, whose parameters have other ``names``."""
        own = {q.name: q for q in effect.parameters}
        probes = tuple(replace(p, quantity=own[names[p.quantity.name]]) for p in self.probes)
        shapes = {names[name]: value for name, value in self.shapes.items()}
        return replace(self, effect=effect, probes=probes, shapes=shapes,
                       searched=tuple(own[names[q.name]] for q in self.searched),
                       ends={names[name]: ends for name, ends in self.ends.items()})  # fmt: skip

    def free(self, period: float) -> tuple[Free, ...]:
        """The parameters for a refit."""
        shapes = [free_shape(q, value, period, self.ends.get(q.name, (value, value)))
                  for q, value in ((q, self.shapes[q.name]) for q in self.searched)]  # fmt: skip
        before = self.partner.free(period) if self.partner else ()
        return (*before, *(p.free() for p in self.probes), *shapes)


def nameable(model: Model, *, limits: bool = False) -> tuple[Effect, ...]:
    """The effects that a diagnosis may name: neither the device itself nor noise nor gauge; those that small steps
    show, or ``limits``."""
    effects = (e for e in model.effects if not (e.nominal or e.noise or is_gauge(e)))
    return tuple(e for e in effects if limits != all(abs(q.start) < NEVER for q in e.sizes))


def is_gauge(effect: Effect) -> bool:
    """Whether an effect scales both voltages alike, whatever they are: no sample tells it from another mass, stiffness
    and damping (docs/theory/plant.md, eq. 4)."""
    if not isinstance(effect, Map):
        return False
    enters = SLOTS[effect.slot].enters
    ratios = [sympify(left) / entered for left, entered in zip(effect.output, enters, strict=True)]
    own = {q.symbol for q in effect.parameters}
    return bool(ratios[0] == ratios[1] and ratios[0].free_symbols <= own)


def is_across(effect: Effect) -> bool:
    """Whether an effect changes nothing of x alone, so that a record of one axis knows nothing of it."""
    return isinstance(effect, Law) and {q.name for q in effect.changes} <= OTHER_AXIS


Probes = dict[tuple[str, str], tuple[Probe, float]]
"""By a size's name and the id of the partner beside which it acts: a probe and the change [V rms] it is for."""
Silent = dict[tuple[str, str], frozenset[str]]
"""By the ids of an effect and of the partner beside which it was tried, if any: what could have woken it and has
not."""


class Library:
    """All candidates of a model; to ``kept`` it adds the probes that it finds, which serve other parts of the runs and
    later scans: they are off by less than what makes a quotient wrong; to ``silent`` what changes nothing, which serves
    other parts only where conditions are steady."""

    def __init__(self, fitter: Fitter, kept: Probes | None = None, silent: Silent | None = None) -> None:
        self.model, self.records = fitter.simulator.model, fitter.records
        self.period = fitter.period
        self.grids = Grids(self.records, fitter.period)
        self.kept: Probes = {} if kept is None else kept
        self._silent: Silent = silent if silent is not None and _steady(self.records) else {}

    def candidates(
        self, fitter: Fitter, at: Fitted, present: Sequence[str], among: Kind | None = None
    ) -> list[Candidate]:
        """Every effect beside those ``present``, or of those ``among`` which alone it looks, that changes the voltage
        of these runs, at each point of its grid."""
        scale = _Scale(fitter, at)
        found: list[Candidate] = []
        silent: list[Effect | Defect] = []
        own_axes = self.records[0].axes
        tried: list[Effect | Defect] = [
            *(e for e in nameable(self.model) if own_axes == 2 or not is_across(e)),
            *(d for d in distortions() if d.axes <= own_axes and not d.gauge),
        ]
        for effect in tried:
            if effect.id not in present and (among is None or among(effect)):
                own = self._heard(effect, scale, at, present)
                found += own
                silent += [] if own else [effect]
        for effect in silent:
            still: set[str] = set()
            for partner in list(found):
                if isinstance(effect, Defect) or isinstance(partner.effect, Defect):
                    continue
                if partner.partner is None and partner.effect.id not in still and _linked(effect, partner.effect):
                    own = self._heard(effect, scale, at, present, partner)
                    found += [replace(c, partner=partner) for c in own]
                    # What is silent beside an event at the start is so beside a later one.
                    still |= set() if own else {partner.effect.id}
        return found

    def _heard(self, effect: Effect | Defect, scale: "_Scale", at: Fitted, present: Sequence[str],
               partner: Candidate | None = None) -> list[Candidate]:  # fmt: skip
        """Its candidates; none, untried, where it changed nothing before and nothing has come in that could wake it."""
        key = effect.id, partner.effect.id if partner else ""
        wakers = self._wakers([effect, *([partner.effect] if partner else [])], present)
        own = [] if self._silent.get(key) == wakers else self._of(effect, scale, at, partner)
        if not own:
            self._silent[key] = wakers
        return own

    def _wakers(self, asleep: Sequence[Effect | Defect], present: Sequence[str]) -> frozenset[str]:
        """Ids of those ``present`` that share a symbol with one ``asleep``, or with one that does."""
        symbols = set().union(*(_touched(e) for e in asleep if not isinstance(e, Defect)))
        apart = [e for e in self.model.effects if e.id in present]
        found: set[str] = set()
        while near := [e for e in apart if not symbols.isdisjoint(_touched(e))]:
            found |= {e.id for e in near}
            symbols = symbols.union(*(_touched(e) for e in near))
            apart = [e for e in apart if e.id not in found]
        return frozenset(found)

    def _of(
        self, effect: Effect | Defect, scale: "_Scale", at: Fitted, partner: Candidate | None = None
    ) -> list[Candidate]:
        if isinstance(effect, Distortion) and effect.levels:
            levels = effect.levels(self.records)
            return [
                Candidate(effect, (Probe(effect.sizes[0], level, STEEP),), {}, trials=len(levels)) for level in levels
            ]
        grid, *others = self.grids.forms([q for q in effect.parameters if q.role == "shape"], at)
        base = {k: v for change in partner.changes() for k, v in change.items()} if partner else {}
        probes = []
        for q in effect.sizes:
            key = q.name, partner.effect.id if partner else ""
            probe = self._scaled(key, scale.target) or scale.probe(q, grid.middle, base)
            if probe:
                self.kept[key] = probe, scale.target
                probes.append(probe)
        own, far = tuple(probes), [p for q in probes for p in self._far(q.quantity, at)]
        trials = sum(len(form.values) for form in (grid, *others)) + len(far)
        points = [Candidate(effect, own, s, form.moved, trials, None, form.spacing, form.ends)
                  for form in (grid, *others) for s in form.values]  # fmt: skip
        points += [Candidate(effect, (p,), grid.middle, grid.moved, trials, ends=grid.ends) for p in far]
        return points if probes else []

    def _far(self, q: Quantity, at: Fitted) -> list[Probe]:
        """Probes of a size far from neutral, where its effect file says that it is to be tried there too."""
        return [Probe(q, float(value) - q.start, 1) for value in self.grids.along(q, at)] if q.search else []

    def _scaled(self, key: tuple[str, str], target: float) -> Probe | None:
        """The probe that was found before, for a change of ``target``: a smaller gap asks for a smaller one."""
        if key not in self.kept:
            return None
        probe, before = self.kept[key]
        room = abs((probe.quantity.high if probe.step > 0 else probe.quantity.low) - probe.quantity.start)
        step = min(abs(probe.step) * (target / before) ** (1 / probe.power), room)
        return replace(probe, step=float(np.copysign(step, probe.step)))


class Fading(NamedTuple):
    """A part of a force that may vanish: with its ``size``, one of the shapes, at 0 the ``shapes`` say nothing."""

    size: Quantity
    shapes: tuple[Quantity, ...]

    @property
    def names(self) -> set[str]:
        """All its parameters."""
        return {self.size.name, *(q.name for q in self.shapes)}


def fading(candidate: Candidate) -> Fading | None:
    """The part of the effect that may vanish, None where it has none."""
    effect = candidate.effect
    if not isinstance(effect, Force):
        return None
    for q in candidate.searched:
        if q.low == q.start == 0.0:
            left = set().union(*(term.subs(q.symbol, 0).free_symbols for term in effect.force))
            silent = tuple(s for s in candidate.searched if s is not q and s.symbol not in left)
            if silent:
                return Fading(q, silent)
    return None


def left_out(effect: Effect | Defect, free: Collection[str]) -> Fading | None:
    """The part of an effect that may vanish, where none of it is among what is ``free``; None where the effect has none
    or a fit has it."""
    searched = tuple(q for q in effect.parameters if q.search is not None and q.search.tried and not q.integer)
    part = fading(Candidate(effect, (), {}, searched))
    return part if part and part.names.isdisjoint(free) else None


def without_part(candidate: Candidate, part: Fading) -> Candidate:
    """``candidate`` with that part of it gone for good."""
    searched = tuple(q for q in candidate.searched if q.name not in part.names)
    return replace(candidate, shapes={**candidate.shapes, part.size.name: 0.0}, searched=searched)


def with_part(candidate: Candidate, part: Fading, values: Mapping[str, float]) -> Candidate:
    """``candidate`` with that part of it, at these ``values`` of its parameters."""
    others = (q for q in candidate.searched if q.name not in part.names)
    return replace(candidate, shapes={**candidate.shapes, **values}, searched=(*others, part.size, *part.shapes))


def finer(candidate: Candidate) -> list[Candidate]:
    """Grid points about that of ``candidate``, FINER times closer, where its grid is one of resonances or instants;
    else none."""
    points = around(candidate.shapes, candidate.searched, candidate.spacing)
    closer, trials = candidate.spacing / FINER, candidate.trials + len(points)
    return [replace(candidate, shapes=shapes, trials=trials, spacing=closer) for shapes in points]


def _linked(effect: Effect, partner: Effect) -> bool:
    """Whether ``effect`` reads a size of ``partner``, or changes what that one reads."""
    reads = {s.name for s in effect.symbols} - {q.name for q in effect.parameters}
    writes = {s.name for s in effect.changes} if isinstance(effect, Law) else set()
    return bool(reads & {q.name for q in partner.sizes} or writes & {s.name for s in partner.symbols})


def _touched(effect: Effect) -> set[str]:
    """Names of all that an effect reads or writes."""
    symbols = {s.name for s in effect.symbols} | {q.name for q in effect.parameters}
    if isinstance(effect, Law):
        symbols |= {s.name for s in effect.changes}
    if isinstance(effect, Follow):
        symbols |= {s.name for s in effect.follows}
    return symbols


def _steady(records: Sequence[Record]) -> bool:
    """Whether no condition of the runs changes: what changes nothing at their start then never does."""
    return all(np.ptp(c) == 0 for r in records for c in r.conditions.values())


class _Scale:
    """Finds probes that change the voltage of the runs by as much as a difference quotient should."""

    def __init__(self, fitter: Fitter, at: Fitted) -> None:
        self.fitter, self.target = fitter, fitter.target(at)
        p = at.parameters
        w, volt = float(np.sqrt(p["kxx"] / p["m"])), fitter.signal
        length = volt / abs(p["sense_gain_x"])
        # Natural units of kg, m, s, A, K, 1: a probe's first guess is 1e-4 of them. Of a mass that no spring holds they
        # are small beside what acts in the force's band, whose units are tried then.
        frequency = w / (2 * np.pi)
        driven = swing(fitter.records, frequency)
        rates = [w] if driven == frequency else [w, 2 * np.pi * driven]
        self.units = [
            np.array([p["m"], length, 1 / rate, p["m"] * length**2 * rate**3 / volt, 1.0, 1.0]) for rate in rates
        ]
        longest = max(len(r.t) for r in fitter.records)
        self.whole, self.longer = self._trials(at, longest), longest > LONGER * HEAD
        # Of a run that drifts the whole alone is what a simulation gives.
        self.head = self._trials(at, longest if any(r.drift for r in fitter.records) else HEAD)
        self.steady = _steady(fitter.records)
        self._heads: dict[tuple[bool, tuple[tuple[str, float], ...]], list[Floats]] = {}

    def _trials(self, at: Fitted, samples: int) -> list["_Trial"]:
        """The fit on the first samples of each run."""
        simulator = self.fitter.simulator
        return [
            _Trial(simulator.part(r, 0, min(samples, len(r.t))), {**at.parameters, **start}, (r.v - e)[:samples])
            for r, start, e in zip(self.fitter.records, at.starts, at.residuals, strict=True)
        ]

    def probe(self, q: Quantity, shapes: Mapping[str, float], base: Mapping[str, float]) -> Probe | None:
        """A probe of ``q``; None where nothing changes. base: changes beside which it acts."""
        found = (self._probe(q, shapes, base, _in_units(q, units)) for units in self.units)
        return next((probe for probe in found if probe), None)

    def _probe(self, q: Quantity, shapes: Mapping[str, float], base: Mapping[str, float], guess: float) -> Probe | None:
        sign = -1.0 if q.high <= q.start else 1.0
        room = abs((q.high if sign > 0 else q.low) - q.start)
        farthest = min(room, FARTHEST * guess)
        first = Probe(q, sign * min(guess, 0.5 * room), 0)
        roughly = self._searched(first, shapes, base, self.head, room, farthest)
        enough = self.steady if roughly is None else not self.longer
        if enough:
            return roughly
        return self._searched(roughly or first, shapes, base, self.whole, room, farthest)

    def _searched(self, first: Probe, shapes: Mapping[str, float], base: Mapping[str, float], trials: list["_Trial"],
                  room: float, farthest: float) -> Probe | None:  # fmt: skip
        """The probe from ``first``, whose power is 0 where it is not known."""
        q, step, power = first.quantity, abs(first.step), first.power
        sign = np.sign(first.step)
        # Of pairs few show anything: the largest step says so at once.
        if base and self._change(q, shapes, base, sign * farthest, trials) < 1e-6 * self.target:
            return None
        for _ in range(ATTEMPTS):
            change = self._change(q, shapes, base, sign * step, trials)
            if 0.3 < change / self.target < 3 and power:
                return Probe(q, sign * min(step, room), power)
            if not power and 1e-6 * self.target <= change < np.inf:
                within = 2 * step <= room
                other = self._change(q, shapes, base, sign * step * (2.0 if within else 0.5), trials)
                smaller, larger = (change, other) if within else (other, change)
                if change < self.target and larger < GROWS * smaller:
                    change = 0.0
                else:
                    finite = smaller > 0 and larger < np.inf
                    power = int(np.clip(round(np.log2(larger / smaller)), 1, 4)) if finite else 1
            if change < 1e-6 * self.target and step >= farthest:
                return None
            if change < 1e-6 * self.target or not np.isfinite(change):
                step = farthest if change < self.target else 1e-3 * step
                continue
            step *= float((self.target / change) ** (1 / power))
        change = self._change(q, shapes, base, sign * min(step, room), trials)
        return Probe(q, sign * min(step, room), power or 1) if 0 < change < np.inf else None

    def _change(self, q: Quantity, shapes: Mapping[str, float], base: Mapping[str, float], step: float,
                trials: list["_Trial"]) -> float:  # fmt: skip
        """What the step changes, rms over all runs [V]; inf where the FMU refuses it."""
        value = float(np.clip(q.start + step, q.low, q.high))
        simulator = self.fitter.simulator
        # Both runs of a difference go in the same steps.
        parts = simulator.refines({q.name, *base, *shapes})
        jobs = [(t.record, {**t.parameters, **base, **shapes, q.name: value}) for t in trials]
        runs, square, beside = simulator.try_all(jobs, parts=parts), 0.0, self._beside(base, trials, parts)
        for v, b in zip(runs, beside, strict=True):
            if v is None:
                return float("inf")
            # A device that swings ever more has no change, but infinity.
            with np.errstate(over="ignore"):
                square += float(np.sum((v - b) ** 2))
        return float(np.sqrt(square / sum(v.size for v in beside)))

    def _beside(self, base: Mapping[str, float], trials: list["_Trial"], parts: bool) -> list[Floats]:
        """The voltage with the changes ``base`` alone; that of the starts of runs is kept for the next step."""
        simulator = self.fitter.simulator
        if not (base or any(simulator.differs(t.record, t.parameters, parts) for t in trials)):
            return [t.v for t in trials]
        key = parts, tuple(base.items())
        if trials is self.head and key in self._heads:
            return self._heads[key]
        found = simulator.try_all([(t.record, {**t.parameters, **base}) for t in trials], parts=parts)
        beside = [t.v if v is None else v for t, v in zip(trials, found, strict=True)]
        if trials is self.head:
            self._heads[key] = beside
        return beside


def _in_units(q: Quantity, units: Floats) -> float:
    """The first guess of a probe of ``q``, of units of kg, m, s, A, K, 1."""
    return 1e-4 * float(np.prod(units ** [float(e) for e in dimension(q.unit).exponents]))


@dataclass(frozen=True)
class _Trial:
    """A piece of a run: its parameters and the voltage (n, axes) [V] that they give."""

    record: Record
    parameters: dict[str, float]
    v: Floats
