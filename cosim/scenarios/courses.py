"""Courses: one input against time, each as its exact mean over the holds of the samples.

All times are those of the run. A course is data; it checks itself where it is built. Values are SI, of the input that
the course acts on.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from math import inf, isfinite, radians
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from cosim.rate_profile import MINIMUM_ROWS, RateProfile
from cosim.scenarios.spans import ROUNDING, Spans, snapped
from gyro_model.errors import InputError

Floats = NDArray[np.float64]

ON_EDGE: Final = 1e-9
"""A border of a hold within this of an edge of a square wave, relative or in half periods, is the edge: the rest is
the rounding of k * period."""


class Course(ABC):
    """A value against time."""

    @abstractmethod
    def mean(self, spans: Spans) -> Floats:
        """Mean over each of the spans, shape (n,)."""

    @abstractmethod
    def limits(self, t: Floats) -> tuple[Floats, Floats]:
        """Value just before and just after the instants ``t`` [s], shape (n,) each."""

    @abstractmethod
    def extent(self) -> tuple[float, float]:
        """The least and the largest value."""

    def edges(self, until: float) -> Floats:
        """Instants [s] at which the value may jump, rising, at most ``until`` [s]."""
        return np.empty(0)


@dataclass(frozen=True)
class Constant(Course):
    """One value."""

    value: float

    def __post_init__(self) -> None:
        _finite("value", self.value)

    def mean(self, spans: Spans) -> Floats:
        return np.full(len(spans.middle), self.value)

    def limits(self, t: Floats) -> tuple[Floats, Floats]:
        return np.full(len(t), self.value), np.full(len(t), self.value)

    def extent(self) -> tuple[float, float]:
        return self.value, self.value


@dataclass(frozen=True)
class _Wave(Course):
    """amplitude; frequency [Hz]; phase at t = 0 [deg]."""

    amplitude: float
    frequency: float
    phase: float = 0.0

    def __post_init__(self) -> None:
        _finite("amplitude", self.amplitude)
        _finite("phase", self.phase)
        if not (isfinite(self.frequency) and self.frequency > 0):
            raise InputError(f"frequency = {self.frequency!r}: give a positive number in Hz")

    def extent(self) -> tuple[float, float]:
        return -abs(self.amplitude), abs(self.amplitude)

    def _check_rate(self, spans: Spans) -> None:
        if 2 * self.frequency * spans.length > 1:
            raise InputError(
                f"frequency = {self.frequency:g} Hz: samples each {spans.length:g} s can't follow; "
                f"give at most {0.5 / spans.length:g} Hz"
            )


@dataclass(frozen=True)
class Sine(_Wave):
    """amplitude * sin(2 pi frequency t + phase)."""

    def mean(self, spans: Spans) -> Floats:
        self._check_rate(spans)
        return self.amplitude * float(np.sinc(self.frequency * spans.length)) * self._unit(spans.middle)

    def limits(self, t: Floats) -> tuple[Floats, Floats]:
        value = self.amplitude * self._unit(t)
        return value, value

    def _unit(self, t: Floats) -> Floats:
        return np.sin(2 * np.pi * self.frequency * t + radians(self.phase))


@dataclass(frozen=True)
class Square(_Wave):
    """The sign of such a sine, times the amplitude: at phase 0 it begins at +amplitude."""

    def mean(self, spans: Spans) -> Floats:
        self._check_rate(spans)
        border = self._in_half_periods(spans.borders)
        begin, end = border[:-1], border[1:]
        index = np.floor(begin)
        sign = 1 - 2 * np.mod(index, 2)
        # A span holds at most one edge: it is at most half a period long. One that an edge has swallowed is empty.
        length = end - begin
        after = np.divide(np.maximum(end - (index + 1), 0.0), length, out=np.zeros_like(length), where=length > 0)
        return self.amplitude * sign * (1 - 2 * after)

    def limits(self, t: Floats) -> tuple[Floats, Floats]:
        at = self._in_half_periods(t)
        before, after = (self.amplitude * (1 - 2 * np.mod(index, 2)) for index in (np.ceil(at) - 1, np.floor(at)))
        return before, after

    def edges(self, until: float) -> Floats:
        half, offset = self._half_period, self._offset
        count = int(np.floor((until / half + offset) * (1 + ON_EDGE)))
        edges = half * (np.arange(1.0, count + 1) - offset)
        return edges[edges > 0]

    @property
    def _half_period(self) -> float:
        return 0.5 / self.frequency

    @property
    def _offset(self) -> float:
        return self.phase / 180 % 2

    def _in_half_periods(self, t: Floats) -> Floats:
        at = t / self._half_period + self._offset
        edge = np.rint(at)
        return np.where(np.abs(at - edge) < ON_EDGE * np.maximum(1, at), edge, at)


@dataclass(frozen=True, eq=False)
class Pieces(Course):
    """Straight pieces: from times[i] on the value is values[i] + slopes[i] * (t - times[i]); the last goes on.

    times [s]; values; slopes [1/s]; shapes (n,). Before the first time the first piece holds. ``steps`` and ``ramps``
    build it.
    """

    times: Floats
    values: Floats
    slopes: Floats
    _integrals: Floats = field(init=False, repr=False)
    """Integral from the first time to each, shape (n,)."""

    def __post_init__(self) -> None:
        length = np.diff(self.times)
        pieces = (self.values[:-1] + 0.5 * self.slopes[:-1] * length) * length
        object.__setattr__(self, "_integrals", np.concatenate(([0.0], np.cumsum(pieces))))

    def mean(self, spans: Spans) -> Floats:
        ends = self._piece(spans.borders[:1], "right")[0], self._piece(spans.borders[-1:], "left")[0]
        if ends[0] == ends[1] and self.slopes[ends[0]] == 0:
            return np.full(len(spans.middle), self.values[ends[0]])
        borders = snapped(spans.borders, self.times)
        begin, end = borders[:-1], borders[1:]
        # The pieces in which each span begins and ends; an end on a knot belongs to the piece before.
        first, last = self._piece(begin, "right"), self._piece(end, "left")
        mean = self._mean_of(first, begin, end)
        across = np.flatnonzero(last > first)
        if len(across):
            begin, end, first, last = begin[across], end[across], first[across], last[across]
            knot, last_knot = self.times[first + 1], self.times[last]
            integral = self._mean_of(first, begin, knot) * (knot - begin)
            integral += self._integrals[last] - self._integrals[first + 1]
            integral += self._mean_of(last, last_knot, end) * (end - last_knot)
            mean[across] = integral / (end - begin)
        return mean

    def limits(self, t: Floats) -> tuple[Floats, Floats]:
        t = snapped(t, self.times)
        return self._mean_of(self._piece(t, "left"), t, t), self._mean_of(self._piece(t, "right"), t, t)

    def extent(self) -> tuple[float, float]:
        return float(self.values.min()), float(self.values.max())

    def edges(self, until: float) -> Floats:
        return self.times[1:][self.times[1:] <= until]

    def _piece(self, t: Floats, side: Literal["left", "right"]) -> NDArray[np.intp]:
        return np.maximum(np.searchsorted(self.times, t, side=side) - 1, 0)

    def _mean_of(self, piece: NDArray[np.intp], begin: Floats, end: Floats) -> Floats:
        """Mean of a straight line over [begin, end]: its value in the middle."""
        return self.values[piece] + self.slopes[piece] * (0.5 * (begin + end) - self.times[piece])


def steps(times: Floats, values: Floats) -> Pieces:
    """Jumps at ``times`` [s] to ``values``, shapes (n,). Raises InputError where they can't be that."""
    _check_points(times, values)
    return Pieces(times, values, np.zeros(len(times)))


