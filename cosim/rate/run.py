"""A rate-mode run as asked for, and what follows from it before the first sample."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from math import ceil, pi
from typing import Final

import numpy as np
from numpy.typing import NDArray

from cosim.rate.allan import DECAYS, MEMORIES
from cosim.rate.courses import Course, check_jumps, check_rate
from cosim.rate.filters import delay
from cosim.rate.loop import Blocks
from cosim.rate.sense_record import check_sense_record
from cosim.rate.settings import Nominal, Settings, at_bias, blocks_for, nominal, settings_of
from cosim.run import check_clock, plant_parameters
from cosim.scenarios.scenario import INPUT_NAMES, QUANTITIES
from gyro_model.device import Device
from gyro_model.errors import InputError

Floats = NDArray[np.float64]

OMEGA_Z, TEMPERATURE, V_BIAS = (INPUT_NAMES.index(name) for name in ("omega_z", "temperature", "v_bias"))
ENVELOPE_PERIOD: Final = 1e-3
"""Step of the slow loops on the envelope at most [s]: a twentieth of a period of a split of 50 Hz, a fiftieth of the
phase loop's."""
CLEAR: Final = 0.4
"""The split times the step of the envelope at most. Beyond 1/2 thermal noise about the split folds back: at 2000 Hz in
steps of 1 ms onto rest, where it quadruples the angle random walk."""
LONGEST_SETTLING: Final = 60.0
"""The full FMU is not run up for longer than this [s]: some 20 s of computing."""
LARGEST_SWING: Final = 1e-2
"""No micromachined mass swings by a centimetre [m]: the amplitude was meant in µm."""
SAMPLES: Final = 8
"""Samples in a period of the drive, at least."""
SETTLED: Final = 12.0
"""Time constants until settled: e^-12 = 6e-6 of a start or step is left."""


