"""What a generator may play: forces made of few tones and courses of the conditions, within the limits of a laboratory.

A force is governed: as the amplitude of the motion nears the limit of the voltage, by the linear model of the device,
it fades, so that a tone on a mode rings up at full force and then holds what the device bears.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import product
from typing import Final

import numpy as np
from numba import njit
from scipy.linalg import expm

from discrepancy.data.record import Floats, Record
from discrepancy.tell.limits import REST, Range, Room

HIGHEST: Final = 0.4
"""Of the sample rate: a held force has no tones above."""
FADING: Final = (0.8, 0.97)
"""Share of the largest amplitude from which a force fades, and at which it is gone."""
BESIDE: Final = (0.0, 0.1, 0.3, 0.6, 1.5, 2.0, 3.0)
"""Tones off the modes: over the lowest below 1, over the highest above."""
WITHIN: Final = (1 / 3, 1 / 2)
"""Tones whose third or second harmonic meets a mode."""
STEPPED: Final = 0.1
"""Share of a run after which a condition steps."""


Steps = tuple[tuple[str, tuple[float, ...]], ...]
"""By condition the values [SI] that it takes one after the other."""


@dataclass(frozen=True)
class Drive:
    """A force and the conditions it acts under. frequency (tones,) [Hz]; weight, phase [rad] (tones, axes): the force
    of an axis is the sum of its sines over its peak; hard: the sign of that sum; share (axes,): of the largest force;
    rise: level at the start over that at the end; off: share of the run after which the force rests; steps: by
    condition the values [SI] that it takes one after the other at equal times, the first after STEPPED."""

    frequency: Floats
    weight: Floats
    phase: Floats
    share: Floats
    hard: bool = False
    rise: float = 1.0
    off: float = 1.0
    steps: Steps = ()

    def shape(self, t: Floats, length: float) -> Floats:
        """The force over its limit at times ``t`` [s] of a run laid out for ``length`` [s], (n, axes), within ±1."""
        shape = self._sines(t)
        if self.hard:
            shape = np.sign(shape)
        elif len(self.frequency) > 1:
            # What is played longer than it is laid out for keeps its size.
            grid = np.linspace(0, length, len(t), endpoint=False)
            shape = np.clip(shape / np.maximum(np.abs(self._sines(grid)).max(axis=0), 1e-9), -1, 1)
        level = np.minimum(self.rise + (1 - self.rise) * t / length, 1.0)
        return np.asarray(self.share * shape * (level * (t < self.off * length))[:, None])

    def _sines(self, t: Floats) -> Floats:
        angle = 2 * np.pi * np.multiply.outer(t, self.frequency)
        weight = self.weight / np.maximum(np.abs(self.weight).max(axis=0), 1e-9)
        return np.asarray(np.sum(weight * np.sin(angle[:, :, None] + self.phase), axis=1))

    def conditions(self, t: Floats, length: float, base: Mapping[str, float]) -> dict[str, Floats]:
        """Courses of the conditions at times ``t``, those that keep their ``base`` included."""
        courses = {name: np.full(len(t), value) for name, value in base.items()}
        for name, values in self.steps:
            first = base.get(name, REST[name])
            part = np.clip((t / length - STEPPED) / (1 - STEPPED), -1, 1 - 1e-12)
            number = np.where(part < 0, 0, 1 + np.floor(np.maximum(part, 0) * len(values)).astype(int))
            courses[name] = np.array([first, *values])[number]
        return courses


class Player:
    """Makes records of drives for a device: parameters by FMU name [SI], of which the linear ones govern the force."""

    def __init__(self, room: Room, parameters: Mapping[str, float], like: Record) -> None:
        self.room, self.like, axes = room, like, like.axes
        m, self.period = parameters["m"], 1 / room.rate
        k, d = (_matrix(kind, parameters, axes) for kind in "kd")
        zero, one = np.zeros((axes, axes)), np.eye(axes)
        system = np.block([[zero, one, zero], [-k / m, -d / m, one / m], [np.zeros((axes, 3 * axes))]])
        step = expm(system * self.period)
        self._a, self._b = step[: 2 * axes, : 2 * axes].copy(), step[: 2 * axes, 2 * axes :].copy()
        values, vectors = np.linalg.eigh(k / m)
        self.modes, self.vectors = np.sqrt(np.maximum(values, 0)) / (2 * np.pi), vectors
        self.lowest = max(float(self.modes[0]), 1 / (room.samples * self.period))
        gain = np.array([parameters[f"sense_gain_{axis}"] for axis in "xy"[:axes]])
        self._largest = np.array(room.voltage) / np.abs(gain)
        self._speed = 2 * np.pi * max(float(self.modes[-1]), self.lowest) * self._largest

    def record(self, drive: Drive, samples: int, horizon: int = 0, scale: float = 1.0) -> Record:
        """The run to be measured, its v empty, that plays ``samples`` of a drive laid out for a ``horizon``; scale: of
        the voltage's limit by which it is governed."""
        t = np.arange(samples, dtype=np.float64) * self.period
        length = (horizon or samples) * self.period
        u = _governed(self._a, self._b, drive.shape(t, length) * self.room.force, self._largest * scale,
                      self._speed * scale, np.array(FADING))  # fmt: skip
        courses = drive.conditions(t, length, self.room.base)
        return replace(self.like, name="proposed", role="fit", sample_rate=self.room.rate, t=t, u=u,
                       v=np.ones_like(u), conditions=courses, valid=np.ones(samples, dtype=bool))  # fmt: skip

    def library(self, *, whole: bool = True) -> Iterator[Drive]:
        """Drives to begin with: on each mode, beside and between them, at fractions of them, and pairs of such tones;
        on each axis and on both; held, off after a part of the run, or growing. Without ``whole`` those held on modes
        and off them alone, and no force."""
        axes, top = self.like.axes, HIGHEST * self.room.rate
        on = [float(f) for f in self.modes if f > 0] or [self.lowest]
        near = [f * (1 + side / 100) for f in on for side in (-2, 2)]
        beside = [(b if b < 1 else 1) * on[0] if b < 1 else b * on[-1] for b in BESIDE]
        within = [f * part for f in on for part in WITHIN]
        tones = [(f,) for f in (*on, *near, *beside, float(np.mean(on)), *within, top) if f <= top]
        pairs: list[tuple[float, ...]] = [(f, g) for f in on for g in (*on, *beside, top) if f < g <= top or g < f]
        # Two below the modes and two above, and a band over all of them.
        pairs += [tuple(f for f in beside[2:6] if f < top), tuple(np.linspace(0.3 * on[0], min(1.6 * on[-1], top), 12))]
        ways = (
            [np.ones(axes)] if axes == 1 else [np.array(w) for w in ((1.0, 0.0), (0.0, 1.0), (1.0, 1.0), (1.0, -1.0))]
        )
        simple = [tone for tone in tones if tone[0] in (*on, *beside[::3])] + [(on[0], on[-1])]
        if not whole:
            yield Drive(np.zeros(1), np.ones((1, axes)), np.zeros((1, axes)), np.zeros(axes))
        for frequency, way in product((*tones, *pairs) if whole else simple, ways):
            f = np.array(frequency)
            weight = np.ones((len(f), axes))
            # A constant force is the sine at its crest.
            phase = np.where(f[:, None] == 0, np.pi / 2, 0.0) * np.ones((len(f), axes))
            yield Drive(f, weight, phase, way, True)
            if not whole:
                continue
            yield Drive(f, weight, phase, way, False)
            if frequency[0] in on:
                yield Drive(f, weight, phase, way, True, off=0.3)
                yield Drive(f, weight, phase, way, False, rise=0.1)

    def courses(self) -> list[Steps]:
        """Courses of conditions beside none: each alone, to its end farther from where it is, to the other end, half
        as far, and to one end and the other in turn; tilts on both axes at once."""
        tilts = [name for name in ("a_x", "a_y") if name in self.room.ranges]
        groups = [[name] for name in self.room.ranges if name not in tilts] + ([tilts] if tilts else [])
        return [(), *(course for group in groups for course in self._group(group))]

    def _group(self, names: list[str]) -> list[Steps]:
        far = {name: self._far(name, self.room.ranges[name]) for name in names}
        back = {name: _other(self.room.ranges[name], far[name]) for name in names}
        half = {name: (far[name] + self.room.base.get(name, REST[name])) / 2 for name in names}
        single = [tuple((name, (end[name],)) for name in names) for end in (far, back, half)]
        return [*single, tuple((name, (far[name], back[name], far[name])) for name in names)]

    def _far(self, name: str, between: Range) -> float:
        base = self.room.base.get(name, REST[name])
        return max(between, key=lambda end: (abs(abs(end) - abs(base)), abs(end - base), end))


def _other(between: Range, end: float) -> float:
    return between[0] if end == between[1] else between[1]


def _matrix(kind: str, p: Mapping[str, float], axes: int) -> Floats:
    own = [[p[kind + "xx"], p.get(kind + "xy", 0.0)], [p.get(kind + "xy", 0.0), p.get(kind + "yy", 0.0)]]
    return np.array(own)[:axes, :axes]


@njit(cache=True, nogil=True)
def _governed(a, b, force, largest, speed, fading):  # type: ignore[no-untyped-def]
    """The force (n, axes) [N] faded where the motion of the linear model nears ``largest`` [m] on an axis, by its
    place and by its speed over ``speed`` [m/s]."""
    n, axes = force.shape
    state = np.zeros(2 * axes)
    u = np.zeros((n, axes))
    for k in range(n):
        level = 0.0
        for i in range(axes):
            level = max(level, (state[i] / largest[i]) ** 2 + (state[axes + i] / speed[i]) ** 2)
        level = np.sqrt(level)
        fade = min(max((fading[1] - level) / (fading[1] - fading[0]), 0.0), 1.0)
        for i in range(axes):
            u[k, i] = force[k, i] * fade
        state = a @ state + b @ u[k]
    return u
