"""Fits parameters and initial states by full simulation: output error with innovations, Gauss-Newton."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np

from discrepancy.linear_fit import WeakForm, weak_form
from discrepancy.linear_fit import fit as fit_weak_form
from discrepancy.record import Floats, Record
from discrepancy.simulate import Job, Simulator
from discrepancy.whitening import Whitener, likeliest, whitener
from gyro_model.errors import InputError

BLOCKS: Final = 24
"""Blocks of a run for block statistics: enough for a variance from few runs, each many periods long."""
STATES: Final = ("x_start", "x_dot_start", "y_start", "y_dot_start")


@dataclass(frozen=True)
class Free:
    """A parameter to fit: ``step`` of its difference quotient, bounds; SI."""

    name: str
    step: float
    low: float = -np.inf
    high: float = np.inf


@dataclass(frozen=True)
class Fitted:
    """A model fitted to runs. parameters: shared ones by name; starts: initial states of each run; covariance of
    ``free`` in their order (block statistics); grams (blocks, p, p) of [free, starts, residual] as innovations; cost:
    sum of squared innovations [V²], count of them."""

    parameters: Mapping[str, float]
    starts: tuple[Mapping[str, float], ...]
    free: tuple[Free, ...]
    whiten: Whitener
    residuals: tuple[Floats, ...] = field(repr=False)
    cost: float = np.inf
    count: int = 1
    grams: Floats | None = field(default=None, repr=False)

    @property
    def variance(self) -> float:
        """Mean square of an innovation [V²]."""
        return self.cost / self.count


class Fitter:
    """Fits the runs ``records`` with one simulator."""

    def __init__(self, simulator: Simulator, records: Sequence[Record], blocks: int = BLOCKS) -> None:
        self.simulator, self.records, self.blocks = simulator, tuple(records), blocks
        self.axes = self.records[0].axes
        self.period = 1 / self.records[0].sample_rate
        self.state_names = STATES[: 2 * self.axes]

    def begin(self, nominal: Mapping[str, float]) -> Fitted:
        """The start of a fit: m, k, d by the weak form, which has no other minimum, at rest."""
        forms = [form for form in (weak_form(record, nominal) for record in self.records) if form is not None]
        parameters = dict(nominal)
        if forms:
            joined = WeakForm(*(np.concatenate(arrays, axis=1) for arrays in zip(*map(_arrays, forms), strict=True)))
            parameters |= _passive(fit_weak_form(joined, nominal).values, nominal)
        names = ("m", "kxx", "dxx") if self.axes == 1 else ("m", "kxx", "kyy", "kxy", "dxx", "dyy", "dxy")
        free = tuple(_nominal(name, parameters) for name in names)
        starts = tuple(dict.fromkeys(self.state_names, 0.0) for _ in self.records)
        plain = whitener(parameters, self.axes, self.period, 0.0)
        return self.whitened(self.evaluated(Fitted(parameters, starts, free, plain, ())))

    def evaluated(self, at: Fitted) -> Fitted:
        """``at`` with residuals and cost of its parameters."""
        try:
            simulated = self.simulator.run_all(self._jobs(at, {}))
        except InputError:
            # Parameters that no passive device has: no better than a motion out of bounds.
            return replace(at, residuals=tuple(np.full_like(r.v, np.nan) for r in self.records), cost=np.inf, count=1)
        residuals = tuple(r.v - v for r, v in zip(self.records, simulated, strict=True))
        return self._costed(replace(at, residuals=residuals))

    def _costed(self, at: Fitted) -> Fitted:
        cost, count = 0.0, 0
        for record, residual in zip(self.records, at.residuals, strict=True):
            if not np.isfinite(residual).all():
                return replace(at, cost=np.inf, count=1, grams=None)
            cost += float(np.sum(at.whiten(residual[None], record.valid) ** 2))
            count += int(record.valid.sum()) * self.axes
        return replace(at, cost=cost, count=count, grams=None)

    def whitened(self, at: Fitted) -> Fitted:
        """``at`` with the whitening that its residuals ask for."""
        found = likeliest(at.parameters, self.period, at.residuals, [r.valid for r in self.records])
        return self._costed(replace(at, whiten=found))

    def _jobs(self, at: Fitted, changes: Mapping[str, float], only: int | None = None) -> list[Job]:
        chosen = range(len(self.records)) if only is None else (only,)
        return [(self.records[i], {**at.parameters, **at.starts[i], **changes}) for i in chosen]

    def columns(self, at: Fitted, run: int, probes: Sequence[Mapping[str, float]]) -> Floats:
        """What each set of changed parameters adds to the simulated voltage of a run: (probes, n, axes) [V]."""
        jobs = [job for changes in probes for job in self._jobs(at, changes, run)]
        base = self.records[run].v - at.residuals[run]
        found = self.simulator.try_all(jobs)
        # A probe beyond what a passive device has gives no column.
        return (
            np.stack([v - base if v is not None else 0 * base for v in found]) if jobs else np.empty((0, *base.shape))
        )

    def _derivatives(self, at: Fitted, run: int) -> Floats:
        """By each free parameter, a full ``step`` of it, and each state of this run: (p, n, axes) [V]."""
        probes: list[dict[str, float]] = []
        for free in at.free:
            value = at.parameters[free.name]
            probes += [{free.name: min(value + free.step, free.high)}, {free.name: max(value - free.step, free.low)}]
        probes += [{name: at.starts[run][name] + step} for name, step in self._state_steps(at, run).items()]
        found = self.columns(at, run, probes)
        n = len(at.free)
        for i, free in enumerate(at.free):
            width = probes[2 * i][free.name] - probes[2 * i + 1][free.name]
            found[i] = (found[2 * i] - found[2 * i + 1]) * (free.step / width)
        return np.concatenate((found[:n], found[2 * n :]))

    def _state_steps(self, at: Fitted, run: int) -> dict[str, float]:
        size = 1e-3 * float(np.sqrt(np.mean(self.records[run].v ** 2))) / at.parameters["sense_gain_x"]
        speed = size * float(np.sqrt(at.parameters["kxx"] / at.parameters["m"]))
        return {name: speed if "dot" in name else size for name in self.state_names}

    def with_grams(self, at: Fitted, extra: Sequence[Mapping[str, float]] = ()) -> Fitted:
        """``at`` with its grams, columns in the order: free, states of all runs, ``extra`` probes, residual."""
        n, states, runs = len(at.free), len(self.state_names), len(self.records)
        size = n + states * runs + len(extra) + 1
        grams = np.zeros((self.blocks * runs, size, size))
        for run, record in enumerate(self.records):
            own = np.concatenate((self._derivatives(at, run), self.columns(at, run, extra), at.residuals[run][None]))
            place = [*range(n), *range(n + states * run, n + states * (run + 1)), *range(size - len(extra) - 1, size)]
            innovations = at.whiten(own, record.valid)
            for block, part in enumerate(np.array_split(innovations, self.blocks, axis=1)):
                flat = part.reshape(len(part), -1)
                grams[np.ix_([self.blocks * run + block], place, place)] = flat @ flat.T
        return replace(at, grams=grams)

    def fit(self, at: Fitted, rounds: int = 10, tolerance: float = 0.05) -> Fitted:
        """Gauss-Newton from ``at``, damped where a step does not help; ends where a round gains less than
        ``tolerance`` of an innovation's variance. Grams are those of the last linearisation."""
        damping = 0.0
        for _ in range(rounds):
            linear = self.with_grams(at)
            before = at.cost
            for _ in range(8):
                moved = self.evaluated(self._moved(linear, damping))
                if moved.cost < at.cost:
                    at, damping = moved, damping / 10 if damping > 1e-4 else 0.0
                    break
                damping = max(1e-3, 10 * damping)
            if before - at.cost < tolerance * at.variance or at.cost == before:
                break
        return at

    def _moved(self, at: Fitted, damping: float) -> Fitted:
        assert at.grams is not None
        total = at.grams.sum(axis=0)
        step = solve_scaled(total[:-1, :-1], total[:-1, -1], damping)
        parameters = dict(at.parameters)
        for free, change in zip(at.free, step, strict=False):
            parameters[free.name] = float(np.clip(parameters[free.name] + free.step * change, free.low, free.high))
        n, count = len(at.free), len(self.state_names)
        starts = []
        for run, start in enumerate(at.starts):
            sizes = self._state_steps(at, run)
            own = step[n + count * run : n + count * (run + 1)]
            starts.append({name: start[name] + sizes[name] * float(c) for name, c in zip(start, own, strict=True)})
        return replace(at, parameters=parameters, starts=tuple(starts), grams=None)

    def deviations(self, at: Fitted) -> dict[str, float]:
        """Standard deviation of each free parameter: the larger of that by white innovations and by blocks."""
        linear = at if at.grams is not None else self.with_grams(at)
        assert linear.grams is not None
        grams = linear.grams[:, :-1, :-1]
        inverse = inverse_scaled(grams.sum(axis=0))
        scores = linear.grams[:, :-1, -1]
        blocks = inverse @ (scores.T @ scores) @ inverse
        white = inverse * linear.variance
        size = np.sqrt(np.maximum(np.diag(white), np.diag(blocks)))
        return {free.name: float(free.step * size[i]) for i, free in enumerate(linear.free)}


