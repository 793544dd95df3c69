"""The speed of the closed loop: against real time, and against a Python loop over fmpy's classes with the same compiled
observer and controller."""

import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.fmpy_plant import fmpy_slave
from benchmarks.report import Row, row
from cosim import loop
from cosim.controllers.record import FORCE_X, OUTPUT_SIZE
from cosim.fmu import INPUT_NAMES, OUTPUT_NAMES, Plant
from cosim.layout import ESTIMATE_SIZE
from cosim.master import simulate
from cosim.run import Run
from gyro_model.build import build
from gyrotwin.run import Request, prepare

Floats = NDArray[np.float64]

REAL_TIME: Final = 1.5
OBSERVERS: Final = ("ekf", "lyapunov", "ekf_extended")
REPEATS: Final = 7
COMPARED: Final = 4000
"""Samples of a repeat in the comparison, 20 ms."""


class _Memories(NamedTuple):
    observer: Floats
    observer_settings: Floats
    controller: Floats
    controller_settings: Floats


@contextmanager
def one_core() -> Iterator[None]:
    """Holds this process on one core where the system can."""
    if not hasattr(os, "sched_setaffinity"):
        yield
        return
    allowed = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {min(allowed)})
    try:
        yield
    finally:
        os.sched_setaffinity(0, allowed)


def closed_loop_rows(duration: float = 1.0, repeats: int = REPEATS) -> list[Row]:
    """Real-time factors of every observer on one core, and the ratio to the loop over fmpy's classes."""
    rows = []
    with one_core():
        for observer in OBSERVERS:
            rows += _real_time_rows(observer, duration, repeats)
        rows += _ratio_rows(repeats)
    return rows


def _real_time_rows(observer: str, duration: float, repeats: int) -> list[Row]:
    run = prepare(Request("constant", observer=observer, duration=duration))
    walls, processor = [], []
    for _ in range(repeats):
        began = time.process_time()
        walls.append(duration / simulate(run).wall_time)
        processor.append(duration / (time.process_time() - began))
    walls, processor = walls[1:], processor[1:]  # the first compiles and warms up
    note = "loop, angle units and recording" if observer != "ekf_extended" else "the observer of --sensing-defects"
    return [
        row(
            f"{observer}: real-time factor by the clock",
            "1",
            {"best": max(walls), "median": float(np.median(walls))},
            limit=REAL_TIME,
            at_least=True,
            note=note,
        ),
        row(
            f"{observer}: real-time factor by processor time",
            "1",
            {"best": max(processor), "median": float(np.median(processor))},
            note="with the start of the FMU and the Cramér–Rao bound along the run",
        ),
    ]


def _ratio_rows(repeats: int) -> list[Row]:
    """Time of a sample [us] in both loops, in turns."""
    run = prepare(Request("constant"))
    compiled, python = [], []
    for _ in range(repeats):
        rows, spent = compiled_loop(run, COMPARED)
        compiled.append(1e6 * spent / COMPARED)
        same, spent = fmpy_loop(run, COMPARED)
        python.append(1e6 * spent / COMPARED)
        if not np.array_equal(rows, same, equal_nan=True):
            raise RuntimeError("the two loops differ: the ratio of their times would mean nothing")
    best = {"best": min(compiled), "median": float(np.median(compiled))}
    other = {"best": min(python), "median": float(np.median(python))}
    ratio = {column: other[column] / best[column] for column in best}
    return [
        row("ekf: a sample of the compiled loop", "µs", best, note="plant, observer, controller, one row recorded"),
        row("ekf: a sample through fmpy's classes, same compiled numerics", "µs", other, note="equal to the last bit"),
        row("ekf: whole loop, fmpy's classes over compiled", "1", ratio),
    ]


def _memories(run: Run) -> _Memories:
    observer, controller = run.observer, run.controller
    memories = _Memories(
        np.zeros(observer.memory_size),
        observer.settings_array(),
        np.zeros(controller.memory_size),
        run.controller_settings(),
    )
    controller.init(memories.controller, memories.controller_settings, run.period)
    observer.init(memories.observer, memories.observer_settings, *run.first_estimate(), run.sensor(), run.period)
    return memories


def compiled_loop(run: Run, samples: int) -> tuple[Floats, float]:
    """Rows of cosim.loop and the time of its one call [s]."""
    rows = np.zeros((samples, loop.ROW_SIZE))
    own = _memories(run)
    omega_z = run.scenario.omega_z(0, samples, run.period)
    with Plant(build().fmi3, run.plant_parameters()) as plant:
        border = np.zeros(len(INPUT_NAMES)), plant.get(OUTPUT_NAMES)
        observer = (run.observer.step, own.observer, own.observer_settings)
        controller = (run.controller.step, own.controller, own.controller_settings)
        began = time.perf_counter()
        loop.run_block(
            plant.handle, plant.inputs, plant.outputs, *observer, *controller, 0, run.period, omega_z, *border, rows
        )
        return rows, time.perf_counter() - began


def fmpy_loop(run: Run, samples: int) -> tuple[Floats, float]:
    """The same rows from a Python loop over fmpy's classes, and its time [s]."""
    path, own = build().fmi3, _memories(run)
    omega_z = run.scenario.omega_z(0, samples, run.period).tolist()
    with Plant(path, run.plant_parameters()) as plant, fmpy_slave(path, run.plant_parameters()) as slave:
        return _python_loop(run, own, slave, plant.inputs.tolist(), plant.outputs.tolist(), omega_z)


def _python_loop(
    run: Run, own: _Memories, slave: Any, inputs: list[int], outputs: list[int], omega_z: list[float]
) -> tuple[Floats, float]:
    rows = np.zeros((len(omega_z), loop.ROW_SIZE))
    estimate, deviation, control = np.zeros(ESTIMATE_SIZE), np.zeros(ESTIMATE_SIZE), np.zeros(OUTPUT_SIZE)
    period, observe, act = run.period, run.observer.step, run.controller.step
    u_x, u_y = 0.0, 0.0
    out = slave.getFloat64(outputs)
    began = time.perf_counter()
    for k, rate in enumerate(omega_z):
        t = k * period
        observe(own.observer, own.observer_settings, u_x, u_y, out[0], out[1], estimate, deviation)
        act(own.controller, own.controller_settings, t, estimate, deviation, control)
        row_ = rows[k]
        row_[loop.ESTIMATE : loop.DEVIATION] = estimate
        row_[loop.DEVIATION : loop.CONTROL] = deviation
        row_[loop.CONTROL : loop.PLANT] = control
        row_[loop.PLANT :] = out
        u_x, u_y = control[FORCE_X], control[FORCE_X + 1]
        slave.setFloat64(inputs, [u_x, u_y, rate])
        slave.doStep(t, period)
        out = slave.getFloat64(outputs)
    return rows, time.perf_counter() - began
