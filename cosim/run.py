"""A run as asked for, and what follows from it before the first sample."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import NDArray

from cosim.controllers.record import Controller, CoreController
from cosim.core.settings import TONES
from cosim.design import Design
from cosim.monitor import MONITOR
from cosim.observers.record import CoreObserver, Observer
from cosim.scenarios import Scenario
from cosim.setting import complete
from gyro_model.device import Device
from gyro_model.errors import InputError

Floats = NDArray[np.float64]

LONG_RUN: Final = 1.0
"""Runs over this use the energy loop [s]: damping that is a little wrong lets the energy wander."""
LARGEST_STEP: Final = 5e-6
"""Internal step at most [s]: order 8 leaves 6e-11 rad after 1 s of the reference device, see benchmarks/."""
TRACE_RATE: Final = 20e3
"""Rows of a trace a second, where it would not grow beyond TRACE_ROWS."""
TRACE_ROWS: Final = 600_000
"""About 200 MB of columns."""


@dataclass(frozen=True)
class Run:
    """One run. ``device`` is what the plant is, with what the scenario and the user set; ``design`` is all that the
    loop knows. ``duration`` in s, rates in Hz; ``settings`` of observer, controller and monitor, by part and name.

    Raises InputError for a sample rate, duration or setting that can't be.
    """

    scenario: Scenario
    device: Device
    design: Design
    observer: Observer | CoreObserver
    controller: Controller | CoreController
    sample_rate: float = 200e3
    duration: float = 1.0
    seed: int = 0
    trace_rate: float | None = None
    settings: Mapping[str, Mapping[str, float]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not 1e3 <= self.sample_rate <= 1e7:
            raise InputError(f"sample rate {self.sample_rate:g} Hz: give one from 1e3 to 1e7 Hz")
        check_clock(self.device, self.sample_rate, self.seed)
        if not 1e-3 <= self.duration < 1e5:
            raise InputError(f"duration {self.duration:g} s: give one from 1e-3 to 1e5 s")
        if self.trace_rate is not None and not 0 < self.trace_rate <= self.sample_rate:
            raise InputError(
                f"trace rate {self.trace_rate:g} Hz: give one up to the sample rate {self.sample_rate:g} Hz"
            )
        for name in ("sense_gain_x", "sense_gain_y"):
            if not self.design.all_values[name]:
                raise InputError(f"{name} = 0 V/m: the loop sees the motion by it; give another gain")
        if isinstance(self.controller, CoreController):
            self.controller.settings_array(self.sample_rate, **self.controller_settings())
        else:
            self.controller.settings_array(**self.controller_settings())
        self.observer.settings_array(**self.observer_settings())
        self.monitor_settings()

    def _of(self, part: str) -> dict[str, float]:
        return dict(self.settings.get(part, {}))

    @property
    def period(self) -> float:
        """Sample period [s]."""
        return 1.0 / self.sample_rate

    @property
    def samples(self) -> int:
        """Number of samples."""
        return round(self.duration * self.sample_rate)

    @property
    def trace_every(self) -> int:
        """Samples from one row of the trace to the next."""
        rate = self.trace_rate or min(TRACE_RATE, TRACE_ROWS / self.duration)
        return max(round(self.sample_rate / rate), 1)

    @property
    def stiffness(self) -> float:
        """Stiffness of the isotropic oscillator that the controller makes of the device [N/m]: what the user set, or
        the design's."""
        return float(self._of("controller").get("k", self.design.stiffness))

    @property
    def oscillation_hz(self) -> float:
        """Its frequency, as far as the nominal mass tells."""
        return float(np.sqrt(max(self.stiffness, 0.0) / self.design.values["m"]) / (2 * np.pi))

    def plant_parameters(self) -> dict[str, float]:
        """The FMU parameters: the device's, sample period, seed, and an internal step that divides the period."""
        return plant_parameters(self.device, self.period, self.seed)

    def observer_settings(self) -> dict[str, float]:
        """What the user set of the observer."""
        return self._of("observer")

    def controller_settings(self) -> dict[str, float]:
        """Settings of the controller: from the design, then what the user set."""
        told: dict[str, float] = {
            "k": self.stiffness,
            "amplitude": self.design.amplitude,
            "tone_amplitude": TONE_DEFLECTION * self.stiffness,
            "energy_loop": float(self.duration > LONG_RUN),
            "first_frequency": self.oscillation_hz,
            **self.design.controller,
        }
        known = {name: value for name, value in told.items() if name in self.controller.settings}
        return known | self._of("controller")

    def told_tones(self) -> tuple[float, ...]:
        """Frequencies of the tones that do not go with the loop's own [Hz]."""
        if not isinstance(self.controller, CoreController):
            return ()
        told = complete(self.controller.name, self.controller.settings, self.controller_settings())
        return tuple(told[name] for name, pair in TONES.items() if told[name] and told[f"{pair}_amplitude"])

    def monitor_settings(self) -> dict[str, float]:
        """Settings of the monitor: from the design, then what the user set. Raises InputError for an unknown name, and
        for a value that can't be."""
        return complete("monitor", MONITOR, {**self.design.monitor, **self._of("monitor")})


TONE_DEFLECTION: Final = 0.5e-6
"""Static deflection that a tone's amplitude makes of the isotropic oscillator [m]: the reference device's 32 uN."""


def sample_rate_of(device: Device, asked: float | None = None) -> float:
    """Samples a second of a run: as ``asked``, by default those of the device's `sample_period`."""
    # Twelve digits: one over 5e-6 is a rounding below 200 kHz.
    return asked if asked is not None else float(f"{1 / device.all_parameters['sample_period']:.12g}")


def check_clock(device: Device, sample_rate: float, seed: int) -> None:
    """Raises InputError where the device says other samples [Hz] or another seed than the run, which decides."""
    period = device.parameters.get("sample_period")
    # Twelve digits of either are the same clock.
    if period is not None and abs(period * sample_rate - 1) > 1e-11:
        raise InputError(
            f"sample_period = {period:g} s: the run takes {sample_rate:g} samples a second; "
            f"give --sample-rate {1 / period:g} instead"
        )
    own = device.parameters.get("seed")
    if own is not None and own != seed:
        raise InputError(f"seed = {own:g}: the run has seed {seed}; give --seed {own:g} instead")


def plant_parameters(device: Device, period: float, seed: int) -> dict[str, float]:
    """Parameters of the FMU of ``device`` at the sample period ``period`` [s], with an internal step that divides it
    where the device names none."""
    parameters = dict(device.parameters)
    if "internal_step" not in parameters:
        # A hair more than a whole ratio is that ratio.
        steps = np.ceil(period / LARGEST_STEP - 1e-9)
        parameters["internal_step"] = period / float(steps)
    return parameters | {"sample_period": period, "seed": float(seed)}
