"""Runs rate mode: starts the loops up, watches their lock, and keeps a row an output interval."""

from collections.abc import Mapping, Sequence
from typing import Any, Final, NamedTuple

import numpy as np
import polars as pl
from numpy.typing import NDArray

from cosim.envelope import open_envelope
from cosim.fmu import Plant, open_plant
from cosim.rate import loop
from cosim.rate.kept import Keeper
from cosim.rate.run import OMEGA_Z, TEMPERATURE, RateRun
from cosim.rate.sense_record import SenseRecorder
from cosim.rate.temperature_sensor import BoardSensor, Bridge
from cosim.scenarios.scenario import INPUT_NAMES
from gyro_model.errors import InputError
from gyro_model.progress import Progress

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

BLOCK_ROWS: Final = 10
"""Rows of the record in a call of the compiled loop: short enough for Ctrl-C and progress."""
LOCKED_ERROR: Final = 0.05
"""In lock the phase error is below this [rad]: far above noise, far below what a ramp in use needs."""
LOCKED_AMPLITUDE: Final = 0.02
"""In lock the amplitude is within this of the set one, relative."""
LOST_ERROR: Final = 0.5
"""Beyond this phase error [rad], or relative error of the amplitude, lock is lost: half a radian turns half of the
quadrature into rate."""
PATIENCE: Final = 20.0
"""The loops may take this many settling times to lock."""


class Result(NamedTuple):
    """What a run gives.

    record: columns as in the contract of ``record_frame``; locked_at: from power on until lock [s]; started_at: until
    the record's t = 0 [s]; sense: record of the sense voltage (``SenseRecorder.frame``) where the run asks for one.
    """

    record: pl.DataFrame
    locked_at: float
    started_at: float
    sense: pl.DataFrame | None


class LoopedPlant:
    """A plant in the compiled loop that fits it, full or envelope, to be used as a context manager."""

    def __init__(self, run: RateRun) -> None:
        # The structure starts at the temperature at which the run does.
        parameters = run.plant_parameters() | {"temperature": float(run.first_inputs[TEMPERATURE])}
        forces: Sequence[str] = loop.FORCE_NAMES
        outputs: Sequence[str] = loop.OUTPUT_NAMES
        self._run_rows = loop.run_rows
        if run.envelope:
            parameters |= {name: run.device.all_parameters[name] for name in ("kxx", "m")}
            carrier = run.nominal.calibration.frequency
            self._plant: Plant = open_envelope(parameters, run.period, carrier, run.device.model)
            forces, outputs = loop.ENVELOPE_FORCE_NAMES, loop.ENVELOPE_OUTPUT_NAMES
            self._run_rows = loop.run_envelope_rows
        else:
            self._plant = open_plant(parameters, run.device.model)
        self.blocks = run.blocks()
        """May be replaced between two steps."""
        self._state = loop.start_state(self.blocks)
        self._inputs, self._outputs = map(self._plant.value_references, ((*forces, *INPUT_NAMES), outputs))
        self._values = self._plant.get(outputs)
        self._period = run.period
        self._done = 0

    def __enter__(self) -> "LoopedPlant":
        return self

    def __exit__(self, *exception: object) -> None:
        self._plant.close()

    def step(self, held: Floats, rows: int) -> tuple[Floats, Complexes]:
        """Runs the samples over which the scenario's inputs are ``held``, shape (n, 5); gives their rows, shape
        (rows, ROW_SIZE), and v_y mixed with the drive, its frequency and the force on y [V, rad/s, N], shape (3, n).

        Raises InputError where the plant can't go on.
        """
        result = np.empty((rows, loop.ROW_SIZE))
        sensed = np.empty((3, len(held)), complex)
        done = self._run_rows(
            self._plant.handle, self._inputs, self._outputs, self.blocks, self._state, self._done, self._period,
            held, self._values, result, sensed,
        )  # fmt: skip
        self._done += done
        if done < len(held):
            raise InputError(f"run {self._plant.complaint()}")
        return result, sensed

    def kept(self) -> dict[str, NDArray[Any]]:
        """The whole state of plant and loops but their ``blocks``."""
        fmu = np.frombuffer(self._plant.saved(), np.uint8)
        return {"fmu": fmu, "loop": self._state, "values": self._values, "samples": np.array([self._done])}

    def go_on(self, kept: Mapping[str, NDArray[Any]]) -> None:
        """Takes the state that ``kept`` gave. Raises InputError where the FMU refuses it."""
        self._plant.restore(kept["fmu"].tobytes())
        self._state[:], self._values[:], self._done = kept["loop"], kept["values"], int(kept["samples"][0])


