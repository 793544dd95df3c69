"""What is kept of a run: the trace, its first samples at full rate, and what the Cramer-Rao bound needs."""

from typing import Any, Final, NamedTuple

import numpy as np
import polars as pl
from numpy.typing import NDArray

from cosim import loop
from cosim.angle import UNIT_NAMES, AngleUnit, Block, make_units
from cosim.bound import Motion, Prior, parameter_bound
from cosim.controllers.record import CONVERGED, CONVERGED_AT, FORCE_X, FORCED, OMEGA_SQUARED
from cosim.layout import DEFECT_NAMES, ESTIMATE_NAMES, KXX, OFFSET_X, OMEGA_Z, PARAMETER_NAMES, STATE_NAMES
from cosim.metrics import Bounds
from cosim.run import Run
from gyro_model.device import Device
from gyro_model.errors import InputError
from gyro_model.evaluate import evaluate

Floats = NDArray[np.float64]

START_DURATION: Final = 3e-3
"""Recorded at the full sample rate for the figure of the first convergence [s]."""
BOUND_DURATION: Final = 1.0
"""The Cramer-Rao bound is computed along the first part of a run [s]; it keeps 56 bytes a sample."""
BOUND_TIMES: Final = 60
OMEGA_WALK: Final = 10.0
"""Prior of the bound: the rate is a random walk of this size [rad/s per sqrt(s)]."""


class Result(NamedTuple):
    """What a run gives.

    trace: columns of trace.parquet; start: the first milliseconds at full rate, with the true states; units: the angle
    units, after use; converged_at [s] or None; bounds: None where more acts than the bound covers; wall_time: of the
    loop [s].
    """

    trace: pl.DataFrame
    start: pl.DataFrame
    units: dict[str, AngleUnit]
    converged_at: float | None
    bounds: Bounds | None
    wall_time: float


