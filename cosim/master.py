"""The co-simulation master: sets up plant, observer and controller for a scenario, runs the loop block by block, and gathers the result."""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Final, NamedTuple

import numpy as np
import polars as pl
from numpy.typing import NDArray

from cosim import loop
from cosim.angle import UNIT_NAMES, AngleUnit, Block, make_units
from cosim.bound import Motion, Prior, parameter_bound
from cosim.controllers.record import CONVERGED, CONVERGED_AT, FORCED, OMEGA_SQUARED, Controller
from cosim.fmu import INPUT_NAMES, OUTPUT_NAMES, Plant, open_plant
from cosim.layout import DEFECT_NAMES, ESTIMATE_NAMES, ESTIMATE_SIZE, GAIN_RATIO, KXX, M, OMEGA_Z, PARAMETER_NAMES, STATE_NAMES
from cosim.metrics import Bounds
from cosim.observers.record import INVERSE_GAP, NOISE_RMS, SENSE_GAIN_X, SENSE_GAIN_Y, SENSOR_SIZE, Observer
from cosim.scenarios import Scenario, first_estimates
from gyro_model.anatomy import Delay, Lag
from gyro_model.device import Device
from gyro_model.errors import InputError
from gyro_model.evaluate import evaluate

Floats = NDArray[np.float64]
Progress = Callable[[float, float], None]
"""Called with the time reached and the duration [s]."""

BLOCK_DURATION: Final = 0.05
"""Length of a block [s]: short enough for Ctrl-C and progress, long enough that Python's share of the time vanishes."""
START_DURATION: Final = 3e-3
"""Recorded at the full sample rate for the figure of the first convergence [s]."""
BOUND_DURATION: Final = 1.0
"""The Cramer-Rao bound is computed along the first part of a run [s]; its memory is 56 bytes a sample."""
LONG_RUN: Final = 1.0
"""Runs over this use the energy loop [s] (SYSTEM.md section 3)."""
LARGEST_STEP: Final = 5e-6
"""Internal step at most [s]: order 8 leaves 6e-12 of the amplitude after 1 s of the reference device (benchmarks/work_precision.py)."""
FINE_STEP: Final = 1e-6
"""Internal step at most where a delay or lag acts, which are resolved by it [s]."""
NOISE_FLOOR: Final = 1e-6
"""An observer is told at least this noise, as a fraction of the signal at the nominal amplitude: a filter without noise is singular."""


@dataclass(frozen=True)
class Run:
    """One run as asked for. ``device`` includes what the scenario and the user set; ``duration`` and ``sample_rate`` in s and Hz.

    ``known_gap``: the observer is told the gap of the pickoff. Raises InputError for a sample rate or duration that can't be.
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


class Result(NamedTuple):
    """What a run gives: the trace (columns of trace.parquet), its first samples at full rate, and what belongs to them."""

    trace: pl.DataFrame
    start: pl.DataFrame
    units: dict[str, AngleUnit]
    converged_at: float | None
    bounds: Bounds | None
    wall_time: float


def plant_parameters(run: Run) -> dict[str, float]:
    """The FMU parameters of a run: the device's, with the sample period, the seed and an internal step that divides the period."""
    parameters = dict(run.device.parameters)
    if "internal_step" not in parameters:
        fine = any(isinstance(e, (Delay, Lag)) and run.device.acts(e) for e in run.device.model.effects)
        largest = FINE_STEP if fine else LARGEST_STEP
        # A hair less than a whole ratio is that ratio.
        parameters["internal_step"] = run.period / np.ceil(run.period / largest - 1e-9)
    return parameters | {"sample_period": run.period, "seed": run.seed}


def first_estimate(run: Run) -> tuple[Floats, Floats]:
    """First estimates, 10 to 50 % off for the seven parameters by the seed, and their standard deviations, both shape (17,)."""
    p = run.device.all_parameters
    true = np.zeros(ESTIMATE_SIZE)
    true[KXX : M + 1] = [p[name] for name in PARAMETER_NAMES]
    true[GAIN_RATIO] = 1.0
    start = first_estimates(true, np.random.default_rng(run.seed))
    speed = run.amplitude * np.sqrt(start[KXX] / start[M])
    deviation = np.zeros(ESTIMATE_SIZE)
    deviation[: OMEGA_Z + 1] = [run.amplitude, speed, run.amplitude, speed, FIRST_RATE_DEVIATION]
    deviation[KXX : M + 1] = FIRST_RELATIVE_DEVIATION * np.abs(start[KXX : M + 1])
    volts = p["sense_gain_x"] * run.amplitude
    deviation[-len(DEFECT_NAMES) :] = [*(FIRST_OFFSET_DEVIATION * abs(volts),) * 4, FIRST_GAIN_DEVIATION]
    return start, deviation


