"""What is kept of a run: the trace, its first samples at full rate, and what the Cramer-Rao bound needs."""

from collections.abc import Sequence
from math import isfinite, nan, pi, sqrt
from typing import Any, Final, NamedTuple

import numpy as np
import polars as pl
from numpy.typing import NDArray

from cosim.angle import UNIT_NAMES, AngleUnit, Block, make_units, orientation_at, ripple, unwrapped
from cosim.bound import Bound, Motion, at_the_truth, bound
from cosim.compiled_loop import parts_of
from cosim.core.library import CONTROL_NAMES, Library
from cosim.layout import KXX, OMEGA_Z, PARAMETER_NAMES, STATE_NAMES
from cosim.metrics import Bounds
from cosim.monitor import Monitor, Orbit, Verdict
from cosim.observers.record import CoreObserver
from cosim.run import Run
from cosim.scenarios import INPUT_NAMES
from cosim.trace import Trace
from gyro_model.device import Device
from gyro_model.evaluate import evaluate
from gyro_model.remembered import remembered

Floats = NDArray[np.float64]

START_DURATION: Final = 3e-3
"""Recorded at the full sample rate for the figure of the first convergence [s]."""
BOUND_DURATION: Final = 1.0
"""The Cramer-Rao bound is computed along the first part of a run [s]; it keeps 88 bytes a sample."""
BOUND_TIMES: Final = 60


class _Judged(NamedTuple):
    """A block that has been judged: its samples, and what had been said until then and held throughout: whether the
    angle is valid, the standard deviations of ``Verdict`` [rad/s, rad], and the variance of the angle without the
    ripple of its readings [rad^2], NaN where there is no angle yet."""

    samples: int
    converged: bool
    drift_sigma: float
    drift_sigma_now: float
    stray_sigma: float
    angle_variance: float


_SAID: Final = _Judged._fields[1:-1]


class Validity(NamedTuple):
    """share: of the run in which the angle was valid; withdrawn: (t [s], reason) of each time that it ceased to be;
    now: whether it is at the end; reason: why not (else empty); stopped: why the run ended early (else empty)."""

    share: float
    withdrawn: tuple[tuple[float, str], ...]
    now: bool
    reason: str
    stopped: str


class Result(NamedTuple):
    """What a run gives.

    trace: columns of trace.parquet, thinned where it is long; rows: all of them; start: the first milliseconds at full
    rate, with the true states; units: the angle units, after use; converged_at: when the angle was valid first [s] or
    None; bounds: None where it can't be told; validity; wall_time: of the loop [s]; extra_names: what else was
    estimated, by FMU name.
    """

    trace: pl.DataFrame
    rows: Trace
    start: pl.DataFrame
    units: dict[str, AngleUnit]
    converged_at: float | None
    bounds: Bounds | None
    validity: Validity
    wall_time: float
    extra_names: tuple[str, ...]


UNKNOWN: Final = pi / sqrt(12)
"""Standard deviation [rad] of a pattern that may stand anywhere: it is the same after half a turn."""


