"""A scenario as data: what the package goes through in a run, and what it changes in the device."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from itertools import pairwise
from math import inf, isfinite
from typing import Final

import numpy as np
from numpy.typing import NDArray

from cosim.angle import UNIT_NAMES
from cosim.rate.courses import COLDEST, HOTTEST
from cosim.scenarios.courses import Constant, Course, Part
from cosim.scenarios.spans import ROUNDING, Spans
from gyro_model.errors import InputError, nearest
from gyro_model.model import load_model
from gyro_model.quantities import INPUTS

Floats = NDArray[np.float64]

INPUT_NAMES: Final = ("omega_z", "temperature", "a_x", "a_y", "v_bias")
"""The inputs of the plant that a scenario gives: all but the forces."""
QUANTITIES: Final = {q.name: q for q in INPUTS if q.name in INPUT_NAMES}
PLAUSIBLE: Final = {"temperature": (COLDEST, HOTTEST)}
"""Values beyond these are taken for a wrong unit, or for courses that leave a gap."""
JUMP: Final = 1e-9
"""A change at an instant is a jump from this share of the largest values on; less is rounding."""


@dataclass(frozen=True)
class Scenario:
    """What happens in a run.

    name: also of the folder of its results; duration [s]: the default; courses: by input, SI, their sum acts; where
    none of them does, and for inputs without any, the start value of the FMU holds; parameters: FMU parameters that the
    scenario sets, SI (whether the device has them, ``Device`` checks); angle_unit: the default, A, B or C.

    Raises InputError for an input that does not exist, with the nearest, and for values that can't be.
    """

    name: str
    description: str
    duration: float
    courses: Mapping[str, tuple[Course, ...]] = field(default_factory=dict)
    parameters: Mapping[str, float] = field(default_factory=dict)
    angle_unit: str = "C"

    def __post_init__(self) -> None:
        if not self.name or any(letter in self.name for letter in "/\\\0") or self.name.startswith("."):
            raise InputError(f"name = {self.name!r}: give one that a folder can have")
        if not (isfinite(self.duration) and self.duration > 0):
            raise InputError(f"duration = {self.duration!r}: give a positive time in s")
        if self.angle_unit not in UNIT_NAMES:
            raise InputError(f"angle_unit = {self.angle_unit!r}: give {', '.join(UNIT_NAMES)}")
        for name, value in self.parameters.items():
            if not isfinite(value):
                raise InputError(f"parameter {name} = {value!r}: give a finite number")
        for name in self.courses:
            if name not in INPUT_NAMES:
                raise InputError(f"input {name!r} is unknown{nearest(name, INPUT_NAMES)}")
        complete = {name: _without_gaps(name, courses) for name, courses in self.courses.items() if courses}
        object.__setattr__(self, "courses", complete)

    def inputs(self, first: int, count: int, period: float) -> Floats:
        """Values held over the samples first .. first + count - 1 at ``period`` [s], shape (count, len(INPUT_NAMES)),
        SI: the mean of each course over each hold.

        Raises InputError where a record ends before that, or a wave is too fast for the samples.
        """
        spans = Spans.of_samples(first, count, period)
        values = np.empty((count, len(INPUT_NAMES)))
        for column, name in enumerate(INPUT_NAMES):
            values[:, column] = self._held(name, spans)
        return values

    def omega_z(self, first: int, count: int, period: float) -> Floats:
        """The rate [rad/s] of ``inputs`` alone, shape (count,)."""
        return self.held("omega_z", first, count, period)

    def held(self, name: str, first: int, count: int, period: float) -> Floats:
        """The input ``name`` of ``inputs`` alone, SI, shape (count,)."""
        return self._held(name, Spans.of_samples(first, count, period))

    def values(self, name: str, t: Floats) -> Floats:
        """The input ``name`` just after the instants ``t`` [s], SI, shape (n,)."""
        courses = self.courses.get(name, ())
        after = [course.limits(t)[1] for course in courses]
        return np.sum(after, axis=0) if after else np.full(len(t), QUANTITIES[name].start)

    def first_inputs(self, period: float) -> dict[str, float]:
        """The values held over the first sample at ``period`` [s], by name: what the plant finds when it starts."""
        return dict(zip(INPUT_NAMES, self.inputs(0, 1, period)[0].tolist(), strict=True))

    def edges_until(self, duration: float) -> Floats:
        """Instants [s] after 0 and before ``duration`` at which an input or the device jumps, rising, shape (n,)."""
        edges = [self._jumps(courses, duration) for courses in self.courses.values()]
        edges.append(np.array(sorted(self._device_jumps())))
        return _distinct(np.concatenate(edges), duration)

    def with_angle_unit(self, unit: str) -> "Scenario":
        """The same with another default of the angle unit."""
        return replace(self, angle_unit=unit)

    def _held(self, name: str, spans: Spans) -> Floats:
        courses = self.courses.get(name)
        if courses is None:
            return np.full(len(spans.middle), QUANTITIES[name].start)
        held = courses[0].mean(spans)
        for course in courses[1:]:
            held = held + course.mean(spans)
        return held

    def _jumps(self, courses: tuple[Course, ...], duration: float) -> Floats:
        """Instants at which the sum of ``courses`` jumps: where one ends as another begins, it may go on."""
        t = _distinct(np.concatenate([course.edges(duration) for course in courses]), duration)
        before, after = np.sum([course.limits(t) for course in courses], axis=0)
        largest = sum(max(map(abs, course.extent())) for course in courses)
        return t[np.abs(after - before) > JUMP * largest]

    def _device_jumps(self) -> set[float]:
        """Instants of the parameter laws that the scenario switches on [s]."""
        given = self.parameters
        if not given:
            return set()
        laws = [law for law in load_model().laws if law.event is not None and law.event.name in given]
        return {given[str(law.event)] for law in laws if any(given.get(q.name, q.start) != q.start for q in law.sizes)}


def _without_gaps(name: str, courses: tuple[Course, ...]) -> tuple[Course, ...]:
    """``courses``, and the input's start value where none of them acts. Raises InputError where a value is not
    plausible."""
    windows = [(part.begin, part.until) if isinstance(part, Part) else (0.0, inf) for part in courses]
    borders = sorted({0.0, inf, *(border for window in windows for border in window)})
    start = QUANTITIES[name].start
    filled = list(courses)
    for begin, until in pairwise(borders):
        acting = [
            course for course, window in zip(courses, windows, strict=True) if window[0] <= begin and until <= window[1]
        ]
        if acting:
            _check_extent(name, acting, begin)
        elif start:
            filled.append(Part(Constant(start), begin, until))
    return tuple(filled)


def _check_extent(name: str, courses: list[Course], begin: float) -> None:
    low, high = (float(sum(values)) for values in zip(*(course.extent() for course in courses), strict=True))
    least, most = PLAUSIBLE.get(name, (-inf, inf))
    if low <= least or high >= most:
        unit = QUANTITIES[name].unit
        worst = low if low <= least else high
        raise InputError(
            f"{name} reaches {worst:.6g} {unit} from {begin:g} s on: give {least:g} to {most:g} {unit}; is its unit "
            "right, and do its courses add up to it?"
        )


def _distinct(t: Floats, duration: float) -> Floats:
    """``t`` sorted, within (0, duration), of those that differ by rounding the first."""
    t = np.sort(t)
    t = t[(t > 0) & (t < duration * (1 - ROUNDING))]
    return t[np.diff(t, prepend=-np.inf) > ROUNDING * t]