FIRST_RATE_DEVIATION: Final = 10.0
"""What is known of the rate at the start [rad/s]."""
FIRST_RELATIVE_DEVIATION: Final = 0.3
"""Of the parameters: errors uniform on 10 to 50 % have an rms of 32 %."""
FIRST_OFFSET_DEVIATION: Final = 0.05
"""Of offset [V] and drift [V/s], as a fraction of the signal."""
FIRST_GAIN_DEVIATION: Final = 0.1
"""Of the ratio of the two gains."""


def sensor(run: Run) -> Floats:
    """What the observer is told of the sensor, see cosim.observers.record."""
    p = run.device.all_parameters
    values = np.zeros(SENSOR_SIZE)
    values[SENSE_GAIN_X], values[SENSE_GAIN_Y] = p["sense_gain_x"], p["sense_gain_y"]
    floor = NOISE_FLOOR * abs(p["sense_gain_x"]) * run.amplitude
    values[NOISE_RMS] = max(float(np.hypot(p["sense_noise"], p["adc_lsb"] / np.sqrt(12))), floor)
    values[INVERSE_GAP] = p["pickoff_inverse_gap"] if run.known_gap else 0.0
    return values


def simulate(run: Run, progress: Progress | None = None) -> Result:
    """Runs the loop. Raises InputError where the run diverges, saying when and which state, and where the FMU refuses a parameter."""
    with open_plant(plant_parameters(run), run.device.model) as plant:
        return _Recorder(run, plant).run(progress)


class _Recorder:
    """Runs the blocks of one run and keeps of each what the result needs."""

    def __init__(self, run: Run, plant: Plant) -> None:
        self.request, self.plant = run, plant
        controller = run.device.all_controller
        frequency = np.sqrt(controller["k"] / run.device.all_parameters["m"]) / (2 * np.pi)
        self.units = make_units(run.sample_rate, frequency)
        self.every = max(round(run.sample_rate / run.trace_rate), 1)
        self.traces: list[pl.DataFrame] = []
        self.start: list[pl.DataFrame] = []
        self.motion: list[tuple[Floats, Floats, Floats]] = []
        self.turned = 0.0
        self.converged_at: float | None = None
        self._angle_zero = np.nan

        settings = {**controller, "amplitude": run.amplitude, "energy_loop": float(run.duration > LONG_RUN), **run.settings}
        known = run.controller.settings
        self.controller_settings = run.controller.settings_array(**{k: v for k, v in settings.items() if k in known})
        self.controller_memory = np.zeros(run.controller.memory_size)
        run.controller.init(self.controller_memory, self.controller_settings, run.period)
        self.observer_settings = run.observer.settings_array()
        self.observer_memory = np.zeros(run.observer.memory_size)
        start, deviation = first_estimate(run)
        run.observer.init(self.observer_memory, self.observer_settings, start, deviation, sensor(run), run.period)

    def run(self, progress: Progress | None) -> Result:
        run = self.request
        size = max(round(BLOCK_DURATION * run.sample_rate / self.every), 1) * self.every
        input_values = np.zeros(len(INPUT_NAMES))
        output_values = self.plant.get(OUTPUT_NAMES)
        rows = np.empty((min(size, run.samples), loop.ROW_SIZE))
        began = time.perf_counter()
        for first in range(0, run.samples, size):
            count = min(size, run.samples - first)
            omega_z = run.scenario.omega_z(first, count, run.period)
            block = rows[:count]
            done = loop.run_block(
                self.plant.handle, self.plant.inputs, self.plant.outputs,
                run.observer.step, self.observer_memory, self.observer_settings,
                run.controller.step, self.controller_memory, self.controller_settings,
                first, run.period, omega_z, input_values, output_values, block,
            )  # fmt: skip
            if done < count:
                raise InputError(f"run stopped at {(first + done) * run.period:.6g} s: {self.plant.complaint()}")
            self._keep(first, block, omega_z)
            if progress is not None:
                progress((first + count) * run.period, run.duration)
        wall_time = time.perf_counter() - began
        trace, start = pl.concat(self.traces), pl.concat(self.start)
        return Result(trace, start, self.units, self.converged_at, self._bounds(), wall_time)

    def _keep(self, first: int, rows: Floats, omega_z: Floats) -> None:
        run = self.request
        index = np.arange(first, first + len(rows))
        t = index * run.period
        estimate = rows[:, loop.ESTIMATE : loop.DEVIATION]
        if not np.isfinite(estimate).all():
            row, column = np.argwhere(~np.isfinite(estimate))[0]
            raise InputError(
                f"run diverged at {t[row]:.6g} s: the estimate of {ESTIMATE_NAMES[column]} is not finite; "
                "check the device and the sample rate"
            )
        control = rows[:, loop.CONTROL : loop.PLANT]
        true_states = rows[:, loop.PLANT + 2 : loop.ROW_SIZE]
        converged = control[:, CONVERGED] > 0
        if self.converged_at is None and converged.any():
            self.converged_at = float(control[converged.argmax(), CONVERGED_AT])
        turned = self.turned + np.concatenate(([0.0], np.cumsum(omega_z))) * run.period
        self.turned = float(turned[-1])
        if np.isnan(self._angle_zero) and converged.any():
            self._angle_zero = float(turned[converged.argmax()])
        angle_true = np.where(converged, turned[:-1] - self._angle_zero, np.nan)

        states = np.ascontiguousarray(estimate[:, : len(STATE_NAMES)].T)
        block = Block(
            t, *states, forced=np.ascontiguousarray(control[:, FORCED:OMEGA_SQUARED].T),
            omega_squared=np.ascontiguousarray(control[:, OMEGA_SQUARED]), converged=converged,
            lambda_=run.device.all_parameters.get("angular_gain", 1.0),
        )  # fmt: skip
        angles = {name: unit.process(block) for name, unit in self.units.items()}
        if first * run.period < START_DURATION:
            self.start.append(_start_frame(t, true_states, estimate)[: round(START_DURATION * run.sample_rate)])
        if first * run.period < BOUND_DURATION:
            self.motion.append((true_states.copy(), control[:, :2].copy(), omega_z))
        kept = slice(-first % self.every, None, self.every)
        self.traces.append(self._trace(kept, t, rows, omega_z, angle_true, angles))

    def _trace(
        self, kept: slice, t: Floats, rows: Floats, omega_z: Floats, angle_true: Floats, angles: dict[str, tuple[Floats, Floats]]
    ) -> pl.DataFrame:
        run = self.request
        chosen = angles[run.scenario.angle_unit]
        estimate = rows[kept, loop.ESTIMATE : loop.DEVIATION]
        control = rows[kept, loop.CONTROL : loop.PLANT]
        plant = rows[kept, loop.PLANT :]
        true = true_parameters(run.device, t[kept])
        columns = {
            "t": t[kept],
            "omega_true": omega_z[kept],
            "angle_true": angle_true[kept],
            "angle": chosen[0][kept],
            "angle_quality": chosen[1][kept],
            "converged": control[:, CONVERGED] > 0,
            "v_x": plant[:, 0],
            "v_y": plant[:, 1],
            "u_x": control[:, 0],
            "u_y": control[:, 1],
            **{f"est_{name}": estimate[:, KXX + i] for i, name in enumerate(PARAMETER_NAMES)},
            "est_omega_z": estimate[:, OMEGA_Z],
            **{f"true_{name}": true[name] for name in PARAMETER_NAMES},
            **{f"est_{name}": estimate[:, i] for i, name in enumerate(STATE_NAMES)},
            **{f"est_{name}": estimate[:, M + 1 + i] for i, name in enumerate(DEFECT_NAMES)},
            **{f"angle_{name}": angles[name][0][kept] for name in UNIT_NAMES},
        }
        return pl.DataFrame({name: np.ascontiguousarray(column) for name, column in columns.items()})

    def _bounds(self) -> Bounds | None:
        """The bound along the first part of the run; None where more acts than the nominal device and white noise."""
        run = self.request
        if any(run.device.acts(e) for e in run.device.model.effects if not e.nominal and e.id != "sense_noise"):
            return None
        p = run.device.all_parameters
        noise = p["sense_noise"]
        states, forces, omega_z = (np.concatenate(parts) for parts in zip(*self.motion, strict=True))
        last = (len(omega_z) - 1) * run.period
        if noise == 0 or last < 1e-3:
            return None
        motion = Motion(states, forces, omega_z, np.array([p[name] for name in PARAMETER_NAMES]), run.period)
        times = np.geomspace(1e-3, last, 60)
        prior = Prior(omega_walk=OMEGA_WALK, amplitude=run.amplitude)
        relative, omega = parameter_bound(motion, (noise / abs(p["sense_gain_x"]), noise / abs(p["sense_gain_y"])), times, prior)
        return Bounds(times, relative, omega)