class Recorder:
    """Takes the rows of the loop block by block."""

    def __init__(self, run: Run) -> None:
        self.run = run
        self.units = make_units(run.sample_rate, run.oscillation_hz)
        self.every = max(round(run.sample_rate / run.trace_rate), 1)
        self.converged_at: float | None = None
        self._rows = -(-run.samples // self.every)
        self._columns: dict[str, NDArray[Any]] = {}
        self._start: list[pl.DataFrame] = []
        self._motion: list[tuple[Floats, Floats, Floats]] = []
        self._turned = 0.0
        self._zero = np.nan

    def keep(self, first: int, rows: Floats, omega_z: Floats) -> None:
        """Keeps the rows (see cosim.loop) of the samples from ``first`` on and the rate held over each [rad/s].

        Raises InputError, with time and name, where an estimate is not finite.
        """
        run = self.run
        t: Floats = np.arange(first, first + len(rows), dtype=np.float64) * np.float64(run.period)
        estimate, control, plant = _parts(rows)
        self.check(first, rows)
        converged = control[:, CONVERGED] > 0
        if self.converged_at is None and converged.any():
            self.converged_at = float(control[converged.argmax(), CONVERGED_AT])
        angles = self._angles(t, estimate, control, converged)
        true_states = plant[:, -len(STATE_NAMES) :]
        if first * run.period < START_DURATION:
            count = round(START_DURATION * run.sample_rate)
            self._start.append(self._start_frame(t, true_states, estimate, omega_z)[:count])
        if first * run.period < BOUND_DURATION:
            self._motion.append((true_states.copy(), control[:, FORCE_X : FORCE_X + 2].copy(), omega_z))
        kept = slice(-first % self.every, None, self.every)
        angle_true = self._angle_true(converged, omega_z)
        columns = self._trace(t[kept], rows[kept], omega_z[kept], angle_true[kept], angles, kept)
        begin = -(-first // self.every)
        for name, values in columns.items():
            whole = self._columns.setdefault(name, np.empty(self._rows, dtype=values.dtype))
            whole[begin : begin + len(values)] = values

    def check(self, first: int, rows: Floats) -> None:
        """Raises InputError, with time and name, where an estimate in the rows from ``first`` on is not finite."""
        estimate, _, _ = _parts(rows)
        if not np.isfinite(estimate).all():
            row, column = np.argwhere(~np.isfinite(estimate))[0]
            raise InputError(
                f"run diverged at {(first + row) * self.run.period:.6g} s: the estimate of {ESTIMATE_NAMES[column]} "
                "is not finite; check the device, its effects and the sample rate"
            )

    def result(self, wall_time: float) -> Result:
        """What has been kept, joined."""
        start = pl.concat(self._start)
        return Result(pl.DataFrame(self._columns), start, self.units, self.converged_at, self._bounds(), wall_time)

    def _angle_true(self, converged: NDArray[np.bool_], omega_z: Floats) -> Floats:
        """Integral of exactly the held rate [rad], zero at convergence and NaN before."""
        turned = self._turned + np.concatenate(([0.0], np.cumsum(omega_z))) * self.run.period
        self._turned = float(turned[-1])
        if np.isnan(self._zero) and converged.any():
            self._zero = float(turned[converged.argmax()])
        return np.where(converged, turned[:-1] - self._zero, np.nan)

    def _angles(
        self, t: Floats, estimate: Floats, control: Floats, converged: NDArray[np.bool_]
    ) -> dict[str, tuple[Floats, Floats]]:
        x, x_dot, y, y_dot = np.ascontiguousarray(estimate[:, : len(STATE_NAMES)].T)
        forced = np.ascontiguousarray(control[:, FORCED:OMEGA_SQUARED].T)
        omega_squared = np.ascontiguousarray(control[:, OMEGA_SQUARED])
        gain = self.run.device.all_parameters.get("angular_gain", 1.0)
        block = Block(t, x, x_dot, y, y_dot, forced, omega_squared, converged, gain)
        return {name: unit.process(block) for name, unit in self.units.items()}

    def _trace(
        self,
        t: Floats,
        rows: Floats,
        omega_z: Floats,
        angle_true: Floats,
        angles: dict[str, tuple[Floats, Floats]],
        kept: slice,
    ) -> dict[str, NDArray[Any]]:
        estimate, control, plant = _parts(rows)
        true = true_parameters(self.run.device, t)
        angle, quality = angles[self.run.scenario.angle_unit]
        return {
            "t": t,
            "omega_true": omega_z,
            "angle_true": angle_true,
            "angle": angle[kept],
            "angle_quality": quality[kept],
            "converged": control[:, CONVERGED] > 0,
            "v_x": plant[:, 0],
            "v_y": plant[:, 1],
            "u_x": control[:, FORCE_X],
            "u_y": control[:, FORCE_X + 1],
            **{f"est_{name}": estimate[:, KXX + i] for i, name in enumerate(PARAMETER_NAMES)},
            "est_omega_z": estimate[:, OMEGA_Z],
            **{f"true_{name}": true[name] for name in PARAMETER_NAMES},
            **{f"est_{name}": estimate[:, i] for i, name in enumerate(STATE_NAMES)},
            **{f"est_{name}": estimate[:, OFFSET_X + i] for i, name in enumerate(DEFECT_NAMES)},
            **{f"angle_{name}": angles[name][0][kept] for name in UNIT_NAMES},
        }

    def _start_frame(self, t: Floats, true: Floats, estimate: Floats, omega_z: Floats) -> pl.DataFrame:
        parameters = true_parameters(self.run.device, t)
        columns = {"t": t, "omega_true": omega_z, "est_omega_z": estimate[:, OMEGA_Z]}
        columns |= {f"true_{name}": true[:, i] for i, name in enumerate(STATE_NAMES)}
        columns |= {f"est_{name}": estimate[:, i] for i, name in enumerate(STATE_NAMES)}
        columns |= {f"true_{name}": parameters[name] for name in PARAMETER_NAMES}
        columns |= {f"est_{name}": estimate[:, KXX + i] for i, name in enumerate(PARAMETER_NAMES)}
        return pl.DataFrame({name: np.ascontiguousarray(column) for name, column in columns.items()})

    def _bounds(self) -> Bounds | None:
        """The bound along the first part of the run; None where more acts than the nominal device and white noise."""
        device = self.run.device
        noise = device.all_parameters["sense_noise"]
        covered = all(e.nominal or e.id == "sense_noise" or not device.acts(e) for e in device.model.effects)
        states, forces, omega_z = (np.concatenate(parts) for parts in zip(*self._motion, strict=True))
        last = (len(omega_z) - 1) * self.run.period
        if not covered or noise == 0 or last < 1e-3:
            return None
        p = device.all_parameters
        parameters = np.array([p[name] for name in PARAMETER_NAMES])
        metres = (noise / abs(p["sense_gain_x"]), noise / abs(p["sense_gain_y"]))
        times = np.geomspace(1e-3, last, BOUND_TIMES)
        prior = Prior(omega_walk=OMEGA_WALK, amplitude=self.run.amplitude)
        motion = Motion(states, forces, omega_z, parameters, self.run.period)
        return Bounds(times, *parameter_bound(motion, metres, times, prior))


def _parts(rows: Floats) -> tuple[Floats, Floats, Floats]:
    """The estimates, the controller's output and the plant's output in rows of the loop."""
    return rows[:, : loop.DEVIATION], rows[:, loop.CONTROL : loop.PLANT], rows[:, loop.PLANT :]


def true_parameters(device: Device, t: Floats) -> dict[str, Floats]:
    """The seven parameters that act at times ``t`` [s], shape (n,) each: the device's, under its parameter laws."""
    # A run of the angle loop stays at the temperatures at which the FMU starts.
    values = device.all_parameters | {q.name: q.start for q in device.model.quantities if q.role in ("input", "output")}
    result: dict[str, Floats] = {name: np.full(len(t), values[name]) for name in PARAMETER_NAMES}
    for law in device.model.laws:
        if device.acts(law):
            passed = t >= values[law.event.name] if law.event is not None else np.zeros(len(t))
            changed = evaluate(law, {**values, **result, "t": t, "after": np.asarray(passed, dtype=float)})
            result |= {name: np.broadcast_to(value, t.shape) for name, value in changed.items() if name in result}
    return result
