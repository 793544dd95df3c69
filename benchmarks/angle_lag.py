"""How late the angle is: a sine of the rate, and the phase of the angle behind its integral."""

from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import partial
from multiprocessing import get_context
from typing import Final

import numpy as np

from benchmarks.report import MANY_SEEDS, Options, Report, Row, Table, row, spread
from cosim.angle import UNIT_NAMES, make_units, sine_lag
from cosim.master import simulate
from cosim.run import Run
from cosim.scenarios import Scenario, Sine
from gyro_model.build import build
from gyrotwin.tasks.run import Request, prepare

FREQUENCY_HZ: Final = 20.0
AMPLITUDE: Final = 5.0
"""Of the rate [rad/s]."""
OBSERVERS: Final = ("ekf", "lyapunov")
LAG: Final = 50e-6
"""Target of unit C [s]."""


def sine_run(observer: str, seed: int, duration: float) -> Run:
    """The run that is measured: the reference device from x = 1 um under the sine."""
    usual = prepare(Request("constant", observer=observer, seed=seed, duration=duration))
    name = f"sine of {AMPLITUDE:g} rad/s, {FREQUENCY_HZ:g} Hz"
    courses = {"omega_z": (Sine(AMPLITUDE, FREQUENCY_HZ),)}
    scenario = Scenario("sine", name, duration, courses, usual.scenario.parameters)
    return replace(usual, scenario=scenario)


def lags(observer: str, duration: float, seed: int) -> dict[str, float]:
    """Lag [s] of each unit from convergence on; infinite without convergence."""
    result = simulate(sine_run(observer, seed, duration))
    if result.converged_at is None:
        return dict.fromkeys(UNIT_NAMES, np.inf)
    trace = result.trace.filter(result.trace["t"] >= result.converged_at)
    t, true = trace["t"].to_numpy(), trace["angle_true"].to_numpy()
    return {unit: sine_lag(t, trace[f"angle_{unit}"].to_numpy(), true, FREQUENCY_HZ) for unit in UNIT_NAMES}


def rows(seeds: Sequence[int], observers: Sequence[str], duration: float, jobs: int) -> list[Row]:
    """Sizes of the lags, median, 95 % and worst over the seeds [us], and the median with its sign."""
    build()
    result = []
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
        for observer in observers:
            found = list(pool.map(partial(lags, observer, duration), seeds))
            for unit in UNIT_NAMES:
                values = [1e6 * lag[unit] for lag in found]
                limit = 1e6 * LAG if unit == "C" else None
                note = f"signed median {np.median(values):+.1f}"
                result.append(row(f"{observer}: unit {unit}", "µs", spread(values), limit=limit, note=note))
    return result


def run(options: Options) -> Report:
    """All seeds, both observers, 1 s."""
    seeds = options.seeds_or(MANY_SEEDS)
    table = Table(f"lag of the angle at {FREQUENCY_HZ:g} Hz", rows(range(1, seeds + 1), OBSERVERS, 1.0, options.jobs))
    run = sine_run("ekf", 1, 1.0)
    delays = [
        f"{name} {1e6 * unit.filter.group_delay:.1f} µs"
        for name, unit in make_units(run.sample_rate, run.oscillation_hz).items()
        if unit.filter is not None
    ]
    notes = [
        f"Rate: a sine of {AMPLITUDE:g} rad/s; offset and drift of the angle are fitted with the sine and so removed.",
        f"Group delay of the units' filters at a steady rate: {', '.join(delays)}. At 20 Hz the "
        "curvature of its phase delays too; unit C has no filter.",
    ]
    return Report("angle_lag", f"Lag of the angle, {seeds} seeds", [table], notes)