def ramps(times: Floats, values: Floats) -> Pieces:
    """Straight lines through the points (``times`` [s], ``values``), shapes (n,); the last value is held. Raises
    InputError where they can't be that."""
    _check_points(times, values)
    return Pieces(times, values, np.append(np.diff(values) / np.diff(times), 0.0))


@dataclass(frozen=True, eq=False)
class Curve(Course):
    """A smooth curve: ``level`` plus the derivative of the spline ``integral`` (time [s] from 0 on)."""

    integral: CubicSpline
    level: float = 0.0

    def mean(self, spans: Spans) -> Floats:
        # The last border may pass the record's end by rounding.
        within = np.minimum(spans.borders, self.integral.x[-1])
        mean: Floats = np.diff(self.integral(within)) / spans.length
        return mean + self.level if self.level else mean

    def limits(self, t: Floats) -> tuple[Floats, Floats]:
        value = self._values(t)
        return value, value

    def extent(self) -> tuple[float, float]:
        values = self._values(self.integral.x)
        return float(values.min()), float(values.max())

    def _values(self, t: Floats) -> Floats:
        values: Floats = self.integral.derivative()(np.minimum(t, self.integral.x[-1])) + self.level
        return values


def curve(times: Floats, values: Floats) -> Curve:
    """The cubic spline through readings, shapes (n,), as ``cosim.rate_profile`` has it. Raises InputError for fewer
    than four."""
    _check_points(times, values)
    if len(times) < MINIMUM_ROWS:
        raise InputError(f"{len(times)} rows are too few for a curve: give {MINIMUM_ROWS} or more, or lines or steps")
    # A mean over a hold is a difference of two integrals. A level that outweighs all changes, such as a temperature in
    # K, would make them large and their difference coarse.
    mean = float(values.mean())
    level = mean if abs(mean) > float(values.std()) else 0.0
    return Curve(CubicSpline(times, values - level).antiderivative(), level)


