"""Reference traces: a change of behaviour of the model or of the FMU shows against what was recorded."""

from collections.abc import Callable

import numpy as np
import pytest
from gyro_runner import Floats, Runner
from trace_files import CASES, FOLDER, PERIOD, SEED, Trace, make, read, simulated, write

Residual = Callable[[str, float, float], None]

# Both integrate to 1e-12 a sample and round 1e-16 a step; other versions of scipy and libm order sums differently.
ROUNDING = 1e-11
TOLERANCES = {
    # The lag takes the motion as its quintic Hermite polynomial over an internal step: off by (ωh)⁶/46080 at 3.8 kHz.
    "pickoff_chain_and_lag": 6e-11,
}

every_trace = pytest.mark.parametrize("name", CASES)


def compare(got: dict[str, Floats], trace: Trace, limit: float, residual: Residual) -> None:
    for name, wanted in trace.outputs.items():
        residual(name, np.max(np.abs(got[name] - wanted)) / np.max(np.abs(wanted)), limit)


@every_trace
def test_reference_gives_the_trace(name: str, update: bool, residual: Residual) -> None:
    if update:
        write(name, make(name))
    trace = read(name)
    compare(simulated(trace.parameters, trace.t, trace.inputs), trace, ROUNDING, residual)


@every_trace
@pytest.mark.parametrize("version", [2, 3], ids=["fmi2", "fmi3"])
def test_fmu_gives_the_trace(name: str, version: int, runners: dict[int, Runner], residual: Residual) -> None:
    trace = read(name)
    got = runners[version].run(trace.parameters, trace.t, trace.inputs)
    compare(got, trace, TOLERANCES.get(name, ROUNDING), residual)


@every_trace
def test_the_file_says_how_it_is_made(name: str) -> None:
    trace = read(name)
    assert trace.parameters == {"x_start": 8e-7, "y_start": -3e-7, "sample_period": PERIOD, "seed": SEED, **CASES[name]}
    # An effect that left no mark on its trace would not be tested by it.
    if name != "plain":
        plain = read("plain").outputs
        marks = [np.max(np.abs(trace.outputs[c] - plain[c])) / np.max(np.abs(plain[c])) for c in plain]
        assert max(marks) > 1e-3


def test_no_trace_is_left_over() -> None:
    assert {path.stem for path in FOLDER.glob("*.csv")} == set(CASES)
