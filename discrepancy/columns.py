"""What each effect would add to the simulated voltage, found from the effect files alone: columns of the test.

A column is the change that the FMU shows when a size parameter leaves neutral by a probe, chosen so that the change is
about as large as the residual's noise. So every stage (law, force with states, map, delay, lag) has its column
without a rule of its own, and an effect file that a user adds is scored as it stands. Sizes that act by a power (1/g
by its square) show it in how the change grows. Shape parameters that decide where an effect shows (an instant, a
frequency, a time constant) are searched on a grid: each grid point is a column.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import isfinite
from typing import Final

import numpy as np

from discrepancy.record import Record
from discrepancy.refit import Fitted, Fitter, Free
from gyro_model.anatomy import Effect, Law
from gyro_model.errors import InputError
from gyro_model.model import Model
from gyro_model.quantities import Quantity
from gyro_model.units import dimension

SCALING: Final = 2000
"""Samples of the run with the largest motion on which a probe is scaled."""
FREQUENCIES, INSTANTS, TIMES = 24, 16, 6
"""Grid points: over 0.2 to 3 times the highest mode, over a run, and over 0.01 to 10 runs by decades and halves."""
SEARCH_QUALITY: Final = 30.0
"""Quality factor of a searched resonance: as broad as its grid is coarse; the refit sharpens it."""


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


@dataclass(frozen=True)
class Candidate:
    """An effect with its probes at one choice of shape parameters; ``searched`` are those that the refit may move."""

    effect: Effect
    probes: tuple[Probe, ...]
    shapes: Mapping[str, float]
    searched: tuple[Quantity, ...] = ()

    def changes(self) -> list[dict[str, float]]:
        """The changed parameters of each column."""
        return [{**self.shapes, p.quantity.name: p.quantity.start + p.step} for p in self.probes]

    def free(self, period: float) -> tuple[Free, ...]:
        """The parameters for a refit."""
        sizes = [Free(p.quantity.name, abs(p.step), p.quantity.low, p.quantity.high) for p in self.probes]
        shapes = []
        for q in self.searched:
            event = isinstance(self.effect, Law) and self.effect.event is not None
            step = period if event else 1e-3 * abs(self.shapes[q.name])
            shapes.append(Free(q.name, step, max(q.low, 0.0), q.high))
        return (*sizes, *shapes)


def nameable(model: Model) -> tuple[Effect, ...]:
    """The effects that a diagnosis may name: neither the device itself nor noise."""
    return tuple(e for e in model.effects if not (e.nominal or e.noise) and all(isfinite(q.start) for q in e.sizes)
                 and all(abs(q.start) < 1e100 for q in e.sizes))  # fmt: skip


def candidates(fitter: Fitter, at: Fitted, accepted: Sequence[str]) -> list[Candidate]:
    """Every effect not yet accepted that changes the voltage of these runs, at each point of its grid."""
    scale = _Scale(fitter, at)
    found = []
    for effect in nameable(fitter.simulator.model):
        if effect.id in accepted:
            continue
        grid, searched = _grid(effect, fitter, at)
        # An event at the start changes the samples on which a probe is scaled; a later one may not.
        event = isinstance(effect, Law) and effect.event is not None
        middle = grid[0 if event else len(grid) // 4]
        sized = [scale.probe(q, middle) for q in effect.sizes]
        probes = tuple(p for p in sized if p is not None)
        if probes:
            found += [Candidate(effect, probes, shapes, searched) for shapes in grid]
    return found


def _grid(effect: Effect, fitter: Fitter, at: Fitted) -> tuple[list[dict[str, float]], tuple[Quantity, ...]]:
    """Values of the shape parameters to try and which of them a refit may move."""
    shapes = [q for q in effect.parameters if q.role == "shape"]
    duration = max(len(r.t) for r in fitter.records) * fitter.period
    begin = min(float(r.t[0]) for r in fitter.records)
    if isinstance(effect, Law) and effect.event is not None:
        moved = tuple(q for q in shapes if q.name == effect.event.name)
        instants = begin + duration * np.arange(INSTANTS) / INSTANTS
        return [{effect.event.name: float(time)} for time in instants], moved
    rates = [q for q in shapes if q.unit == "Hz"]
    if rates:
        top = np.sqrt(max(at.parameters["kxx"], at.parameters.get("kyy", 0.0)) / at.parameters["m"]) / (2 * np.pi)
        widths = {q.name: SEARCH_QUALITY for q in shapes if q.unit == "1"}
        grid = np.geomspace(0.2 * top, min(3 * top, 0.4 / fitter.period), FREQUENCIES)
        return [{rates[0].name: float(f), **widths} for f in grid], tuple(shapes)
    times = [q for q in shapes if q.unit == "s"]
    if times:
        return [{times[0].name: float(tau)} for tau in duration * np.geomspace(0.01, 10, TIMES)], (times[0],)
    return [{}], ()


class _Scale:
    """Finds probes on the first samples of the run that moves most."""

    def __init__(self, fitter: Fitter, at: Fitted) -> None:
        index = int(np.argmax([np.mean(r.v**2) for r in fitter.records]))
        run = fitter.records[index]
        n = min(len(run.t), SCALING)
        held = {name: values[:n] for name, values in run.conditions.items()}
        self.record = Record(
            run.name, run.role, run.hold, run.sample_rate, run.t[:n], run.u[:n], run.v[:n], held, run.valid[:n]
        )
        self.simulator = fitter.simulator
        self.parameters = {**at.parameters, **at.starts[index]}
        self.base = self.simulator.run(self.record, self.parameters)
        self.target = float(np.sqrt(at.variance))
        self._find_natural()

    def _find_natural(self) -> None:
        p = self.parameters
        w = float(np.sqrt(p["kxx"] / p["m"]))
        volt = float(np.sqrt(np.mean(self.record.v**2)))
        length = volt / p["sense_gain_x"]
        ampere = p["m"] * length**2 * w**3 / volt
        self.natural = np.array([p["m"], length, 1 / w, ampere, 1.0, 1.0])

    def probe(self, quantity: Quantity, shapes: Mapping[str, float]) -> Probe | None:
        """A probe of ``quantity`` that changes the voltage by about the noise; None where nothing changes."""
        exponents = [float(e) for e in dimension(quantity.unit).exponents]
        step = 1e-4 * float(np.prod(self.natural**exponents))
        sign = -1.0 if quantity.high <= quantity.start else 1.0
        step = sign * min(step, 0.5 * abs((quantity.high if sign > 0 else quantity.low) - quantity.start))
        change = 0.0
        for _ in range(4):
            change = self._change(quantity, shapes, step)
            if change > 1e-6 * self.target:
                break
            step *= 30.0
        else:
            return None
        power = 1
        for _ in range(3):
            larger = self._change(quantity, shapes, 2 * step)
            power = int(np.clip(round(np.log2(larger / change)), 1, 4)) if 0 < larger < np.inf else power
            step *= float(np.clip((self.target / change) ** (1 / power), 1e-9, 1e9))
            change = self._change(quantity, shapes, step)
            if not (0 < change < np.inf) or 0.3 < change / self.target < 3:
                break
        room = abs((quantity.high if step > 0 else quantity.low) - quantity.start)
        return Probe(quantity, float(np.clip(step, -room, room)), power) if 0 < change < np.inf else None

    def _change(self, quantity: Quantity, shapes: Mapping[str, float], step: float) -> float:
        value = float(np.clip(quantity.start + step, quantity.low, quantity.high))
        try:
            v = self.simulator.run(self.record, {**self.parameters, **shapes, quantity.name: value})
        except InputError:
            return float("inf")
        return float(np.sqrt(np.mean((v - self.base) ** 2)))
