"""A temperature test, and its blocks: means over the sampling time of the compensation."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray

from calibration.compensation.checks import check_units, doubts, rounding_step
from calibration.compensation.cycles import cycle_numbers
from calibration.compensation.derived import derived, memory, slope
from gyro_model.errors import InputError

Floats = NDArray[np.float64]

STRUCTURE: Final = "structure"
CIRCUIT: Final = "circuit"
FREQUENCY: Final = "frequency"
SIGNALS: Final[Mapping[str, str]] = {STRUCTURE: "°C", CIRCUIT: "°C", FREQUENCY: "Hz"}
"""What tells the temperature, and its unit: sensor on the structure, sensor on the board, drive frequency."""
RATE_OF: Final = "_rate"
"""Ending of a signal's time derivative."""
FEWEST: Final = 8
"""Blocks that a record must give: fewer can be neither fitted nor held out."""
ROWS: Final = 3
"""Rows of a block at least: its noise is their scatter about a line."""
FULL: Final = 0.5
"""A block counts that has this share of the rows of the usual one: the derivative of a shorter one is mostly noise."""
RESTS: Final = 0.05 / 60
"""Slower than this the temperature is settled [°C/s]: at a lag of 240 s the structure is then 0.2 °C behind."""
APART: Final = 1e6
"""Between two records that are joined [s]: longer than any gap within one."""
REST_WINDOW: Final = 120.0
"""Time over which that speed is taken [s]: 20 mK of noise and 62.5 mK of rounding are then below 0.02 °C/min."""


@dataclass(frozen=True)
class TemperatureTest:
    """Rows of a test.

    t [s], rate and rate_true [rad/s, or both in counts], shape (n,); signals: of ``SIGNALS``, shape (n,) each; unit of
    the rates; name: for messages. Raises InputError for time that does not increase, for what is no number, and where
    no signal is given.
    """

    t: Floats
    rate: Floats
    rate_true: Floats
    signals: Mapping[str, Floats]
    unit: str = "rad/s"
    name: str = "record"

    def __post_init__(self) -> None:
        if not self.signals:
            raise InputError(
                f"{self.name}: holds neither a temperature nor a drive frequency: name one, "
                "as in --map sensor_structure=HEADING"
            )
        for column, values in {"t": self.t, "rate": self.rate, "rate_true": self.rate_true, **self.signals}.items():
            finite = np.isfinite(values)
            if not finite.all():
                row = int(np.argmin(finite)) + 1
                raise InputError(f"{self.name}: {column} is no finite number in data row {row}: mend the row")
        late = np.diff(self.t) <= 0
        if late.any():
            row = int(np.argmax(late)) + 2
            raise InputError(f"{self.name}: t does not increase at data row {row}: sort the rows, remove repeated ones")