class Collected:
    """What a run has given after ``done`` rows. times: until lock and until t = 0 [s]; rows, shape (n, ROW_SIZE); held:
    the inputs' means over them, shape (n, 5); recorder: of the sense voltage, where the run asks for one."""

    def __init__(self, run: RateRun) -> None:
        self.done = 0
        self.times = np.zeros(2)
        self.rows = np.empty((run.rows, loop.ROW_SIZE))
        self.held = np.empty((run.rows, len(INPUT_NAMES)))
        self.recorder = None if run.sense_rate is None else SenseRecorder(run.period, run.sense_rate)

    def kept(self) -> dict[str, NDArray[Any]]:
        """All of it as arrays."""
        sensed = {} if self.recorder is None else self.recorder.kept()
        return {"times": self.times, "rows": self.rows[: self.done], "held": self.held[: self.done], **sensed}

    def go_on(self, kept: Mapping[str, NDArray[Any]]) -> None:
        """Becomes what gave ``kept``."""
        self.done = len(kept["rows"])
        self.times[:], self.rows[: self.done], self.held[: self.done] = kept["times"], kept["rows"], kept["held"]
        if self.recorder is not None:
            self.recorder.go_on(kept)


def simulate(run: RateRun, progress: Progress | None = None, keeper: Keeper | None = None) -> Result:
    """Runs rate mode; with a ``keeper`` from where an interrupted run was.

    Raises InputError where the drive loop never locks, or loses its lock, saying when.
    """
    with LoopedPlant(run) as plant:
        collected = Collected(run)
        if keeper is None or not _go_on(run, plant, collected, keeper):
            collected.times[:] = start_up(run, plant)
        return _simulate(run, plant, collected, progress, keeper)


def _go_on(run: RateRun, plant: LoopedPlant, collected: Collected, keeper: Keeper) -> bool:
    """Takes plant and record to where ``keeper`` has them; whether it does."""
    try:
        kept = keeper.found(run, plant.kept() | collected.kept())
        if kept is None:
            return False
        _check_courses(run, kept["held"], len(kept["rows"]))
        plant.go_on(kept)
    except InputError as misfit:
        keeper.goes_anew(misfit)
        return False
    collected.go_on(kept)
    keeper.goes_on(collected.done * run.interval)
    return True


def _check_courses(run: RateRun, held: Floats, done: int) -> None:
    """Raises InputError unless ``held`` are the means of the run's inputs over its first ``done`` rows."""
    if len(held) != done or (done % BLOCK_ROWS and done != run.rows) or not 0 < done <= run.rows:
        raise InputError("damaged")
    # In the blocks of the run: worked out in other pieces a course differs by rounding.
    for first in range(0, done, BLOCK_ROWS):
        _, means = _held(run, first, min(BLOCK_ROWS, done - first))
        if not np.array_equal(means, held[first : first + BLOCK_ROWS]):
            raise InputError("another course until there")


def _held(run: RateRun, first: int, count: int) -> tuple[Floats, Floats]:
    """The inputs over the samples of ``count`` rows from ``first`` on, shape (n, 5), and their means, (count, 5)."""
    inputs = run.inputs(first * run.per_row, count * run.per_row)
    return inputs, inputs.reshape(count, run.per_row, -1).mean(axis=1)