@dataclass(frozen=True)
class RateRun:
    """One run of rate mode; ``envelope``: on the envelope form of the plant, else on the full FMU.

    rate [rad/s], temperature [K]: what the package goes through, from the time on at which the loops have settled;
    closed: the sense loop rebalances; sample_rate, output_rate [Hz]; duration [s]; sense_rate: of a record of the sense
    voltage [Hz], None for none; design: what loops and calibration know of the device, None: all of it; others: further
    inputs of the plant by name, SI; envelope_period: step of the loops on the envelope [s], None: as the split asks.

    Raises InputError for what can't be, a course shorter than the run, a rate beyond full scale, a temperature that
    jumps, and a record that could not show the split.
    """

    device: Device
    rate: Course
    temperature: Course
    closed: bool
    duration: float
    seed: int = 0
    sample_rate: float = 200e3
    output_rate: float = 100.0
    envelope: bool = False
    sense_rate: float | None = None
    design: Device | None = None
    others: Mapping[str, Course] = field(default_factory=dict)
    envelope_period: float | None = None

    def __post_init__(self) -> None:
        if self.settings.drive_amplitude > LARGEST_SWING:
            raise InputError(f"rate_mode drive_amplitude = {self.settings.drive_amplitude:g} m: in m; 4 µm are 4e-6")
        if not 1 <= self.output_rate <= 1e4:
            raise InputError(f"output rate {self.output_rate:g} Hz: give one from 1 to 1e4 Hz")
        if not 1e3 <= self.sample_rate <= 1e8:
            raise InputError(f"sample rate {self.sample_rate:g} Hz: give one from 1e3 to 1e8 Hz")
        check_clock(self.device, self.sample_rate, self.seed)
        if not self.duration < 1e6 or self.rows < 1:
            raise InputError(f"duration {self.duration:g} s: give one from {1 / self.output_rate:g} to 1e6 s")
        if self.settings.demodulator_bandwidth > 0.25 * self.nominal.calibration.frequency:
            raise InputError(
                f"rate_mode demodulator_bandwidth = {self.settings.demodulator_bandwidth:g} Hz: give less than a "
                f"quarter of the drive frequency, {self.nominal.calibration.frequency:.6g} Hz"
            )
        if self.sample_rate < SAMPLES * self.nominal.calibration.frequency:
            raise InputError(
                f"sample rate {self.sample_rate:g} Hz: give {SAMPLES} times the drive frequency of "
                f"{self.nominal.calibration.frequency:.6g} Hz or more"
            )
        if self.duration > self.rate.length + 1e-9:
            raise InputError(
                f"duration {self.duration:g} s: rate profile {self.rate.text} lasts {self.rate.length:.6g} s; "
                "shorten --duration to that"
            )
        if self.rate.stays < self.settling + 10 * self.interval:
            raise InputError(
                f"rate step stays {self.rate.stays:.4g} s: the output needs {self.settling:.3g} s to settle; "
                f"give a --rate-period of {8 * (self.settling + 10 * self.interval):.2g} s or more"
            )
        if not self.envelope and self.settling > LONGEST_SETTLING:
            raise InputError(
                f"device {self.device.name} settles in {self.settling:.4g} s, too long for the full FMU: "
                "give --plant envelope, or a lower Q"
            )
        check_rate(self.rate, self.duration, self.interval, self.settings.full_scale)
        check_jumps(self.temperature, self.duration, self.interval)
        if self.sense_rate is not None:
            check_sense_record(self.sense_rate, 1 / self.period, self.nominal, self.closed)

    @cached_property
    def settings(self) -> Settings:
        """The [rate_mode] of what is known, completed."""
        return settings_of(self.design or self.device)

    @cached_property
    def nominal(self) -> Nominal:
        """What the loops are designed for."""
        return nominal(self.known, self.settings, self.closed)

    @property
    def known(self) -> Device:
        """What loops and calibration are made from, at the first bias voltage."""
        return at_bias(self.design or self.device, float(self.first_inputs[V_BIAS]), self.settings.drive_amplitude)

    @cached_property
    def courses(self) -> Mapping[str, Course | None]:
        """All inputs of the plant beside the forces, in the order of INPUT_NAMES; None: the FMU's start value."""
        given = {"omega_z": self.rate, "temperature": self.temperature, **self.others}
        return {name: given.get(name) for name in INPUT_NAMES}

    def inputs(self, first: int, count: int) -> Floats:
        """Values held over ``count`` samples from ``first`` on, SI, shape (count, 5), in the order of INPUT_NAMES."""
        held = np.empty((count, len(INPUT_NAMES)))
        for column, (name, course) in enumerate(self.courses.items()):
            held[:, column] = QUANTITIES[name].start if course is None else course.held(first, count, self.period)
        return held

    @cached_property
    def first_inputs(self) -> Floats:
        """The values at the start, shape (5,)."""
        start = [QUANTITIES[name].start if c is None else c.values(np.zeros(1))[0] for name, c in self.courses.items()]
        return np.array(start)

    @property
    def held(self) -> dict[str, float]:
        """What the inputs other than rate and temperature are at the start, by name, SI."""
        return {name: float(self.first_inputs[INPUT_NAMES.index(name)]) for name in self.others}

    @property
    def period(self) -> float:
        """Period of the loops [s]: of the converter, or of the envelope."""
        if not self.envelope:
            return 1 / self.sample_rate
        split = abs(self.nominal.pole.imag) / (2 * pi)
        # A whole part of the longest, so that rows stay as long as they were.
        return self.envelope_period or ENVELOPE_PERIOD / max(ceil(split * ENVELOPE_PERIOD / CLEAR), 1)

    @property
    def per_row(self) -> int:
        """Samples in a row of the record."""
        return max(round(1 / (self.period * self.output_rate)), 1)

    @property
    def interval(self) -> float:
        """Time between rows [s]."""
        return self.per_row * self.period

    @property
    def rows(self) -> int:
        """Rows of the record."""
        return round(self.duration / self.interval)

    @property
    def settling(self) -> float:
        """Time after which a step of the rate, or the start of the loops, is no longer seen [s]."""
        sense = 1 / max(-self.nominal.pole.real, 1e-9)
        closed = 1 / (2 * pi * self.settings.sense_bandwidth) if self.closed else 0.0
        filters = delay(self.settings.output_bandwidth) + delay(self.settings.demodulator_bandwidth)
        return max(self.drive_settling, SETTLED * max(sense, closed, filters))

    @property
    def drive_settling(self) -> float:
        """Time after which the drive loop has caught up with a change [s]."""
        slowest = min(self.settings.phase_bandwidth, self.settings.amplitude_bandwidth)
        return SETTLED * 2**0.5 / (2 * pi * slowest)

    @property
    def delay(self) -> float:
        """How much the output filter and the sense axis delay slow rates [s]: a closed loop by its bandwidth, an open
        one by γ/(Δ² + γ²), the slope of its phase at rest (transfer.py)."""
        pole = self.nominal.pole
        axis = 1 / (2 * pi * self.settings.sense_bandwidth) if self.closed else -pole.real / max(abs(pole) ** 2, 1e-18)
        return delay(self.settings.output_bandwidth) + axis

    @property
    def white_from(self) -> float:
        """Averaging time from which on noise at rest is white, past filters and the ringing of the sense axis [s]."""
        ringing = 0.0 if self.closed else DECAYS / max(-self.nominal.pole.real, 1e-9)
        return max(MEMORIES * self.delay, ringing)

    def blocks(self) -> Blocks:
        """The blocks of the loops."""
        return blocks_for(self.settings, self.nominal, self.period, 0.0 if self.envelope else self.period)

    def plant_parameters(self) -> dict[str, float]:
        """Parameters of the FMU; the loops start it up from wherever the device file lets it begin."""
        return plant_parameters(self.device, 1 / self.sample_rate, self.seed)