def pieces(records: Sequence[Record], number: int) -> tuple[Record, ...]:
    """Each run cut into ``number`` runs with initial states of their own, over which a wrong model strays less."""
    cut = []
    for r in records:
        for part in np.array_split(np.arange(len(r.t)), max(1, min(number, len(r.t) // 200))):
            own = slice(part[0], part[-1] + 1)
            held = {name: values[own] for name, values in r.conditions.items()}
            cut.append(replace(r, t=r.t[own], u=r.u[own], v=r.v[own], conditions=held, valid=r.valid[own]))
    return tuple(cut)


def _arrays(form: WeakForm) -> tuple[Floats, ...]:
    return form.force, form.q, form.velocity, form.acceleration, form.turning  # type: ignore[return-value]


def _passive(values: Mapping[str, float], nominal: Mapping[str, float]) -> dict[str, float]:
    """Damping well inside what a passive device has, so that a search can leave from there in every direction."""
    d = {name: max(values[name], 0.2 * nominal[name]) for name in values if name in ("dxx", "dyy")}
    if "dxy" in values:
        room = 0.5 * float(np.sqrt(d["dxx"] * d["dyy"]))
        d["dxy"] = float(np.clip(values["dxy"], -room, room))
    return {**values, **d}


def _nominal(name: str, parameters: Mapping[str, float]) -> Free:
    """A step of 1e-6 of m or k moves the phase of a mode of Q = 2000 by 1e-3: linear, and far above rounding."""
    if name == "m":
        return Free(name, 1e-6 * parameters["m"], low=1e-3 * parameters["m"])
    kind, low = name[0], 0.0 if name[1:] in ("xx", "yy") else -np.inf
    return Free(name, (1e-6 if kind == "k" else 1e-3) * parameters[kind + "xx"], low)


def solve_scaled(matrix: Floats, right: Floats, damping: float = 0.0) -> Floats:
    """Least squares from its gram matrix, columns of any size; dead columns and directions get zero."""
    return inverse_scaled(matrix, damping) @ right


def inverse_scaled(matrix: Floats, damping: float = 0.0) -> Floats:
    """The inverse of a gram matrix; directions below 1e-13 of the largest are left out."""
    size = np.sqrt(np.diag(matrix))
    size = np.where(size > 0, size, 1.0)
    values, vectors = np.linalg.eigh(matrix / np.outer(size, size))
    kept = values > 1e-13 * values[-1]
    inverse = (vectors[:, kept] / (values[kept] + damping)) @ vectors[:, kept].T
    return np.asarray(inverse / np.outer(size, size))
