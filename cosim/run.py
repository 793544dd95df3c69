"""A run as asked for, and what follows from it before the first sample."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import NDArray

from cosim.controllers.record import Controller
from cosim.layout import DEFECT_NAMES, ESTIMATE_SIZE, GAIN_RATIO, KXX, OMEGA_Z, PARAMETER_NAMES, M
from cosim.observers.record import INVERSE_GAP, NOISE_RMS, SENSE_GAIN_X, SENSE_GAIN_Y, SENSOR_SIZE, Observer
from cosim.scenarios import Scenario, first_estimates
from gyro_model.anatomy import Delay, Lag
from gyro_model.device import Device
from gyro_model.errors import InputError, nearest

Floats = NDArray[np.float64]

LONG_RUN: Final = 1.0
"""Runs over this use the energy loop [s] (SYSTEM.md section 3)."""
LARGEST_STEP: Final = 5e-6
"""Internal step at most [s]: order 8 leaves 6e-11 rad after 1 s of the reference device, see benchmarks/."""
FINE_STEP: Final = 1e-6
"""Internal step at most where a delay or lag acts, which are resolved by it [s]."""

NOISE_FLOOR: Final = 1e-6
"""An observer is told at least this noise, as a fraction of the signal: a filter without noise is singular."""
FIRST_RATE_DEVIATION: Final = 10.0
"""What is known of the rate at the start [rad/s]."""
FIRST_RELATIVE_DEVIATION: Final = 0.3
"""Of the parameters: errors uniform on 10 to 50 % have an rms of 32 %."""
FIRST_OFFSET_DEVIATION: Final = 0.05
"""Of offset [V] and drift [V/s], as a fraction of the signal."""
FIRST_GAIN_DEVIATION: Final = 0.1
"""Of the ratio of the two gains."""


@dataclass(frozen=True)
class Run:
    """One run. ``device`` includes what the scenario and the user set; ``duration`` in s, rates in Hz.

    ``known_gap``: the observer is told the gap of the pickoff; ``settings``: of the controller, by name. Raises
    InputError for a sample rate, duration or setting that can't be.
    """

    scenario: Scenario
    device: Device
    observer: Observer
    controller: Controller
    sample_rate: float = 200e3
    duration: float = 1.0
    seed: int = 0
    known_gap: bool = False
    trace_rate: float = 20e3
    settings: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not 1e3 <= self.sample_rate <= 1e7:
            raise InputError(f"sample rate {self.sample_rate:g} Hz: give one from 1e3 to 1e7 Hz")
        if not 1e-3 <= self.duration < 1e5:
            raise InputError(f"duration {self.duration:g} s: give one from 1e-3 to 1e5 s")
        for name in self.settings:
            if name not in self.controller.settings:
                raise InputError(f"controller setting {name!r} is unknown{nearest(name, self.controller.settings)}")

    @property
    def period(self) -> float:
        """Sample period [s]."""
        return 1.0 / self.sample_rate

    @property
    def samples(self) -> int:
        """Number of samples."""
        return round(self.duration * self.sample_rate)

    @property
    def amplitude(self) -> float:
        """Amplitude that the controller holds [m]: that of the start."""
        p = self.device.all_parameters
        return float(np.hypot(p["x_start"], p["y_start"])) or 1e-6

    @property
    def oscillation_hz(self) -> float:
        """Frequency of the isotropic oscillator that the controller makes of the device, sqrt(k/m)/2pi."""
        return float(np.sqrt(self.device.all_controller["k"] / self.device.all_parameters["m"]) / (2 * np.pi))

    def plant_parameters(self) -> dict[str, float]:
        """The FMU parameters: the device's, sample period, seed, and an internal step that divides the period."""
        return plant_parameters(self.device, self.period, self.seed)

    def controller_settings(self) -> Floats:
        """Settings of the controller as it takes them: the device's [controller], then what the user set."""
        device = {**self.device.all_controller, "amplitude": self.amplitude}
        device["energy_loop"] = float(self.duration > LONG_RUN)
        known = {name: value for name, value in device.items() if name in self.controller.settings}
        return self.controller.settings_array(**{**known, **self.settings})

    def first_estimate(self) -> tuple[Floats, Floats]:
        """First estimates and their standard deviations, both shape (17,), in the order of cosim.layout.

        The seven parameters are 10 to 50 % off, drawn by the seed; states and rate are zero.
        """
        p = self.device.all_parameters
        true = np.zeros(ESTIMATE_SIZE)
        true[KXX : M + 1] = [p[name] for name in PARAMETER_NAMES]
        true[GAIN_RATIO] = 1.0
        start = first_estimates(true, np.random.default_rng(self.seed))
        speed = self.amplitude * np.sqrt(start[KXX] / start[M])
        offset = FIRST_OFFSET_DEVIATION * abs(p["sense_gain_x"]) * self.amplitude
        deviation = np.zeros(ESTIMATE_SIZE)
        deviation[:OMEGA_Z] = [self.amplitude, speed, self.amplitude, speed]
        deviation[OMEGA_Z] = FIRST_RATE_DEVIATION
        deviation[KXX : M + 1] = FIRST_RELATIVE_DEVIATION * np.abs(start[KXX : M + 1])
        deviation[-len(DEFECT_NAMES) :] = [offset, offset, offset, offset, FIRST_GAIN_DEVIATION]
        return start, deviation

    def sensor(self) -> Floats:
        """What the observer is told of the sensor, see cosim.observers.record."""
        p = self.device.all_parameters
        values = np.zeros(SENSOR_SIZE)
        values[SENSE_GAIN_X], values[SENSE_GAIN_Y] = p["sense_gain_x"], p["sense_gain_y"]
        floor = NOISE_FLOOR * abs(p["sense_gain_x"]) * self.amplitude
        # A converter that rounds adds lsb^2/12.
        values[NOISE_RMS] = max(float(np.hypot(p["sense_noise"], p["adc_lsb"] / np.sqrt(12))), floor)
        values[INVERSE_GAP] = p["pickoff_inverse_gap"] if self.known_gap else 0.0
        return values


def plant_parameters(device: Device, period: float, seed: int) -> dict[str, float]:
    """Parameters of the FMU of ``device`` at the sample period ``period`` [s], with an internal step that divides it
    where the device names none."""
    parameters = dict(device.parameters)
    if "internal_step" not in parameters:
        fine = any(isinstance(e, (Delay, Lag)) and device.acts(e) for e in device.model.effects)
        # A hair more than a whole ratio is that ratio.
        steps = np.ceil(period / (FINE_STEP if fine else LARGEST_STEP) - 1e-9)
        parameters["internal_step"] = period / float(steps)
    return parameters | {"sample_period": period, "seed": float(seed)}