OMEGA_WALK: Final = 10.0
"""Prior of the bound: the rate is a random walk of this size [rad/s per sqrt(s)]; a 10 Hz square wave of 5 rad/s changes by 10 rad/s twenty
times a second, 45 rad/s per sqrt(s), but rests in between."""


def true_parameters(device: Device, t: Floats) -> dict[str, Floats]:
    """The seven parameters that act at times ``t`` [s], shape (n,) each: the device's, under its parameter laws."""
    values = device.all_parameters
    result = {name: np.full(len(t), values[name]) for name in PARAMETER_NAMES}
    for law in device.model.laws:
        if device.acts(law):
            after = (t >= values[law.event.name]).astype(float) if law.event is not None else np.zeros(len(t))
            for name, value in evaluate(law, {**values, **result, "t": t, "after": after}).items():
                if name in result:
                    result[name] = np.broadcast_to(value, t.shape)
    return result


def _start_frame(t: Floats, true: Floats, estimate: Floats) -> pl.DataFrame:
    columns = {"t": t}
    columns |= {f"true_{name}": true[:, i] for i, name in enumerate(STATE_NAMES)}
    columns |= {f"est_{name}": estimate[:, i] for i, name in enumerate(STATE_NAMES)}
    return pl.DataFrame({name: np.ascontiguousarray(column) for name, column in columns.items()})


