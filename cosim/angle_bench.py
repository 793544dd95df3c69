"""A test bench for whole-angle mode: one gyroscope turned on again and again, and the rates that it goes through."""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cosim.angle_record import AngleRecord, angle_record
from cosim.design import DEFAULT_AMPLITUDE, Design, chosen_design
from cosim.master import simulate
from cosim.rate.settings import settings_of
from cosim.registry import find_controller, find_observer
from cosim.run import Run
from cosim.scenarios import Constant, Scenario, steps
from gyro_model.device import Device

Floats = NDArray[np.float64]

ROWS: Final = 1000.0
"""Rows of a record a second [Hz]."""


class AnglePlan(NamedTuple):
    """How much is measured: rest_records of rest_duration [s]; spin of spin_duration [s] at spin_rate [rad/s]; steps of
    the rate to either side, plateau [s] each."""

    rest_records: int
    rest_duration: float
    spin_duration: float
    spin_rate: float
    steps: int
    plateau: float


WHOLE: Final = AnglePlan(3, 20.0, 12.0, 3.0, 5, 1.5)
QUICK: Final = AnglePlan(2, 4.0, 4.0, 3.0, 2, 0.5)


@dataclass(frozen=True)
class AngleBench:
    """A device on the bench.

    design: all that its loop may know, by name, None: what goes with the device; seed: of the first turn-on, each next
    one has the next seed; advance: called with the simulated time of every record that is done [s].
    """

    device: Device
    design: str | Design | None = None
    seed: int = 1
    plan: AnglePlan = WHOLE
    advance: Callable[[float], None] = field(default=lambda seconds: None)

    @property
    def full_scale(self) -> float:
        """Full scale [rad/s]."""
        return settings_of(self.device).full_scale

    def seeds(self, count: int) -> range:
        """Seeds of so many turn-ons."""
        return range(self.seed, self.seed + count)

    def run(self, scenario: Scenario, seed: int) -> Run:
        """A run through ``scenario``."""
        start = {"x_start": DEFAULT_AMPLITUDE, **self.device.parameters}
        device = self.device.with_parameters(start)
        return Run(
            scenario=scenario,
            device=device,
            design=chosen_design(self.design, device, seed),
            observer=find_observer("ekf"),
            controller=find_controller("foucault"),
            duration=scenario.duration,
            seed=seed,
            trace_rate=ROWS,
        )

    def record(self, duration: float, rate: Scenario | None = None, seed: int | None = None) -> AngleRecord:
        """A record of ``duration`` [s], at rest where no ``rate`` is given."""
        scenario = rate or Scenario("rest", "at rest", duration)
        run = self.run(scenario, self.seed if seed is None else seed)
        result = simulate(run)
        self.advance(duration)
        return angle_record(run, result)

    @cached_property
    def rest(self) -> list[AngleRecord]:
        """Records at rest, one a seed."""
        return [self.record(self.plan.rest_duration, seed=seed) for seed in self.seeds(self.plan.rest_records)]

    @property
    def refusal(self) -> str:
        """Why the tests can't be done; empty where they can: the angle is valid in every record at rest."""
        return next((f"no valid angle: {one.reason}" for one in self.rest if one.valid_at is None), "")


def spinning(rate: float, duration: float) -> Scenario:
    """A constant ``rate`` [rad/s] for ``duration`` [s]."""
    return Scenario("spin", f"constant rate of {rate:g} rad/s", duration, {"omega_z": (Constant(rate),)})


def stairs(rates: Floats, stays: float) -> Scenario:
    """Plateaus at ``rates`` [rad/s], shape (n,), ``stays`` [s] each."""
    times = stays * np.arange(len(rates), dtype=float)
    return Scenario("staircase", "plateaus of the rate", stays * len(rates), {"omega_z": (steps(times, rates),)})
