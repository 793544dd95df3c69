"""What data can show: changes of the voltages over the noise, after all that nominal parameters and starts can imitate.

The detectable size is the one whose change, so projected, is five noise deviations long: where the change is linear in
the size, five deviations of the Cramér–Rao bound; where it is quadratic (1/g, κ), the same test without a slope.
"""

import math
from collections.abc import Callable, Sequence
from typing import Final

import numpy as np

from benchmarks.blind.experiment import TOLERANCE
from benchmarks.blind.physics import Floats, Plant, Run, clipped, simulate

DEVIATIONS: Final = 5.0
PROBE: Final = 1e-6
"""Relative step of the nominal parameters: with some 1e3 rad in a run it turns the phase by 1e-3, and of the 1e-13 of
rounding 1e-7 remains."""
SPAN: Final = 1e-9
"""Columns whose part outside of the others is below this share of their length count as imitated."""


class Projector:
    """Fitted runs of a device and the changes of their voltages in units of the noise, stacked to (N,)."""

    def __init__(self, plant: Plant, runs: Sequence[Run], sigma: float, *, held: Sequence[str] = ()) -> None:
        self.plant, self.runs, self.sigma = plant, runs, sigma
        self.base = self._voltages(plant)
        names = [name for name in TOLERANCE if name not in held]
        sizes = [self._probe(name) for name in names]
        changes = [self.raw(plant._replace(**{n: getattr(plant, n) + h}), plant._replace(**{n: getattr(plant, n) - h}))
                   for n, h in zip(names, sizes, strict=True)]  # fmt: skip
        self.q = _orthonormal(np.stack([*changes, *self._starts()], axis=1))

    def _probe(self, name: str) -> float:
        like = {"kxy": "kxx", "dxy": "dxx"}.get(name, name)
        return PROBE * float(getattr(self.plant, like))

    def _voltages(self, plant: Plant) -> Floats:
        return np.concatenate([clipped(simulate(plant, run).v, plant).ravel() for run in self.runs]) / self.sigma

    def _starts(self) -> list[Floats]:
        """Columns of the initial states, each zero outside of its run."""
        columns, begin = [], 0
        for run in self.runs:
            plain = simulate(self.plant, run).v.ravel() / self.sigma
            for place in range(4):
                moved = np.array(run.start)
                moved[place] += 1e-12 if place < 2 else 1e-8
                column = np.zeros(len(self.base))
                column[begin : begin + len(plain)] = (
                    simulate(self.plant, run._replace(start=moved)).v.ravel() / self.sigma - plain
                )
                columns.append(column)
            begin += len(plain)
        return columns

    def raw(self, plant: Plant, other: Plant | None = None) -> Floats:
        """Change of the voltages from ``other`` (the device without effects) to ``plant``, (N,)."""
        return self._voltages(plant) - (self.base if other is None else self._voltages(other))

    def visible(self, change: Floats, others: Sequence[Floats] = ()) -> Floats:
        """The part of a change that nothing nominal, and none of the other changes, imitates."""
        rest: Floats = change - self.q @ (self.q.T @ change)
        # Twice is enough (Kahan): one pass leaves rounding of the whole change.
        rest -= self.q @ (self.q.T @ rest)
        if others:
            q = _orthonormal(np.stack([self.visible(o) for o in others], axis=1))
            rest -= q @ (q.T @ rest)
        return rest

    def length(self, plant: Plant, others: Sequence[Floats] = ()) -> float:
        """Of the visible change, in noise deviations; infinite where the device is unstable."""
        change = self.raw(plant)
        return float(np.linalg.norm(self.visible(change, others))) if np.isfinite(change).all() else math.inf

    def detectable(self, placed: Callable[[float], Plant], cap: float, others: Sequence[Floats] = ()) -> float:
        """Size at which ``placed(size)`` is DEVIATIONS long: a search on logarithms from a small part of the cap."""
        size = 1e-3 * cap
        for _ in range(40):
            found = self.length(placed(size), others)
            if abs(found / DEVIATIONS - 1) < 0.01:
                break
            if not 0 < found < 1e6:
                size *= 0.01 if found else 10
                continue
            half = self.length(placed(0.7 * size), others)
            power = math.log(max(found / half, 1.01)) / math.log(1 / 0.7) if half > 0 else 1.0
            size *= min(max((DEVIATIONS / found) ** (1 / min(max(power, 0.5), 4.0)), 1e-3), 1e3)
            if size > 1e3 * cap:
                return math.inf
        return size


def cosine(first: Floats, second: Floats) -> float:
    """Of the angle between two visible changes, 0 to 1; 1 means that this data can't tell them apart."""
    return float(abs(first @ second) / (np.linalg.norm(first) * np.linalg.norm(second)))


def _orthonormal(columns: Floats) -> Floats:
    """An orthonormal basis (N, r) of the columns; what others imitate within SPAN drops out."""
    scaled = columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
    u, s, _ = np.linalg.svd(scaled, full_matrices=False)
    basis: Floats = u[:, s > SPAN * s[0]]
    return basis
