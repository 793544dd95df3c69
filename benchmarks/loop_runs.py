"""One run of the loop, reduced to the numbers that the measures of the loop are made of."""

import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from typing import Final, NamedTuple, TypeVar

import numpy as np
import polars as pl
from numpy.typing import NDArray

from benchmarks import loop_drift
from cosim.angle import UNIT_NAMES
from cosim.layout import PARAMETER_NAMES
from cosim.master import simulate
from cosim.metrics import WITHIN, Bounds, angle_metrics, omega_metrics, reference_mean
from cosim.recorder import Result
from cosim.run import Run
from gyro_model.build import CHECKOUT, build
from gyro_model.errors import InputError
from gyrotwin.tasks.run import Request, prepare

Floats = NDArray[np.float64]
What = TypeVar("What")
Found = TypeVar("Found")

PROFILE: Final = CHECKOUT.parent / "shared" / "data" / "motion" / "sensor_data.csv.gz"
"""The measured motion: z axis of a hand-held unit, 135 s at 100 Hz, up to 209 deg/s."""
PROFILE_COLUMN: Final = "Gyroscope Z (deg/s)"
DAMPINGS: Final = ("dxx", "dyy", "dxy")
RATIO_NAMES: Final = tuple(f"{name}/m" for name in PARAMETER_NAMES if name != "m")
DAMPING_WITHIN: Final = 0.05
"""Relative error at which a damping counts as back after its jump."""
BOUND_AT: Final = 0.3
"""Errors of the parameters are compared with their bound at this time [s]."""


class Case(NamedTuple):
    """One run: scenario, observer, seed; ``start`` into the measured motion and ``duration`` [s], None: the
    scenario's."""

    scenario: str
    observer: str
    seed: int
    defects: bool = False
    start: float = 0.0
    duration: float | None = None

    def request(self) -> Request:
        """As from the command line."""
        measured = self.scenario == "motion"
        return Request(
            self.scenario,
            observer=self.observer,
            sensing_defects=self.defects,
            seed=self.seed,
            duration=self.duration,
            rate_profile=PROFILE if measured else None,
            rate_column=PROFILE_COLUMN if measured else None,
            rate_start=self.start,
        )


class Outcome(NamedTuple):
    """What came of a run: numbers by name (see ``measure``), infinite for what was never reached; the Cramer-Rao
    bound along it, where there is one; and why, if it failed."""

    case: Case
    values: dict[str, float]
    bounds: Bounds | None = None
    failure: str = ""

    def get(self, name: str) -> float:
        """A number by name; infinite where the run failed."""
        return self.values.get(name, np.inf)


def measure(case: Case) -> Outcome:
    """Runs ``case``. A run that diverges is an outcome, not an exception."""
    run = prepare(case.request())
    try:
        result = simulate(run)
    except InputError as error:
        return Outcome(case, {}, failure=str(error))
    return Outcome(case, numbers(run, result), result.bounds)


def numbers(run: Run, result: Result) -> dict[str, float]:
    """All numbers of a run by name, infinite for what was never reached."""
    values = {"converged_at": _known(result.converged_at)}
    for part in (_parameters, _dampings, _rate, _angles, _flag):
        values |= part(run, result)
    return values


def measure_all(cases: Iterable[Case], jobs: int) -> list[Outcome]:
    """Runs the cases in ``jobs`` processes, in order."""
    return in_processes(measure, list(cases), jobs)


