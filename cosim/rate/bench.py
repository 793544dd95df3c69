"""A test bench for rate mode: one gyroscope turned on again and again, and what it is put through."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import ceil, degrees
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cosim.rate import loop
from cosim.rate.allan import noise_limits
from cosim.rate.courses import Course, constant
from cosim.rate.master import LoopedPlant, simulate
from cosim.rate.run import SAMPLES, RateRun
from cosim.rate.steady_state import Output, left_out, output_at
from gyro_model.device import Device

Floats = NDArray[np.float64]

FULL_AT_MOST: Final = 30.0
"""Where envelope and full FMU disagree, records at rest last this long at most [s], some 15 s of computing, or as long
as their Allan deviation needs."""
SETTLES: Final = 5.0
"""A device that settles later than this is only run on the envelope FMU [s]."""
CONVERTER: Final = 200e3
"""The converter samples at this rate [Hz], or at the multiple of it that a faster drive needs."""
FULL_SAMPLES: Final = 5
"""The full FMU is run up to this multiple: a second of the simulation then costs a second or two."""
LONG: Final = 100.0
"""Records at rest last at least so many times the shortest averaging time of their Allan deviation: two decades."""
AGREE: Final = 1e-3
"""Envelope and full FMU agree where bias over full scale and scale factor differ by less than this, or by less than the
noise."""
NOISES: Final = ("sense_noise", "adc_quantisation", "thermal_force")
"""Noises of which ``noise_limits`` knows."""
SURE: Final = 4.0
"""Differences within this many standard errors are noise."""


class Plan(NamedTuple):
    """How much is measured. rest_records of rest_duration [s]; turn_ons of turn_on_duration [s]; repeats of every other
    test; steps of the rate to either side; temperatures [°C]; plateau: time measured at each rate [s];
    soak: time at each end of a cycle of the temperature [s], 0: no cycle."""

    rest_records: int
    rest_duration: float
    turn_ons: int
    turn_on_duration: float
    repeats: int
    steps: int
    temperatures: tuple[float, ...]
    plateau: float
    soak: float


WHOLE: Final = Plan(5, 2000.0, 10, 20.0, 3, 10, (-40.0, -20.0, 0.0, 25.0, 45.0, 65.0, 85.0), 4.0, 300.0)
QUICK: Final = Plan(3, 300.0, 5, 5.0, 2, 5, (-40.0, 25.0, 85.0), 1.0, 0.0)


class ColdRun(RateRun):
    """A run in which nothing swings when the power comes on, whatever the device file lets begin."""

    def plant_parameters(self) -> dict[str, float]:
        """Parameters of the FMU, at rest at the start."""
        return super().plant_parameters() | dict.fromkeys(self.device.model.start_of.values(), 0.0)


class Record(NamedTuple):
    """A record at the output: t: end of each row [s]; rate, true rate, quadrature [rad/s]; drive frequency [Hz], force
    [N], amplitude [V]; shapes (n,); interval [s]; locked_at [s] from power on."""

    t: Floats
    rate: Floats
    true: Floats
    quadrature: Floats
    frequency: Floats
    force: Floats
    amplitude: Floats
    interval: float
    locked_at: float


class Agreement(NamedTuple):
    """Envelope less full FMU: bias [rad/s] and scale factor, each with its standard error."""

    bias: float
    bias_error: float
    scale_factor: float
    scale_factor_error: float
    agree: bool


@dataclass(frozen=True)
class Bench:
    """A device on the bench.

    design: what its loops know, None: all of it; closed: the sense loop rebalances; seed: of the first turn-on, each
    next one has the next seed; advance: called with the simulated time of every record that is done [s].
    """

    device: Device
    design: Device | None = None
    closed: bool = False
    seed: int = 1
    plan: Plan = WHOLE
    advance: Callable[[float], None] = field(default=lambda seconds: None)

    @cached_property
    def typical(self) -> ColdRun:
        """A run at rest at the reference temperature, for what follows from settings and design."""
        return self.asked(0.1, envelope=True)

    @property
    def full_scale(self) -> float:
        """Full scale [rad/s]."""
        return self.typical.settings.full_scale

    @cached_property
    def reference_temperature(self) -> float:
        """The temperature at which the device is calibrated [K]."""
        return float(self.device.all_parameters["t_ref"])

    @property
    def settling(self) -> float:
        """Time after which a step of the rate is no longer seen [s]."""
        return self.typical.settling

    @cached_property
    def sample_rate(self) -> float:
        """Of the converter [Hz]."""
        return CONVERTER * max(ceil(SAMPLES * max(self.device.frequencies) / CONVERTER), 1)

    @property
    def can_run_full(self) -> bool:
        """Whether the device is slow enough for the full FMU, and settles soon enough."""
        return self.settling <= SETTLES and self.sample_rate <= FULL_SAMPLES * CONVERTER

    def stays(self, measured: float) -> float:
        """How long a plateau stays so that ``measured`` [s] of it are settled: whole rows at 10, 20, 50 and 100 Hz."""
        return float(np.ceil(10 * (self.settling + measured)) / 10)

    def settled(self, record: Record, stays: float) -> NDArray[np.bool_]:
        """Which rows of plateaus no longer show the step at their begin, shape (n,)."""
        begin: NDArray[np.bool_] = (record.t - record.interval + 1e-9) % stays > self.settling
        return begin

    def seeds(self, count: int) -> range:
        """Seeds of so many turn-ons."""
        return range(self.seed, self.seed + count)

    def expected(self, temperature: float | None = None) -> Output:
        """The settled output by harmonic balance at a temperature [K], None: of reference."""
        return output_at(self.device, self.typical.nominal.calibration, temperature or self.reference_temperature)

    @property
    def left_out(self) -> dict[str, str]:
        """Why effects that act have no place in the harmonic balance, by id."""
        return left_out(self.device)

    @cached_property
    def angle_random_walk(self) -> float:
        """What white noise of motion and converter makes at the reference temperature [rad/√s]."""
        run = self.typical
        return noise_limits(run.nominal, self.reference_temperature, 1 / run.sample_rate).total

    @cached_property
    def other_noises(self) -> tuple[str, ...]:
        """Noises that act and of which ``noise_limits`` does not know."""
        model = self.device.model
        return tuple(e.id for e in model.effects if e.noise and e.id not in NOISES and self.device.acts(e))

    def asked(
        self,
        duration: float,
        *,
        rate: Course | None = None,
        temperature: float | Course | None = None,
        seed: int | None = None,
        output_rate: float = 10.0,
        envelope: bool,
        held: Mapping[str, float] | None = None,
        wide: float = 1.0,
    ) -> ColdRun:
        """A run of ``duration`` [s]; temperature, or its course [K]; wide: full scale is taken to be so many times what
        it is; held: further inputs by name, SI."""
        device, design = self.device, self.design
        if wide != 1.0:
            full = {"full_scale": wide * self.full_scale}
            device = replace(device, rate_mode={**device.rate_mode, **full})
            design = None if design is None else replace(design, rate_mode={**design.rate_mode, **full})
        ambient = temperature or self.reference_temperature
        if not isinstance(ambient, Course):
            ambient = constant(ambient, f"{ambient:g} K")
        return ColdRun(
            device=device,
            rate=rate or constant(0.0, "at rest"),
            temperature=ambient,
            closed=self.closed,
            duration=duration,
            seed=self.seed if seed is None else seed,
            sample_rate=self.sample_rate,
            output_rate=output_rate,
            envelope=envelope,
            design=design,
            others={name: constant(value, f"{value:g}") for name, value in (held or {}).items()},
        )

    def record(self, duration: float, *, envelope: bool | None = None, **course: Any) -> Record:
        """A record, as ``asked``; envelope: None where the envelope serves if it agrees with the full FMU."""
        where = self.envelope if envelope is None else envelope
        run = self.asked(duration, envelope=where, **course)
        result = simulate(run)
        self.advance(duration + result.started_at)
        column = {name: result.record[name].to_numpy() for name in result.record.columns}
        return Record(
            t=column["t"],
            rate=column["rate"],
            true=column["rate_true"],
            quadrature=column["quadrature"],
            frequency=column["drive_frequency"],
            force=column["drive_force"],
            amplitude=column["drive_amplitude"],
            interval=run.interval,
            locked_at=result.locked_at,
        )

    def power_on(self, duration: float, seed: int, *, envelope: bool, output_rate: float) -> tuple[Floats, Floats]:
        """Times [s] since power on and the output [rad/s] at rest, whether in lock or not; shapes (n,)."""
        run = self.asked(duration, seed=seed, envelope=envelope, output_rate=output_rate)
        with LoopedPlant(run) as plant:
            rows, _ = plant.step(run.inputs(0, run.rows * run.per_row), run.rows)
        self.advance(duration)
        t: Floats = np.float64(run.interval) * np.arange(1, run.rows + 1)
        return t, rows[:, loop.RATE]

    @cached_property
    def agreement(self) -> Agreement | None:
        """Envelope and full FMU side by side; None where the device settles too slowly or swings too fast for that."""
        if not self.can_run_full:
            return None
        stays = self.stays(1.0)
        course = steps([0.0, 0.5 * self.full_scale, -0.5 * self.full_scale], stays)
        found = []
        for envelope in (True, False):
            one = self.record(3 * stays, rate=course, output_rate=100.0, envelope=envelope)
            settled = self.settled(one, stays)
            parts = [one.rate[settled & (np.sign(one.true) == sign)] for sign in (-1, 0, 1)]
            low, rest, high = (float(part.mean()) for part in parts)
            # Means over one second: the scatter of a tenth of a second, which forgets the output filter.
            noise = float(np.std([block.mean() for block in np.array_split(parts[1], 10)], ddof=1)) / 10**0.5
            found.append((rest, noise, (high - low) / self.full_scale, 2**0.5 * noise / self.full_scale))
        (bias, error, scale, scale_error), full = found[0], found[1]
        difference = Agreement(
            bias - full[0],
            float(np.hypot(error, full[1])),
            scale - full[2],
            float(np.hypot(scale_error, full[3])),
            False,
        )
        off = abs(difference.bias) > max(AGREE * self.full_scale, SURE * difference.bias_error)
        off |= abs(difference.scale_factor) > max(AGREE, SURE * difference.scale_factor_error)
        return difference._replace(agree=not off)

    @property
    def envelope(self) -> bool:
        """Whether long tests run on the envelope FMU."""
        return self.agreement is None or self.agreement.agree

    @cached_property
    def rest(self) -> list[Record]:
        """Long records at rest, one a seed."""
        least = LONG * self.typical.white_from
        longest = np.inf if self.envelope else max(FULL_AT_MOST, least)
        duration = min(max(self.plan.rest_duration, least), longest)
        return [self.record(duration, seed=seed) for seed in self.seeds(self.plan.rest_records)]

    @cached_property
    def turn_ons(self) -> list[Record]:
        """Short records at rest, one a turn-on."""
        plan = self.plan
        return [self.record(plan.turn_on_duration, seed=seed) for seed in self.seeds(plan.turn_ons)]


def steps(rates: Sequence[float], stays: float, name: str = "steps") -> Course:
    """Plateaus at ``rates`` [rad/s], each for ``stays`` [s]; the last one goes on."""
    values = np.array(rates, dtype=float)

    def at(t: Floats) -> Floats:
        # A hair before a step is the step: times are multiples of a sample.
        return values[np.clip(np.floor(t / stays + 1e-9).astype(int), 0, len(values) - 1)]

    largest = degrees(float(np.abs(values).max()))
    return Course(at, np.inf, f"{name}: {len(values)} plateaus up to {largest:.4g} deg/s", stays)


def multisine(frequencies: Floats, largest: float, seed: int) -> Course:
    """A sum of equal sines at ``frequencies`` [Hz] with phases by ``seed``, its peak at ``largest`` [rad/s]."""
    rng = np.random.default_rng(seed)
    phases = rng.uniform(0, 2 * np.pi, len(frequencies))
    turn = 2 * np.pi * frequencies

    def raw(t: Floats) -> Floats:
        return np.cos(turn[None] * t[:, None] + phases).sum(axis=1)

    period = 1 / float(frequencies.min())
    peak = float(np.abs(raw(np.arange(0, period, 0.1 / float(frequencies.max())))).max())
    # Between the points that were looked at the sum is at most 5 % higher: a tenth of a period of the fastest.
    scale = 0.95 * largest / peak
    return Course(lambda t: scale * raw(t), np.inf, f"{len(frequencies)} sines to {frequencies.max():.4g} Hz")
