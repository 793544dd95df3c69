"""Reference traces: a change of behaviour of the model or of an FMU shows against what was recorded."""

from collections.abc import Callable, Mapping

import numpy as np
import pytest
from gyro_runner import Floats, RestingRunner, Runner
from trace_files import (
    CASES,
    ENVELOPE,
    ENVELOPE_CASES,
    FOLDER,
    FULL,
    SENSOR,
    SENSOR_CASES,
    make_envelope,
    make_sensor,
    parameters_of,
    read,
    simulated,
    write,
)

from gyro_model.experiments import Experiment

Residual = Callable[[str, float, float], None]

every_trace = pytest.mark.parametrize("name", CASES)
every_sensor = pytest.mark.parametrize("name", SENSOR_CASES)
every_envelope = pytest.mark.parametrize("name", ENVELOPE_CASES)


@pytest.fixture(scope="session", autouse=True)
def rewritten(update: bool) -> None:
    for form in (FULL, ENVELOPE, SENSOR) if update else ():
        write(form)


def compare(got: Mapping[str, Floats], trace: Experiment, residual: Residual) -> None:
    for name, wanted in trace.outputs.items():
        limit = trace.tolerances[name].relative
        residual(name, np.max(np.abs(got[name] - wanted)) / np.max(np.abs(wanted)), limit)


@every_trace
def test_reference_gives_the_trace(name: str, residual: Residual) -> None:
    trace = read(FULL)[name]
    compare(simulated(trace.parameters, trace.time, trace.inputs), trace, residual)


@every_envelope
def test_roots_give_the_trace(name: str, residual: Residual) -> None:
    compare(make_envelope(name).outputs, read(ENVELOPE)[name], residual)


@every_sensor
def test_transfer_functions_give_the_trace(name: str, residual: Residual) -> None:
    # Whether the FMU gives it is replayed where all FMUs are (tests/fmu/test_reference_traces.py).
    compare(make_sensor(name).outputs, read(SENSOR)[name], residual)


@every_trace
@pytest.mark.parametrize("version", [2, 3], ids=["fmi2", "fmi3"])
def test_fmu_gives_the_trace(name: str, version: int, runners: dict[int, Runner], residual: Residual) -> None:
    trace = read(FULL)[name]
    compare(runners[version].run(trace.parameters, trace.time, trace.inputs), trace, residual)


@every_envelope
def test_envelope_fmu_gives_the_trace(name: str, envelope: RestingRunner, residual: Residual) -> None:
    trace = read(ENVELOPE)[name]
    names = tuple(trace.outputs)
    compare(envelope.run(trace.parameters, trace.time, trace.inputs, names), trace, residual)


@every_trace
def test_the_files_say_how_they_are_made(name: str) -> None:
    trace = read(FULL)[name]
    assert trace.parameters == parameters_of(name)
    assert all(t.reason and 0 < t.relative < 1e-10 for t in trace.tolerances.values())
    # An effect that left no mark on its trace would not be tested by it.
    if name != "plain":
        plain = read(FULL)["plain"].outputs
        marks = [np.max(np.abs(trace.outputs[c] - plain[c])) / np.max(np.abs(plain[c])) for c in plain]
        assert max(marks) > 1e-3


def test_no_trace_is_left_over() -> None:
    for form, cases in ((FULL, CASES), (ENVELOPE, ENVELOPE_CASES), (SENSOR, SENSOR_CASES)):
        names = {f"{case}{end}" for case in cases for end in (".ssv", "_in.csv", "_ref.csv")} | {"experiments.exp"}
        assert {path.name for path in (FOLDER / form).iterdir()} == names
