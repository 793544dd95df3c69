"""Simulates measured runs with the FMU, many at a time: one instance a thread, the loop over samples compiled."""

import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import replace
from functools import cached_property
from queue import SimpleQueue
from time import perf_counter, thread_time
from types import TracebackType
from typing import Final, NamedTuple, Self, TypeVar

import numpy as np
from sympy import sympify

from discrepancy.clock import Clock
from discrepancy.data.record import LEVELS, Floats, Record
from discrepancy.fit.bench import Bench
from discrepancy.fit.defect import Distortion, Timing, distortion_names, distortions
from discrepancy.fit.distorted import Distorted, Sizes
from discrepancy.fit.forced import Forced, commands, distorted, forced, steps_a_sample
from discrepancy.fit.lagged import lagged
from discrepancy.fit.variation import Driven, Motion, Seen, Traveller
from gyro_model.anatomy import Delay, Lag
from gyro_model.build import build_form
from gyro_model.errors import InputError
from gyro_model.level import regions
from gyro_model.model import Model
from gyro_model.quantities import Quantity
from gyro_model.varied import varied_model

SPLIT: Final = 4
"""Times as many steps where a force that runs on meets what acts within a step. What a delay or a lag of a part of one
does is then right to 2e-4 at a fortieth of the sample rate, where a lag and a delay are told apart by less than the
steps of a sample would err; a dry friction turns round where it does to 2e-4 of the motion, where these put it 0.4 of a
noise of 0.003 off for an accelerometer, and any delay, by its shorter steps, would seem to mend that."""
PARTS: Final = 12
"""Of a sample, in which it shows between which samples a motion jumps."""
BACKWARD: Final = np.array([25, -48, 36, -16, 3]) / 12
"""Of the last five points, the derivative at the last times their step: right to (w step)^4/5, 4e-5 of an acceleration
at thirteen samples a period. The force changes at each sample, so that no point after it counts."""
PIECE, QUICK = 500, 2e-3
"""Samples after which a run first asks whether there is time for more, and the time [s] of a piece below which the next
is twice as long: so that asking is nothing beside, and stiff runs are asked in time."""
STIFFEST: Final = 2e-5
"""Processor time [s] a step of a run that is followed to its end. Linear steps take 0.1 µs, those of forces with
corners 2 µs; what takes more is stiff, as a stop a million times as stiff as the suspension (1.5 ms), and no data
tell it from one that is less so."""
AT_ONCE: Final = 8
"""Columns that go through the defects of a record together: what these do at each sample is found once for all."""
TICKS: Final = 0.1
"""Processor time [s] that any run may take: some ticks of the coarsest clock."""
MIRRORED: Final = {"kyy": "kxx", "dyy": "dxx", "sense_gain_y": "sense_gain_x"}
OTHER_AXIS: Final = frozenset((*MIRRORED, "kxy", "dxy"))
"""What a record of one axis leaves open."""

Job = tuple[Record, Mapping[str, float]]
Item = TypeVar("Item")
Result = TypeVar("Result")


class _Latest(NamedTuple):
    """What the FMU gave for a record: of which derivative, under which values (steps, inputs), every how many steps."""

    record: Record
    order: int
    each: int
    device: Mapping[str, float]
    values: Floats
    v: Floats


class Played(NamedTuple):
    """How a record is simulated. driven: what acts in each step, beyond its end where the voltage reaches there;
    stride: steps a sample; late: by how much the force acts later [s]; derived: whether accelerations are those of its
    speeds."""

    record: Record
    distorted: Distorted
    timing: Timing
    driven: Forced
    stride: int
    late: float
    derived: bool

    @property
    def commands(self) -> Floats | None:
        """The force at samples (n, 2) [N]; None where it is held."""
        found = commands(self.record, self.late)
        beyond = len(self.driven[0]) // self.stride - len(self.record.t)
        return found if found is None else np.concatenate((found, np.repeat(found[-1:], beyond, axis=0)))