@dataclass(frozen=True, eq=False)
class Blocks:
    """Means over blocks of a test, shape (n,) each.

    t: middle [s]; rate, rate_true [unit]; noise: standard error of ``rate`` by the scatter within the block [unit];
    inputs: signals [°C, Hz], their derivatives, named ``_rate`` [1/s of them], by the difference to the block before,
    and what else ``with_inputs`` added; unit of the rates; cycle: number of the temperature cycle; doubts: what to know
    of the rows first.
    """

    t: Floats
    rate: Floats
    rate_true: Floats
    noise: Floats
    inputs: Mapping[str, Floats]
    unit: str = "rad/s"
    name: str = "record"
    cycle: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    doubts: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if len(self.cycle) != len(self.t):
            object.__setattr__(self, "cycle", np.zeros(len(self.t), dtype=np.int64))

    def __len__(self) -> int:
        return len(self.t)

    def part(self, chosen: NDArray[np.bool_]) -> "Blocks":
        """The blocks chosen, shape (n,)."""
        inputs = {name: values[chosen] for name, values in self.inputs.items()}
        t, rate, true, noise = (values[chosen] for values in (self.t, self.rate, self.rate_true, self.noise))
        return Blocks(t, rate, true, noise, inputs, self.unit, self.name, self.cycle[chosen], self.doubts)

    def with_inputs(self, names: Iterable[str]) -> "Blocks":
        """The same with inputs that remember, by their names in ``derived.py``; those that are there stay as they are.

        To be called on whole records: memory begins with each.
        """
        inputs = dict(self.inputs)
        again = np.flatnonzero(np.diff(self.t) >= APART) + 1
        for name in names:
            wanted = derived(name)
            if name not in inputs and wanted.signal in inputs:
                parts = zip(np.split(self.t, again), np.split(self.inputs[wanted.signal], again), strict=True)
                inputs[name] = np.concatenate([memory(wanted, t, values) for t, values in parts])
        return replace(self, inputs=inputs)

    @property
    def at_rest(self) -> NDArray[np.bool_]:
        """Which blocks hold no rate of turn."""
        return self.rate_true == 0

    @property
    def temperature(self) -> Floats:
        """What figures are drawn over: the structure's sensor, else the board's, else the drive frequency."""
        return self.inputs[next(name for name in SIGNALS if name in self.inputs)]

    @cached_property
    def settled(self) -> NDArray[np.bool_]:
        """Blocks at which every temperature given rests: its slope over REST_WINDOW either way is below RESTS."""
        rests = np.ones(len(self), dtype=bool)
        first = np.searchsorted(self.t, self.t - REST_WINDOW)
        last = np.searchsorted(self.t, self.t + REST_WINDOW) - 1
        for name in (STRUCTURE, CIRCUIT):
            if name in self.inputs:
                values = self.inputs[name]
                rests &= np.abs(values[last] - values[first]) <= RESTS * (self.t[last] - self.t[first])
        return rests


def make_blocks(test: TemperatureTest, sampling_time: float, settling: float) -> Blocks:
    """The blocks of a test: means over ``sampling_time`` [s], none across a step of the rate of turn; the first
    ``settling`` [s] after a step are left out.

    The derivative of a signal is that of CN 105222765, eqs. 12 and 13, (f1 - f0)/T: the difference of neighbouring
    means over the time between their middles. Raises InputError where fewer than FEWEST blocks remain, and where the
    rate steps more often than that.
    """
    for option, value in (("sampling time", sampling_time), ("settling", settling)):
        if not (np.isfinite(value) and value >= 0) or (option == "sampling time" and value == 0):
            raise InputError(f"{option} {value:g} s: give a positive time in s")
    stretch, used = _stretches(test, settling)
    stays = np.diff(test.t[np.flatnonzero(np.diff(stretch))])
    if len(stays) and np.median(stays) < FULL * sampling_time:
        raise InputError(
            f"{test.name}: the rate steps every {np.median(stays):.3g} s: give a --sampling-time of that or less, not "
            f"{sampling_time:g} s"
        )
    # Rounding of t must not put the row at an edge into the block before.
    grid = np.floor((test.t - test.t[0]) / sampling_time + 1e-6).astype(int)
    edges = np.flatnonzero((np.diff(grid[used]) != 0) | (np.diff(stretch[used]) != 0)) + 1
    starts = np.concatenate([[0], edges]) if used.any() else np.zeros(0, dtype=int)
    counts = np.diff(np.concatenate([starts, [used.sum()]])).astype(float)
    full = counts >= max(FULL * np.median(counts), 1) if len(counts) else np.zeros(0, dtype=bool)
    if full.sum() < FEWEST + 1:
        raise InputError(
            f"{test.name}: {int(full.sum())} blocks of {sampling_time:g} s over {np.ptp(test.t):.4g} s: "
            f"{FEWEST + 1} are needed; give a longer record or a shorter --sampling-time"
        )

    if np.median(counts[full]) < ROWS:
        step = float(np.median(np.diff(test.t)))
        raise InputError(
            f"{test.name}: rows come every {step:.3g} s: a block of {sampling_time:g} s holds fewer than {ROWS}, and "
            f"shows no noise. Is t in ms or min? Else give a --sampling-time of {ROWS * step:.3g} s or more"
        )

    def mean(values: Floats) -> Floats:
        return (np.add.reduceat(values[used], starts) / counts)[full]

    t, rate, true = mean(test.t), mean(test.rate), mean(test.rate_true)
    stuck = [name for name, values in test.signals.items() if np.ptp(values) == 0]
    # Where none moves the methods say so.
    stuck = stuck if len(stuck) < len(test.signals) else []
    inputs = {name: mean(values) for name, values in test.signals.items() if name not in stuck}
    inputs |= {name + RATE_OF: slope(t, values) for name, values in inputs.items()}
    variance = _variance(test.t[used], test.rate[used], starts, counts)
    # Few rows tell little of their own scatter: one noise for all blocks.
    typical = float(np.nanmedian(variance)) if np.isfinite(variance).any() else 0.0
    step = rounding_step(test.rate, typical)
    # Rounded in steps that noise does not blur, a mean is as wrong as a row.
    noise = np.sqrt(typical / counts + step**2 / 12)[full]
    # The first block has no derivative.
    has_both = np.arange(len(t)) > 0
    blocks = Blocks(t, rate, true, noise, inputs, test.unit, test.name).part(has_both)
    turned = check_units(test.name, blocks.rate, blocks.rate_true)
    left = [f"{name} stays at {test.signals[name][0]:g} {SIGNALS[name]} and is left out" for name in stuck]
    told = tuple(
        f"{test.name}: {text}" for text in (*left, *turned, *doubts(test.rate, variance[full], step, test.unit))
    )
    return replace(blocks, cycle=cycle_numbers(blocks.temperature), doubts=told)


