"""Runs of the packaged loop for tests: as typed on the command line, through a design file."""

import numpy as np

from cosim.master import simulate
from cosim.recorder import Result
from cosim.run import Run
from gyrotwin.tasks.run import Request, prepare


def run_of(scenario="constant", *changes, **options) -> Run:
    """The run of a scenario; ``changes`` are texts ``name=value``, ``options`` fields of gyrotwin.tasks.run.Request."""
    return prepare(Request(scenario, settings=changes, **options))


def simulated(scenario="constant", *changes, **options) -> tuple[Run, Result]:
    """The same, done."""
    run = run_of(scenario, *changes, **options)
    return run, simulate(run)


def drift(result: Result, begin=0.0, until=np.inf) -> float:
    """Slope of the error of angle C over what is valid of a window [deg/s]; NaN where less than 10 ms of it are."""
    trace = result.trace
    kept = trace.filter(trace["converged"] & (trace["t"] >= begin) & (trace["t"] < until))
    if len(kept) < 200:
        return float("nan")
    error = (kept["angle_C"] - kept["angle_true"]).to_numpy()
    return float(np.rad2deg(np.polyfit(kept["t"].to_numpy(), error, 1)[0]))