def _simulate(
    run: RateRun, plant: LoopedPlant, collected: Collected, progress: Progress | None, keeper: Keeper | None
) -> Result:
    recorder = collected.recorder
    for first in range(collected.done, run.rows, BLOCK_ROWS):
        count = min(BLOCK_ROWS, run.rows - first)
        inputs, means = _held(run, first, count)
        block, sensed = plant.step(inputs, count)
        if recorder is not None:
            recorder.take(sensed)
        check_lock(run, block, first)
        collected.done = first + count
        collected.rows[first : collected.done], collected.held[first : collected.done] = block, means
        if keeper is not None:
            keeper.offer(run, collected.done * run.interval, lambda: plant.kept() | collected.kept())
        if progress is not None:
            progress(collected.done * run.interval, run.duration)
    locked_at, started_at = collected.times.tolist()
    return Result(
        record_frame(collected.rows, collected.held, run.interval, run.seed),
        locked_at,
        started_at,
        None if recorder is None else recorder.frame(),
    )


def start_up(run: RateRun, plant: LoopedPlant) -> tuple[float, float]:
    """From power on at the first temperature and no rate until the loops are in lock, and settled: both times [s]."""
    inputs = np.tile(run.first_inputs, (run.per_row, 1))
    inputs[:, OMEGA_Z] = 0.0
    settling = int(np.ceil(run.settling / run.interval))
    locked = row = 0
    while row < locked + settling or not locked:
        row += 1
        values, _ = plant.step(inputs, 1)
        off = abs(values[0, loop.AMPLITUDE] / run.nominal.calibration.drive.voltage - 1)
        if values[0, loop.LARGEST_ERROR] > LOCKED_ERROR or off > LOCKED_AMPLITUDE:
            locked = 0
        elif not locked:
            locked = row
        if row > PATIENCE * settling:
            raise InputError(
                f"drive loop is not in lock {row * run.interval:.3g} s after the start: "
                f"amplitude {100 * off:.3g} % off, phase error {values[0, loop.LARGEST_ERROR]:.3g} rad; check damping, "
                "noise and the bandwidths in [rate_mode]"
            )
    return locked * run.interval, row * run.interval


def check_lock(run: RateRun, block: Floats, first: int) -> None:
    """Raises InputError where the rows of ``block``, from row ``first`` on, show that the lock is lost."""
    off = np.abs(block[:, loop.AMPLITUDE] / run.nominal.calibration.drive.voltage - 1)
    lost = ~((block[:, loop.LARGEST_ERROR] < LOST_ERROR) & (off < LOST_ERROR))
    if lost.any():
        row = int(lost.argmax())
        raise InputError(
            f"drive loop lost its lock at t = {(first + row + 1) * run.interval:.6g} s (phase error "
            f"{block[row, loop.LARGEST_ERROR]:.3g} rad, amplitude {100 * off[row]:.3g} % off): slow the temperature or "
            "the rate down, or raise phase_bandwidth in [rate_mode]"
        )


def record_frame(rows: Floats, held: Floats, interval: float, seed: int) -> pl.DataFrame:
    """The record of a run, one row an output interval; every value a mean over it, but temperatures of the plant and
    readings of the sensors at its end.

    t: end of the interval [s]; rate: output of the gyroscope; rate_true; quadrature [rad/s]; drive_frequency [Hz];
    drive_amplitude [V]; drive_force [N]; temperature (ambient), temperature_structure, temperature_circuit [K], true;
    sensor_structure, sensor_circuit [K], as the two sensors read them.
    """
    rng = np.random.default_rng(seed)
    structure, circuit = rows[:, loop.STRUCTURE], rows[:, loop.CIRCUIT]
    return pl.DataFrame(
        {
            "t": interval * np.arange(1, len(rows) + 1),
            "rate": rows[:, loop.RATE],
            "rate_true": held[:, OMEGA_Z],
            "quadrature": rows[:, loop.QUADRATURE],
            "drive_frequency": rows[:, loop.FREQUENCY],
            "drive_amplitude": rows[:, loop.AMPLITUDE],
            "drive_force": rows[:, loop.FORCE],
            "temperature": held[:, TEMPERATURE],
            "temperature_structure": structure,
            "temperature_circuit": circuit,
            "sensor_structure": Bridge().read(structure, rng),
            "sensor_circuit": BoardSensor().read(circuit, rng),
        }
    )