@dataclass(frozen=True, eq=False)
class Record(Course):
    """A measured course, on the clock of its record.

    name: what it is, for messages; length [s]; course: against the time since the first reading [s]; the run is at
    ``start`` [s] of the record at its own time ``begin`` [s].
    """

    name: str
    length: float
    course: Course
    start: float = 0.0
    begin: float = 0.0

    def __post_init__(self) -> None:
        if not 0 <= self.start < self.length:
            raise InputError(
                f"start {self.start:g} s lies outside the {self.name}, which lasts {self.length:.6g} s: "
                "choose a start within it"
            )

    def mean(self, spans: Spans) -> Floats:
        moved = spans.moved(self._shift)
        # A picosecond of room for the rounding of index * period.
        if moved.borders[-1] > self.length * (1 + ROUNDING) + 1e-12:
            raise InputError(
                f"{self.name} is too short: it lasts {self.length:.6g} s and the run needs {moved.borders[-1]:.6g} s "
                "of it: shorten the duration or start earlier"
            )
        return self.course.mean(moved)

    def limits(self, t: Floats) -> tuple[Floats, Floats]:
        return self.course.limits(t + self._shift)

    def extent(self) -> tuple[float, float]:
        return self.course.extent()

    def edges(self, until: float) -> Floats:
        return self.course.edges(until + self._shift) - self._shift

    @property
    def _shift(self) -> float:
        return self.start - self.begin


def measured(profile: RateProfile, start: float) -> Record:
    """A rate profile from ``start`` [s] on."""
    return Record(f"rate profile {profile.name}", profile.length, Curve(profile.angle), start)


@dataclass(frozen=True, eq=False)
class Part(Course):
    """A course that acts from ``begin`` until ``until`` [s] and is zero elsewhere."""

    course: Course
    begin: float = 0.0
    until: float = inf

    def __post_init__(self) -> None:
        if not (isfinite(self.begin) and self.begin >= 0):
            raise InputError(f"from = {self.begin!r}: give a time of 0 s or more")
        if not self.until > self.begin:
            raise InputError(f"until = {self.until!r}: give a time after {self.begin:g} s, where the course begins")

    def mean(self, spans: Spans) -> Floats:
        if self.begin <= spans.borders[0] and spans.borders[-1] <= self.until:
            return self.course.mean(spans)
        borders = snapped(spans.borders, self._borders)
        mean = np.zeros(len(spans.middle))
        # The spans that lie within, and the two that a border of the course cuts.
        low = int(np.searchsorted(borders, self.begin, side="left"))
        high = int(np.searchsorted(borders, self.until, side="right")) - 1
        if low < high:
            mean[low:high] = self.course.mean(spans.part(low, high))
        for row in {low - 1, high}:
            if 0 <= row < len(mean):
                begin, end = max(borders[row], self.begin), min(borders[row + 1], self.until)
                if begin < end:
                    cut = Spans.single(float(begin), float(end))
                    mean[row] = self.course.mean(cut)[0] * (cut.length / spans.length)
        return mean

    def limits(self, t: Floats) -> tuple[Floats, Floats]:
        t = snapped(t, self._borders)
        before, after = self.course.limits(t)
        return (
            np.where((t > self.begin) & (t <= self.until), before, 0.0),
            np.where((t >= self.begin) & (t < self.until), after, 0.0),
        )

    def extent(self) -> tuple[float, float]:
        return self.course.extent()

    def edges(self, until: float) -> Floats:
        own = self.course.edges(min(until, self.until))
        edges = np.concatenate((self._borders, own[own > self.begin]))
        return np.unique(edges[(edges > 0) & (edges <= until)])

    @property
    def _borders(self) -> Floats:
        return np.array([self.begin] + ([self.until] if isfinite(self.until) else []))


def _finite(name: str, value: float) -> None:
    if not isfinite(value):
        raise InputError(f"{name} = {value!r}: give a finite number")


def _check_points(times: Floats, values: Floats) -> None:
    if len(times) != len(values) or not len(times):
        raise InputError(f"{len(times)} times and {len(values)} values: give as many of both, one at least")
    if not (np.isfinite(times).all() and np.isfinite(values).all()):
        raise InputError("times and values: give finite numbers")
    if not (np.diff(times) > 0).all():
        at = int(np.argmax(np.diff(times) <= 0))
        raise InputError(f"times {times[at]:g} then {times[at + 1]:g} s: let them increase")