class Followed(NamedTuple):
    """A run whose motion is known; time_constant: of the amplifier's lag [s]; level: what is added to what is
    recorded."""

    motion: Motion
    played: Played
    time_constant: float
    level: Floats

    def recorded(self, columns: Sequence[Floats]) -> Iterator[Floats]:
        """What is recorded (n, axes) of each of some columns that are added to the voltage before the lag."""
        own, timing, samples = self.played.distorted, self.played.timing, len(self.played.record.t)
        if not (self.time_constant or own.acting):
            yield from (column[:samples] for column in columns)
            return
        for first in range(0, len(columns), AT_ONCE):
            v = np.stack(columns[first : first + AT_ONCE], axis=-1)
            v = lagged(v.reshape(len(v), -1), timing.period, self.time_constant).reshape(v.shape)
            v = own.at_samples(own.between_samples(v, timing), timing)[:samples]
            yield from (np.array(v[..., i], order="C") for i in range(v.shape[-1]))


class Simulator:
    """Runs of a model under measured inputs; a context manager. ``jobs``: threads, by default one a core; clock: of the
    diagnosis that they are for; brief: whether they are few, as in VariedModel."""

    def __init__(
        self, model: Model, jobs: int | None = None, clock: Clock | None = None, *, brief: bool = False
    ) -> None:
        """Builds the FMU where that has not been done. Raises InputError as ``build`` does."""
        form = varied_model(model, brief=brief)
        path = build_form(form)["fmi3"]
        self.model = model
        count = jobs or os.cpu_count() or 1
        self.clock = clock or Clock(count)
        self.seen = Seen()
        self._benches: SimpleQueue[Bench] = SimpleQueue()
        self._all = [Bench(path, {}, form) for _ in range(count)]
        for bench in self._all:
            self._benches.put(bench)
        self._pool, self._callers = ThreadPoolExecutor(count), ThreadPoolExecutor(count)
        held = [e for e in model.effects if isinstance(e, Delay | Lag)]
        lags = [e for e in held if isinstance(e, Lag)]
        self._delays = [e.delay.name for e in held if isinstance(e, Delay)]
        self._lags = [e.time_constant.name for e in lags]
        self._lag_movers = [q for e in lags for switch in model.wakers(e) for q in switch.sizes]
        self._late = [q for e in held for switch in (e, *model.wakers(e)) for q in switch.sizes]
        own = [q for e in (*held, *_parting()) for q in e.parameters]
        self._refining = frozenset(q.name for q in (*self._late, *own))
        self._driven: dict[tuple[int, int], tuple[Record, Forced]] = {}
        self._distorted: dict[tuple[int, int], tuple[Sizes, Forced]] = {}
        self._latest: dict[int, _Latest] = {}
        self._parts: dict[int, tuple[Record, Record, slice]] = {}

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._callers.shutdown(cancel_futures=True)
        self._pool.shutdown(cancel_futures=True)
        for bench in self._all:
            bench.close()

    def like(self, model: Model) -> "Simulator":
        """One of another model for few runs, with as many threads, the same clock and the same parts of runs."""
        other = Simulator(model, len(self._all), self.clock, brief=True)
        other._parts.update(self._parts)
        return other

    def run(self, record: Record, parameters: Mapping[str, float], *, parts: bool | None = None) -> Floats:
        """The voltage [V] (n, axes) that the model gives under the record's inputs, noise off.

        parameters: by FMU name, SI, initial state included; parts: whether in parts of a step, None as what acts asks
        for. In whole steps what acts within them is off by the staircase of the force, which cancels in the difference
        of two runs in which it is alike: up to 1e-3 of a column is left where the force runs on between samples.
        Raises InputError where the FMU refuses one; NaN from the sample on at which the motion left all bounds, or its
        steps took too long (STIFFEST). Raises OutOfTime where the clock says so.
        """
        self.clock.check()
        with self._bench() as bench:
            return self._on(bench, record, parameters, parts)

    @contextmanager
    def _bench(self) -> Iterator[Bench]:
        """A plant that no other thread uses."""
        bench = self._benches.get()
        try:
            yield bench
        finally:
            self._benches.put(bench)

    def _run_pieces(self, v: Floats, each: int, piece: Callable[[int, int], int]) -> None:
        """Fills v (samples, 2) by ``piece`` of so many steps ``each`` a sample; NaN from where one fails or is too
        slow."""
        # The first of all is compiled.
        piece(0, 0)
        done, last, length, begun = 0, len(v) - 1, PIECE, perf_counter()
        so_far, processor = begun, thread_time()
        while done < last:
            self.clock.check()
            until = min(done + length, last)
            reached = piece(done, until)
            before, so_far = so_far, perf_counter()
            most = TICKS + STIFFEST * each * until
            # To ask for processor time takes as long as some hundred steps, and it is never more than what passes.
            if reached < until or (so_far - begun > most and thread_time() - processor > most):
                v[reached + 1 :] = np.nan
                return
            done, length = until, 2 * length if so_far - before < QUICK else length

    def between_samples(self, record: Record, parameters: Mapping[str, float]) -> Floats | None:
        """What an accelerometer gives in PARTS of each sample or more (n, parts, axes) [V], beginning with the sample
        itself, in a motion that is bent in places; None for other sensors and motions. Raises as ``run`` does."""
        self.clock.check()
        if record.order != 2 or not self._bent(record, parameters):
            return None
        device = _device(record, parameters)
        driven = forced(record, -(-PARTS // steps_a_sample(record)))
        stride = len(driven[0]) // len(record.t)
        each = stride // next(parts for parts in range(PARTS, stride + 1) if stride % parts == 0)
        with self._bench() as bench:
            v, piece = bench.play(device, driven, float(record.t[0]), each, record.order, None)
            self._run_pieces(v, each, piece)
        return _sensed(record, device, v).reshape(len(record.t), -1, record.axes)

    def refines(self, parameters: Iterable[str]) -> bool:
        """Whether one of the parameters asks for parts of a step where it is not neutral."""
        return not self._refining.isdisjoint(parameters)

    def differs(self, record: Record, parameters: Mapping[str, float], parts: bool) -> bool:
        """Whether a run with ``parts`` goes in other steps than by itself."""
        return self._in_parts(record, parameters, parts) != self._in_parts(record, parameters, None)

    def _in_parts(self, record: Record, parameters: Mapping[str, float], parts: bool | None) -> bool:
        own, runs_on = Distorted.at(parameters), record.hold != "zero"
        if own.split or self._derived(record, parameters, own):
            return True
        if parts is not None:
            return parts and (runs_on or own.within)
        # Speeds and accelerations do not go through the amplifier's lag.
        held_back = self._delay(parameters) > 0 if record.order else self._held_back(parameters)
        return own.within or (runs_on and (held_back or self._bent(record, parameters)))

    def run_all(self, jobs: Sequence[Job]) -> list[Floats]:
        """``run`` of each job, in parallel."""

        def one(job: Job) -> Floats:
            return self.run(*job)

        return self._on_threads(self._pool, one, jobs)

    def try_all(self, jobs: Sequence[Job], *, parts: bool | None = None) -> list[Floats | None]:
        """``run`` of each job, in parallel; None where the FMU refuses its parameters or the motion leaves all
        bounds."""

        def attempt(job: Job) -> Floats | None:
            try:
                v = self.run(*job, parts=parts)
            except InputError:
                return None
            return v if np.isfinite(v).all() else None

        return self._on_threads(self._pool, attempt, jobs)

    def follow(self, record: Record, parameters: Mapping[str, float]) -> Followed | None:
        """The motion of a run, along which ``vary`` goes; None where more acts than that follows. Raises InputError as
        ``run`` does."""
        self.clock.check()
        played = self._played(record, parameters, parts=False)
        time_constant = self._time_constant(record, parameters)
        if played.derived or time_constant is None:
            return None
        values, names, step = driven = played.driven
        device = self._without_lag(record, parameters)
        with self._bench() as bench:
            start, inputs = float(record.t[0]), bench.value_references(names)
            # Of a record of one axis the other may move all the same, by what its parameters say.
            for axes in range(record.axes, 3):
                driven_by = Driven(inputs, values, start, step, played.stride, axes, played.commands)
                motion = Motion(bench.library, driven_by, accelerations=record.order == 2)
                bench.begin(device, driven, start)
                if motion.follow(bench.instance):
                    return Followed(motion, played, time_constant, _level(record, parameters))
        return None

    def vary(self, followed: Followed, jobs: Sequence[Job]) -> list[Floats | None]:
        """What the parameters of each job add to the voltage [V] (n, axes) of the run that was followed, to first order
        in what they add to its motion, in parallel; None where the FMU refuses them, more acts than is followed, a
        defect of the record acts in another way, or the motion leaves all bounds."""

        def some(own: Sequence[Job]) -> list[Floats | None]:
            self.clock.check()
            return self._vary(followed, own)

        each = -(-len(jobs) // len(self._all))
        parts = [jobs[i : i + each] for i in range(0, len(jobs), each)] if jobs else []
        return [column for part in self._on_threads(self._pool, some, parts) for column in part]

    def _vary(self, followed: Followed, jobs: Sequence[Job]) -> list[Floats | None]:
        motion, played = followed.motion, followed.played
        travellers: dict[int, Traveller] = {}
        for number, (record, parameters) in enumerate(jobs):
            time_constant = self._time_constant(record, parameters)
            alike = (Distorted.at(parameters), time_constant) == (played.distorted, followed.time_constant)
            with self._bench() as bench, suppress(InputError):
                if alike:
                    bench.begin(self._without_lag(record, parameters), played.driven, float(record.t[0]))
                    traveller = motion.depart(bench.instance)
                    travellers |= {number: traveller} if traveller is not None else {}
        varied = dict(zip(travellers, motion.varied(list(travellers.values()), jobs[0][0].order), strict=True))
        bounded = [number for number, column in varied.items() if np.isfinite(column).all()]
        sensed = [_sensed(record, _device(record, p), varied[i]) for i in bounded for record, p in [jobs[i]]]
        result: list[Floats | None] = [None] * len(jobs)
        for number, column in zip(bounded, followed.recorded(sensed), strict=True):
            record, parameters = jobs[number]
            result[number] = record.steady(_raised(column, _level(record, parameters) - followed.level))
        return result

    def each(self, function: Callable[[Item], Result], items: Iterable[Item]) -> list[Result]:
        """``function`` of each item, in parallel; it may simulate, which runs on threads of its own."""
        return self._on_threads(self._callers, function, items)

    def _on_threads(
        self, pool: ThreadPoolExecutor, work: Callable[[Item], Result], items: Iterable[Item]
    ) -> list[Result]:
        if len(self._all) == 1:
            # Handing a short run to another thread costs a third of it.
            return [work(item) for item in items]
        with self.clock.side_by_side() as batch:
            return list(pool.map(batch.part(work), items))

    def cut(self, record: Record, number: int, counted: int | None = None) -> tuple[Record, ...]:
        """``record`` in ``number`` records of equal length, each under the force that it has in the whole; counted: of
        each the first samples that are not masked."""
        rows = np.array_split(np.arange(len(record.t)), number)
        return tuple(self.part(record, int(own[0]), int(own[-1]) + 1, counted) for own in rows)

    def part(self, record: Record, begin: int, end: int, counted: int | None = None) -> Record:
        """Samples ``begin`` to ``end`` of ``record``, under the force that they have in the whole; counted: so many
        from the first that counts on, all later ones masked."""
        own = slice(begin, end)
        valid = record.valid[own].copy()
        if counted is not None:
            valid[int(np.argmax(valid)) + counted :] = False
        if begin and record.order == 2 and record.hold == "zero":
            # An accelerometer sees the force before it changes, and that is another part's.
            valid[0] = False
        held = {name: column[own] for name, column in record.conditions.items()}
        # What is slow over a run is not over a part.
        drift = record.drift if end - begin == len(record.t) else None
        part = replace(record, t=record.t[own], u=record.u[own], v=record.v[own], conditions=held, drift=drift,
                       valid=valid, begun=record.begun if begin == 0 else None)  # fmt: skip
        self._parts[id(part)] = part, record, own
        return part

    def run_of(self, record: Record) -> Record:
        """The run that ``record`` is a part of, itself where it is none."""
        return self.place_of(record)[0]

    def _held_back(self, parameters: Mapping[str, float]) -> bool:
        return any(parameters.get(q.name, q.start) != q.start for q in self._late)

    def _delay(self, parameters: Mapping[str, float]) -> float:
        """By how much the force acts later [s]."""
        return sum(parameters.get(name, 0.0) for name in self._delays)

    def _derived(self, record: Record, parameters: Mapping[str, float], own: Distorted) -> bool:
        """Whether accelerations are those of the speeds."""
        # What changes a force that runs on, or comes late, leaves open what it is at a sample.
        open_at_samples = bool(own.on_force) and (record.hold != "zero" or self._delay(parameters) > 0)
        return record.order == 2 and (own.within or open_at_samples)

    def _bent(self, record: Record, parameters: Mapping[str, float]) -> bool:
        """Whether something bends the motion in places, as a dry friction does at rest."""
        return any(parameters.get(q.name, q.start) != q.start for q in self._bending[record.axes - 1])

    @cached_property
    def _bending(self) -> tuple[list[Quantity], list[Quantity]]:
        """Sizes of what bends the motion in places, of x and of both axes."""
        bends = [(q, e) for e in self.model.forces if regions(e, self.model) for q in e.sizes]
        return [q for q, e in bends if sympify(e.force[0]).has(q.symbol)], [q for q, _ in bends]

    def _time_constant(self, record: Record, parameters: Mapping[str, float]) -> float | None:
        """Of the amplifier's lag [s], 0 where nothing goes through it; None where it moves."""
        if record.order:
            return 0.0
        if any(parameters.get(q.name, q.start) != q.start for q in self._lag_movers):
            return None
        return sum(parameters.get(name, 0.0) for name in self._lags)

    def _without_lag(self, record: Record, parameters: Mapping[str, float]) -> Mapping[str, float]:
        return {**_device(record, parameters), **dict.fromkeys(self._lags, 0.0)}

    def _inputs(self, record: Record, split: int, sizes: Sizes = ()) -> Forced:
        """What drives each step of a record, ``split`` times as many as usual; kept, since a record is simulated many
        times. sizes: of what changes the force on its way."""
        if sizes and id(record) not in self._parts:
            last = self._distorted.get((id(record), split))
            if last is None or last[0] != sizes:
                last = sizes, distorted(self._inputs(record, split), record.axes, dict(sizes))
                self._distorted[id(record), split] = last
            return last[1]
        if sizes:
            return self._made(record, split, sizes)
        kept = self._driven.get((id(record), split))
        if kept is None:
            kept = self._driven[id(record), split] = record, self._made(record, split)
        return kept[1]

    def _made(self, record: Record, split: int, sizes: Sizes = ()) -> Forced:
        if id(record) not in self._parts:
            return forced(record, split)
        _, whole, own = self._parts[id(record)]
        values, names, step = self._inputs(whole, split, sizes)
        stride = len(values) // len(whole.t)
        return values[own.start * stride : own.stop * stride], names, step

    def place_of(self, record: Record) -> tuple[Record, int]:
        """The run that ``record`` is a part of, itself where it is none, and with which sample of it it begins."""
        if id(record) not in self._parts:
            return record, 0
        _, whole, own = self._parts[id(record)]
        run, first = self.place_of(whole)
        return run, first + int(own.start)

    def forget(self, records: Sequence[Record]) -> None:
        """Frees what is kept of records that will not be simulated again."""
        for record in records:
            self._parts.pop(id(record), None)
            self._latest.pop(id(record), None)
            for split in (1, SPLIT):
                self._driven.pop((id(record), split), None)
                self._distorted.pop((id(record), split), None)

    def _played(self, record: Record, parameters: Mapping[str, float], parts: bool | None) -> Played:
        own = Distorted.at(parameters)
        split = self._in_parts(record, parameters, parts)
        values, names, step = self._inputs(record, SPLIT if split else 1, own.on_force)
        timing = Timing(self.place_of(record)[1], 1 / record.sample_rate)
        samples = len(record.t)
        driven = own.lengthened(values, samples, timing), names, step
        late, derived = self._delay(parameters), self._derived(record, parameters, own)
        return Played(record, own, timing, driven, len(values) // samples, late, derived)

    def _on(self, bench: Bench, record: Record, parameters: Mapping[str, float], parts: bool | None) -> Floats:
        played = self._played(record, parameters, parts)
        own, derived, stride, timing = played.distorted, played.derived, played.stride, played.timing
        step = played.driven[2]
        # A held force bends the motion anew at each sample: no curve through the samples knows what is between.
        each = 1 if derived or (own.within and parts is not False) else stride
        device = _device(record, parameters)
        v = _sensed(record, device, self._simulated(bench, played, device, each, 1 if derived else record.order))
        if own.within:
            v = own.between_samples(v, Timing(timing.first * stride // each, step * each))
        v = _slope(v, stride, step) if derived else v[:: stride // each]
        v = np.array(_raised(own.at_samples(v, timing)[: len(record.t)], _level(record, parameters)), order="C")
        return record.steady(v)

    def _simulated(self, bench: Bench, played: Played, device: Mapping[str, float], each: int, order: int) -> Floats:
        """The voltage, or by ``order`` speeds or accelerations, that the FMU gives every ``each`` steps; the latest of
        a record is kept, since what is done to the voltage alone is tried in many sizes."""
        record, driven = played.record, played.driven
        kept = self._latest.get(id(record))
        if kept and kept[1:4] == (order, each, device) and np.array_equal(kept.values, driven[0]):
            return kept.v
        v, piece = bench.play(device, driven, float(record.t[0]), each, order, played.commands)
        self._run_pieces(v, each, piece)
        self._latest[id(record)] = _Latest(record, order, each, device, driven[0], v)
        return v


def _device(record: Record, parameters: Mapping[str, float]) -> Mapping[str, float]:
    """The parameters of both axes without those that are no device's."""
    own = {name: value for name, value in parameters.items() if name not in distortion_names() and name not in LEVELS}
    return both_axes(own) if record.axes == 1 else own


def _level(record: Record, parameters: Mapping[str, float]) -> Floats:
    """What is added to the voltage of each axis [V]."""
    return np.array([parameters.get(name, 0.0) for name in LEVELS[: record.axes]])


def _raised(v: Floats, level: Floats) -> Floats:
    """The voltage (n, axes) with a level of each axis added."""
    return v + level if level.any() else v


def _sensed(record: Record, device: Mapping[str, float], v: Floats) -> Floats:
    """The voltage (n, axes) [V] of what the model gives (n, 2): of speeds and accelerations by the sensors' gains."""
    v = v[:, : record.axes]
    if not record.order:
        return v
    gains = [device[f"sense_gain_{axis}"] / record.reference**record.order for axis in "xy"]
    # Column by column: by rows of two numpy takes ten times as long.
    return np.stack([gain * column for gain, column in zip(gains, v.T, strict=False)], axis=1)


def _parting() -> tuple[Distortion, ...]:
    """Distortions that act within a step."""
    return tuple(d for d in distortions() if d.within or d.split)


def _slope(v: Floats, stride: int, step: float) -> Floats:
    """The derivative at every ``stride``-th of v (n, axes), by the points before it; at the first, by those after."""
    at, back = np.arange(0, len(v), stride), range(len(BACKWARD))
    first = -sum(BACKWARD[k] * v[k] for k in back)
    return np.vstack((first, sum(BACKWARD[k] * v[at[1:] - k] for k in back))) / step


def both_axes(parameters: Mapping[str, float]) -> dict[str, float]:
    """``parameters`` of a one-axis record for an FMU, which has two: y, of which nothing is known, is like x, so that a
    step that is short enough for x is so for y, and uncoupled."""
    return {**parameters, **{own: parameters[other] for own, other in MIRRORED.items()}, "kxy": 0.0, "dxy": 0.0}