class Recorder:
    """Takes the rows of the loop block by block, and the monitor's verdict after each."""

    def __init__(self, run: Run, lib: Library, monitor: Monitor) -> None:
        self.run = run
        self.monitor = monitor
        self.units = make_units(run.sample_rate, run.oscillation_hz)
        self.angular_gain = run.design.all_values["angular_gain"]
        self.every = run.trace_every
        self.converged_at: float | None = None
        self.names = lib.estimate_names
        self.extra_names = lib.known.estimated if isinstance(run.observer, CoreObserver) else ()
        self._trace = Trace(-(-run.samples // self.every))
        self._start: list[pl.DataFrame] = []
        self._motion: list[tuple[Floats, ...]] = []
        self._omega_squared = np.nan
        self._verdict = Verdict(False, "the run has only begun", np.inf, np.inf, np.inf, 0.0)
        self._judged: list[_Judged] = []
        self._valid_samples = self._samples = 0
        self._angle_deviation = 0.0
        self._strayed_before = np.inf
        self._ripple = 0.0
        self._ripple_before: float | None = None
        self._turned = 0.0
        self._zero = np.nan
        self._judged_at = 0.0
        self._stopped = ""

    def judge(self, first: int, rows: Floats, held: Floats, deviation: Floats) -> None:
        """Lets the monitor judge at the end of a block: its rows, one at least, the samples from ``first`` on, the
        inputs held over each, as cosim.scenarios.INPUT_NAMES, and the standard deviations of the last estimates."""
        verdict = self._verdict
        sigmas = verdict.drift_sigma, verdict.drift_sigma_now, verdict.stray_sigma
        self._judged.append(_Judged(len(rows), verdict.valid, *sigmas, self._angle_variance()))
        t, end = (first + len(rows) - 1) * self.run.period, (first + len(rows)) * self.run.period
        estimate = rows[-1, : len(self.names)].copy()
        measured = np.array([*held[-1, 1:], held[-1, 1], held[-1, 1]])
        orbit = self._orbit(rows)
        self._verdict = self.monitor.judge(t, estimate, deviation, measured, orbit)
        if self._verdict.valid and self.converged_at is None:
            # The flag holds from the next sample on.
            self.converged_at = end
            self._strayed_before = self._verdict.stray_sigma
        if self.converged_at is not None and np.isfinite(self._verdict.drift_sigma_now):
            self._angle_deviation += self._verdict.drift_sigma_now * (end - max(self._judged_at, self.converged_at))
        if self.converged_at is not None:
            self._angle_deviation += (orbit.pushed + orbit.behind + self._misled(rows)) * len(rows) * self.run.period
        self._judged_at = end

    def _misled(self, rows: Floats) -> float:
        """How fast the force may turn the pattern [rad/s] where the estimated motion is astray, by the share of the
        amplitude that it is."""
        if not self._verdict.astray:
            return 0.0
        _, control, plant = parts_of(rows)
        amplitude = self._amplitude(plant)
        share = min(self._verdict.astray / amplitude, 1.0) if amplitude > 0 else 1.0
        return share * self._turning(_swing(control[:, :2]), amplitude)

    def _amplitude(self, plant: Floats) -> float:
        """Of the motion, by the outputs of the plant [m]."""
        return _swing(plant[:, :2]) / abs(self.run.design.all_values["sense_gain_x"])

    def _turning(self, force: float, amplitude: float) -> float:
        """How fast a force [N] all across a motion of that amplitude [m] may turn the pattern [rad/s]: F/(2 m w a)."""
        mass = self.run.design.all_values["m"]
        return force / (4 * np.pi * mass * self.run.oscillation_hz * max(amplitude, 1e-12))

    def _orbit(self, rows: Floats) -> Orbit:
        """Where the pattern stands at the end of a block, and how fast what the force has lacked in it may turn it."""
        _, controls, plant = parts_of(rows)
        estimate, control = rows[-1, : len(STATE_NAMES)], controls[-1]
        free, omega_squared = (estimate - control[2:6]).tolist(), float(control[CONTROL_NAMES.index("omega_squared")])
        lacking, behind = (float(np.mean(controls[:, CONTROL_NAMES.index(name)])) for name in ("lacking", "behind"))
        pushed = self._turning(lacking, self._amplitude(plant)) if lacking else 0.0
        return Orbit(orientation_at(free, omega_squared), omega_squared, pushed, behind)

    def keep(self, first: int, rows: Floats, held: Floats) -> None:
        """Keeps the rows (estimates, control, outputs of the plant) of the samples from ``first`` on, all
        judged by now, with the inputs held over each."""
        run, judged = self.run, self._judged
        self._judged = []
        t: Floats = np.arange(first, first + len(rows), dtype=np.float64) * np.float64(run.period)
        estimate, control, plant = parts_of(rows)
        counts = [block.samples for block in judged]
        said = {name: np.repeat([getattr(block, name) for block in judged], counts) for name in _SAID}
        read = self._block(t, estimate, control, said["converged"])
        angles = {name: unit.process(read) for name, unit in self.units.items()}
        said["angle_sigma"] = np.repeat(self._angle_sigmas(read, judged), counts)
        true_states = plant[:, -len(STATE_NAMES) :]
        if first * run.period < START_DURATION:
            count = round(START_DURATION * run.sample_rate)
            self._start.append(self._start_frame(t, true_states, estimate, held)[:count])
        if first * run.period < BOUND_DURATION:
            self._motion.append((true_states.copy(), control[:, :2].copy(), held))
            self._omega_squared = float(control[-1, CONTROL_NAMES.index("omega_squared")])
        kept = slice(-first % self.every, None, self.every)
        angle_true = self._angle_true(said["converged"], held[:, 0])
        if len(t[kept]):
            said = {name: values[kept] for name, values in said.items()}
            self._trace.add(self._columns(t[kept], rows[kept], held[kept], angle_true[kept], angles, said, kept))
        self._samples += len(rows)
        self._valid_samples += sum(block.samples for block in judged if block.converged)

    def stop(self, t: float, complaint: str) -> None:
        """The plant could not go on at ``t`` [s]."""
        self._stopped = f"at {t:.6g} s the plant {complaint}"

    def result(self, wall_time: float) -> Result:
        """What has been kept, joined."""
        withdrawn = tuple(self.monitor.withdrawn)
        reason = self._stopped or ("" if self._verdict.valid else self._verdict.reason)
        valid = self._verdict.valid and not self._stopped
        validity = Validity(self._valid_samples / max(self._samples, 1), withdrawn, valid, reason, self._stopped)
        return Result(
            self._trace.frame(),
            self._trace,
            pl.concat(self._start),
            self.units,
            self.converged_at,
            self._bounds(),
            validity,
            wall_time,
            self.extra_names,
        )

    def _angle_variance(self) -> float:
        """What drift, reading and straying since the angle was first valid leave of it [rad^2]; NaN before, when there
        is no angle."""
        if self.converged_at is None:
            return nan
        # Within a cycle the variance may fall.
        strayed = max(self._verdict.stray_sigma**2 - self._strayed_before**2, 0.0)
        return self._angle_deviation**2 + self._verdict.bend_sigma**2 + strayed

    def _angle_sigmas(self, read: Block, judged: Sequence[_Judged]) -> list[float]:
        """Deviation of the angle through each block [rad]: beside its variance the ripple of the two readings that an
        angle is the difference of, as unit C read them at the end of the block before and where it was first valid."""
        phi, cycle = unwrapped(read.free[0]), round(self.run.sample_rate / self.run.oscillation_hz)
        sigmas, first = [], 0
        for block in judged:
            if self._ripple_before is None and isfinite(block.angle_variance):
                self._ripple_before = self._ripple
            rippled = self._ripple**2 + (self._ripple_before or 0.0) ** 2
            sigmas.append(min(sqrt(block.angle_variance + rippled), UNKNOWN))
            found = ripple(phi[first : first + block.samples], cycle)
            # As before where it reads no number.
            self._ripple = found if isfinite(found) else self._ripple
            first += block.samples
        return sigmas

    def _angle_true(self, converged: NDArray[np.bool_], omega_z: Floats) -> Floats:
        """Integral of exactly the held rate [rad], zero where the angle was valid first and NaN before."""
        turned = self._turned + np.concatenate(([0.0], np.cumsum(omega_z))) * self.run.period
        self._turned = float(turned[-1])
        first = 0
        if np.isnan(self._zero) and converged.any():
            first = int(converged.argmax())
            self._zero = float(turned[first])
        angle: Floats = turned[:-1] - self._zero
        angle[:first] = np.nan
        return angle

    def _block(self, t: Floats, estimate: Floats, control: Floats, converged: NDArray[np.bool_]) -> Block:
        """What the angle units read."""
        states, controls = estimate[:, : len(STATE_NAMES)].T, control.T
        first = CONTROL_NAMES.index("near_x")
        forced, near = controls[2:6], controls[first : first + len(STATE_NAMES)]
        omega_squared, turned = (controls[CONTROL_NAMES.index(name)] for name in ("omega_squared", "turned"))
        turn = self.angular_gain * estimate[:, OMEGA_Z] + controls[CONTROL_NAMES.index("own_rate")]
        return Block(t, states, forced, near, omega_squared, converged, self.angular_gain, turned, turn)

    def _columns(
        self,
        t: Floats,
        rows: Floats,
        held: Floats,
        angle_true: Floats,
        angles: dict[str, tuple[Floats, Floats]],
        said: dict[str, NDArray[Any]],
        kept: slice,
    ) -> dict[str, NDArray[Any]]:
        estimate, control, plant = parts_of(rows)
        true = true_parameters(self.run.device, t, held)
        angle, quality = angles[self.run.scenario.angle_unit]
        extra = [self.names.index(name) for name in self.extra_names]
        changing = {name: held[:, i] for i, name in enumerate(INPUT_NAMES) if i and name in self.run.scenario.courses}
        return {
            "t": t,
            "omega_true": held[:, 0],
            "angle_true": angle_true,
            "angle": angle[kept],
            "angle_quality": quality[kept],
            "turned": control[:, CONTROL_NAMES.index("turned")],
            **said,
            "v_x": plant[:, 0],
            "v_y": plant[:, 1],
            "u_x": control[:, 0],
            "u_y": control[:, 1],
            **{f"est_{name}": estimate[:, KXX + i] for i, name in enumerate(PARAMETER_NAMES)},
            "est_omega_z": estimate[:, OMEGA_Z],
            **{f"true_{name}": true[name] for name in PARAMETER_NAMES},
            **{f"est_{name}": estimate[:, i] for i, name in enumerate(STATE_NAMES)},
            **{f"est_{self.names[i]}": estimate[:, i] for i in extra},
            **{f"angle_{name}": angles[name][0][kept] for name in UNIT_NAMES},
            **changing,
        }

    def _start_frame(self, t: Floats, true: Floats, estimate: Floats, held: Floats) -> pl.DataFrame:
        parameters = true_parameters(self.run.device, t, held)
        columns = {"t": t, "omega_true": held[:, 0], "est_omega_z": estimate[:, OMEGA_Z]}
        columns |= {f"true_{name}": true[:, i] for i, name in enumerate(STATE_NAMES)}
        columns |= {f"est_{name}": estimate[:, i] for i, name in enumerate(STATE_NAMES)}
        columns |= {f"true_{name}": parameters[name] for name in PARAMETER_NAMES}
        columns |= {f"est_{name}": estimate[:, KXX + i] for i, name in enumerate(PARAMETER_NAMES)}
        return pl.DataFrame({name: np.array(column) for name, column in columns.items()})

    def _bounds(self) -> Bounds | None:
        """The bound along the first part of the run; None where the design leaves out what acts, or nothing is
        noisy."""
        run = self.run
        design = at_the_truth(run.design, run.device.all_parameters)
        covered = {e.id for e in run.device.model.effects if e.nominal or not run.device.acts(e)} | set(
            design.known_model.acting
        )
        states, forces, held = (np.concatenate(parts) for parts in zip(*self._motion, strict=True))
        last = (len(held) - 1) * run.period
        if (
            not all(e.id in covered for e in run.device.model.effects)
            or not design.all_values["sense_noise"]
            or last < 1e-3
        ):
            return None
        times = np.geomspace(1e-3, last, BOUND_TIMES)
        motion = Motion(states, forces, held[:, 0], held[:, 1:], run.period)
        found: Bound = bound(motion, design, times, stiffness=self._omega_squared * run.device.all_parameters["m"])
        with np.errstate(divide="ignore", invalid="ignore"):
            relative = found.values[:, : len(PARAMETER_NAMES)] / np.abs([design.values[n] for n in PARAMETER_NAMES])
        effects = {name: found.values[:, found.names.index(name)] for name in self.extra_names}
        return Bounds(times, relative, found.omega, found.drift, effects)


def _swing(pair: Floats) -> float:
    """Amplitude of the larger of two oscillations, shape (n, 2)."""
    return float(np.sqrt(2 * np.max(np.mean(pair**2, axis=0))))


def true_parameters(device: Device, t: Floats, held: Floats | None = None) -> dict[str, Floats]:
    """The seven parameters that act at times ``t`` [s], shape (n,) each: the device's, under its parameter laws.

    held: inputs by cosim.scenarios.INPUT_NAMES, shape (n, 5); None: their start values. Temperatures that lag are taken
    as settled.
    """
    values: dict[str, Any] = device.all_parameters | {
        q.name: q.start for q in device.model.quantities if q.role in ("input", "output")
    }
    if held is not None:
        values |= {name: held[:, i] for i, name in enumerate(INPUT_NAMES)}
        values |= {"temperature_structure": values["temperature"], "temperature_circuit": values["temperature"]}
    result: dict[str, Floats] = {name: np.full(len(t), values[name]) for name in PARAMETER_NAMES}
    for law in device.acting_laws:
        passed = t >= values[law.event.name] if law.event is not None else np.zeros(len(t))
        known = {**values, **result, "t": t, "after": np.asarray(passed, dtype=float)}
        if law.memories:
            known |= remembered(law, t, known)
        changed = evaluate(law, known, law.made())
        result |= {name: np.broadcast_to(value, t.shape) for name, value in changed.items() if name in result}
    return result