def joined(records: Sequence[Blocks]) -> Blocks:
    """Records one after another, APART in time, each with cycles of its own. Inputs that are not in all are
    left out. Raises InputError where the units of the rate differ, and where no signal is in all."""
    first, *others = records
    if not others:
        return first
    for other in others:
        if other.unit != first.unit:
            raise InputError(f"{other.name}: rates are in {other.unit}, those of {first.name} in {first.unit}")
    names = [name for name in first.inputs if all(name in other.inputs for other in others)]
    if not names:
        raise InputError(f"{', '.join(r.name for r in records)}: no temperature or drive frequency is in all of them")
    numbers, times, begin, end = [], [], 0, -APART
    for record in records:
        numbers.append(record.cycle + begin)
        times.append(record.t - record.t[0] + end + APART)
        begin, end = int(numbers[-1].max()) + 1, float(times[-1][-1])

    def both(of: Callable[[Blocks], Floats]) -> Floats:
        return np.concatenate([of(record) for record in records])

    inputs = {name: np.concatenate([record.inputs[name] for record in records]) for name in names}
    return Blocks(
        np.concatenate(times),
        both(lambda b: b.rate),
        both(lambda b: b.rate_true),
        both(lambda b: b.noise),
        inputs,
        first.unit,
        first.name,
        np.concatenate(numbers),
        tuple(text for record in records for text in record.doubts),
    )


def _stretches(test: TemperatureTest, settling: float) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Number of the stretch of constant rate of turn of each row, and whether the row is used, shape (n,) both."""
    steps = np.flatnonzero(np.diff(test.rate_true) != 0) + 1
    # A measured rate moves all the time: its means hold as well, and no row is settled.
    if len(steps) > 0.2 * len(test.t):
        return np.zeros(len(test.t), dtype=np.int64), np.ones(len(test.t), dtype=bool)
    stretch = np.zeros(len(test.t), dtype=np.int64)
    stretch[steps] = 1
    stretch = np.cumsum(stretch)
    # The row at the step itself is a mean over both rates.
    start = np.concatenate([[-np.inf], test.t[steps]])
    return stretch, test.t > start[stretch] + settling


def _variance(t: Floats, rate: Floats, starts: NDArray[np.int64], counts: Floats) -> Floats:
    """Of the rows of each block about a straight line within it, shape (n,); nan where they are two."""

    def sums(values: Floats) -> Floats:
        return np.add.reduceat(values, starts)

    group = np.repeat(np.arange(len(starts)), counts.astype(int))
    u = t - (sums(t) / counts)[group]
    v = rate - (sums(rate) / counts)[group]
    moment = sums(u * u)
    slope = np.divide(sums(u * v), moment, out=np.zeros_like(moment), where=moment > 0)
    scatter = sums((v - slope[group] * u) ** 2)
    return np.divide(scatter, counts - 2, out=np.full_like(counts, np.nan), where=counts > 2)