def in_processes(function: Callable[[What], Found], items: Sequence[What], jobs: int) -> list[Found]:
    """``function`` of each item, in order, in ``jobs`` processes."""
    build()  # once, before the processes need it
    if jobs == 1:
        return [function(item) for item in items]
    # Linear algebra with threads of its own would take the cores from the other processes.
    os.environ.update({"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "POLARS_MAX_THREADS": "1"})
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
        return list(pool.map(function, items))


def finite(values: Mapping[str, float]) -> dict[str, float | None]:
    """What JSON can hold of some numbers."""
    return {name: float(value) if np.isfinite(value) else None for name, value in values.items()}


def _known(value: float | None) -> float:
    return np.inf if value is None else value


def _stays(t: Floats, inside: NDArray[np.bool_]) -> float:
    """Time [s] from which ``inside`` holds to the end; infinite if it does not."""
    outside = np.flatnonzero(~inside)
    if outside.size == 0:
        return float(t[0])
    return float(t[outside[-1] + 1]) if outside[-1] + 1 < len(t) else np.inf


def _relative_errors(trace: pl.DataFrame) -> dict[str, Floats]:
    """Relative errors of the seven and of the six ratios to the mass, which alone are known with an unknown gain."""
    ratio = {name: (trace[f"est_{name}"] / trace[f"true_{name}"]).to_numpy() for name in PARAMETER_NAMES}
    errors = {name: values - 1 for name, values in ratio.items()}
    return errors | {name: ratio[name.removesuffix("/m")] / ratio["m"] - 1 for name in RATIO_NAMES}


def _parameters(run: Run, result: Result) -> dict[str, float]:
    """Times within 1 % for good [s]; errors, and over their bounds, at BOUND_AT."""
    t = result.trace["t"].to_numpy()
    errors = _relative_errors(result.trace)
    values = {
        "within": max(_stays(t, np.abs(errors[name]) <= WITHIN) for name in PARAMETER_NAMES),
        "within_ratios": max(_stays(t, np.abs(errors[name]) <= WITHIN) for name in RATIO_NAMES),
    }
    at = int(np.searchsorted(t, BOUND_AT - 1e-9))
    if at == len(t):
        return values
    values |= {f"error_{name}": float(error[at]) for name, error in errors.items()}
    if result.bounds is not None:
        bounds = result.bounds.relative_at(t[at : at + 1])[0]
        values |= {
            f"over_bound_{name}": abs(errors[name][at]) / bound
            for name, bound in zip(PARAMETER_NAMES, bounds, strict=True)
        }
    return values


def _dampings(run: Run, result: Result) -> dict[str, float]:
    """Time from the jump until all dampings stay within 5 % [s]."""
    if run.scenario.name != "varying":
        return {}
    step_at = run.scenario.parameters["damping_step_time"]
    after = result.trace.filter(pl.col("t") >= step_at)
    if after.is_empty():
        return {}
    t, errors = after["t"].to_numpy(), _relative_errors(after)
    return {"back": max(_stays(t, np.abs(errors[name]) <= DAMPING_WITHIN) for name in DAMPINGS) - step_at}


def _rate(run: Run, result: Result) -> dict[str, float]:
    """Rms error of the rate [rad/s], and of the angle that is its integral from convergence on [deg]."""
    edges = run.scenario.edges_until(run.duration)
    values = {"omega": _known(omega_metrics(result.trace, result.converged_at, edges)["rms_error"])}
    if result.converged_at is None:
        return values
    t = result.trace["t"].to_numpy()
    since = t >= result.converged_at
    error = (result.trace["est_omega_z"] - result.trace["omega_true"]).to_numpy()[since]
    # The error is taken as held from one kept sample to the next.
    turned = np.concatenate(([0.0], np.cumsum(error[:-1] * np.diff(t[since]))))
    turned -= reference_mean(t[since], turned, result.converged_at, edges)
    return values | {
        "integrated_rms": float(np.rad2deg(np.sqrt(np.mean(turned**2)))),
        "fastest": float(np.rad2deg(np.abs(result.trace["omega_true"].to_numpy()).max())),
    }


def _angles(run: Run, result: Result) -> dict[str, float]:
    """Error rms [deg], largest [deg] and drift [deg/s] of each unit, from convergence to the end."""
    trace = result.trace
    columns = {name: trace[name].to_numpy() for name in ("t", "angle_true", "omega_true")}
    edges = run.scenario.edges_until(run.duration)
    values = {}
    for unit in UNIT_NAMES:
        found = angle_metrics(
            columns["t"],
            trace[f"angle_{unit}"].to_numpy(),
            columns["angle_true"],
            columns["omega_true"],
            result.converged_at,
            edges,
        )
        values[f"angle_{unit}"] = _known(found["rms_deg"])
        values[f"largest_{unit}"] = _known(found["max_deg"])
        values[f"drift_{unit}"] = _known(found["drift_deg_per_s"])
    return values


def _flag(run: Run, result: Result) -> dict[str, float]:
    """Drift of angle C over 0.5 to 1 s, its bound and its prediction [deg/s]; whether the flag lied; the share of the
    run in which the angle was valid."""
    worst = loop_drift.lie(result)
    return {
        "late_drift": loop_drift.drift(result),
        "late_bound": loop_drift.bound(result),
        "late_predicted": loop_drift.predicted(result),
        "lies": 0.0 if worst is None else float(worst.windows),
        "valid_share": result.validity.share,
    }
