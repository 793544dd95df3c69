"""The speed of the closed loop: what a sample costs, and whose share it is; against real time; and against a Python
loop over fmpy's classes with the same observer and controller."""

import ctypes
import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Final, NamedTuple

import numpy as np
from numba import carray, cfunc, types
from numpy.typing import NDArray

from benchmarks.fmpy_plant import fmpy_slave
from benchmarks.report import Row, row
from cosim.compiled_loop import PLANT_INPUTS, CompiledLoop, parts_of
from cosim.core.library import CONTROL_NAMES, pointer
from cosim.fmu import OUTPUT_NAMES, Plant, open_plant
from cosim.master import simulate
from cosim.run import Run
from cosim.running import Part
from gyro_model.build import build
from gyrotwin.tasks.run import Request, prepare

Floats = NDArray[np.float64]

REAL_TIME: Final = 1.5
CASES: Final = (("ekf", "plain"), ("ekf", "lab"), ("ekf", "sensing_defects"), ("lyapunov", "plain"))
"""Observer and design."""
REPEATS: Final = 7
SETTLING: Final = 40_000
"""Samples before a sample is timed, 0.2 s: the start, which is filtered several times over, is behind."""
TIMED: Final = 40_000
COMPARED: Final = 4000
"""Samples of a repeat in the comparison with Python, 20 ms."""


class Share(NamedTuple):
    """Time of a sample [us]: the whole and its parts."""

    whole: float
    plant: float
    observer: float
    controller: float


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
    """Real-time factors on one core, and the ratio to the loop over fmpy's classes."""
    rows = []
    with one_core():
        for observer, design in CASES:
            rows += _real_time_rows(observer, design, duration, repeats)
        rows += _ratio_rows(repeats)
    return rows


def sample_rows(timed: int = TIMED, settling: int = SETTLING, repeats: int = REPEATS) -> list[Row]:
    """Time of a sample in steady state on one core, median over ``repeats``, and the shares of plant, observer and
    controller."""
    rows = []
    with one_core():
        for observer, design in CASES:
            run = prepare(Request("constant", observer=observer, design=design))
            found = [share_of(run, timed, settling) for _ in range(repeats)]
            middle = Share(*map(float, np.median(found, axis=0)))
            note = f"least {min(s.whole for s in found):.3g} µs; plant {middle.plant / middle.whole:.0%}, "
            note += f"observer {middle.observer / middle.whole:.0%}, controller {middle.controller / middle.whole:.0%}"
            rows.append(row(f"{observer}, {design}: a sample", "µs", middle._asdict(), note=note))
    return rows


def _real_time_rows(observer: str, design: str, duration: float, repeats: int) -> list[Row]:
    run = prepare(Request("constant", observer=observer, design=design, duration=duration))
    walls, processor = [], []
    for _ in range(repeats + 1):
        began = time.process_time()
        walls.append(duration / simulate(run).wall_time)
        processor.append(duration / (time.process_time() - began))
    walls, processor = walls[1:], processor[1:]  # the first compiles and warms up
    return [
        row(
            f"{observer}, {design}: real-time factor by the clock",
            "1",
            {"best": max(walls), "median": float(np.median(walls))},
            limit=REAL_TIME,
            at_least=True,
            note="loop, angle units and recording",
        ),
        row(
            f"{observer}, {design}: real-time factor by processor time",
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
    note = "the first 20 ms: plant, observer, controller, one row recorded"
    return [
        row("ekf, plain: a sample of the compiled loop", "µs", best, note=note),
        row("ekf, plain: a sample through fmpy's classes, same C", "µs", other, note="equal to the last bit"),
        row("ekf, plain: whole loop, fmpy's classes over compiled", "1", ratio),
    ]


class SteppedLoop:
    """The compiled loop of a run over a plant, block by block, without recorder and monitor."""

    def __init__(self, run: Run, plant: Plant) -> None:
        self.run, self.plant = run, plant
        self.loop = CompiledLoop(run, plant)
        self.first = 0

    def step(self, count: int) -> tuple[Floats, float]:
        """The rows of the next ``count`` samples, and the time that they took [s]."""
        rows = self.loop.rows(count)
        held = np.ascontiguousarray(self.run.scenario.inputs(self.first, count, self.run.period))
        began = time.perf_counter()
        done = self.loop.step(self.first, held, rows)
        spent = time.perf_counter() - began
        if done != count:
            raise RuntimeError(f"the plant stopped after {self.first + done} samples: {self.plant.complaint()}")
        self.first += count
        return rows, spent


def compiled_loop(run: Run, samples: int) -> tuple[Floats, float]:
    """Rows of the loop and the time of its one call [s]."""
    with stepped_plant(run) as plant:
        return SteppedLoop(run, plant).step(samples)


def stepped_plant(run: Run) -> Plant:
    """The plant of a run."""
    return open_plant(run.plant_parameters(), run.device.model, run.scenario.first_inputs(run.period))


def share_of(run: Run, timed: int, settling: int) -> Share:
    """What a sample costs in steady state, and whose share it is.

    The loop runs three times: whole; with an observer that only repeats the last estimate; and with a controller that
    repeats its last output besides. The differences are the shares; the loop itself and its rows count as plant.
    """
    with stepped_plant(run) as plant:
        loop = SteppedLoop(run, plant)
        last = parts_of(loop.step(settling)[0])[0][-1]
        whole = loop.step(timed)[1]
        observer = _repeating_observer(np.concatenate((last, loop.loop.deviation())))
        loop.loop.start(observer, loop.loop.controller)
        no_observer = loop.step(timed)[1]
        loop.loop.start(observer, _repeating_controller(np.zeros(len(CONTROL_NAMES))))
        plant_only = loop.step(timed)[1]
    scale = 1e6 / timed
    return Share(*(scale * t for t in (whole, plant_only, whole - no_observer, no_observer - plant_only)))


_REAL: Final = types.CPointer(types.float64)


def _repeating_observer(both: Floats) -> Part:
    """Writes the estimate and deviation of ``both``."""
    memory, size = both, len(both) // 2

    @cfunc(types.void(_REAL, _REAL, _REAL, _REAL, _REAL, _REAL))
    def repeat(address, u, v, inputs, estimate, deviation):  # type: ignore[no-untyped-def]
        kept = carray(address, (2 * size,))
        for i in range(size):
            estimate[i] = kept[i]
            deviation[i] = kept[size + i]

    return Part(repeat.address, memory, (repeat,))


def _repeating_controller(output: Floats) -> Part:
    memory, size = output, len(output)

    @cfunc(types.void(_REAL, types.float64, _REAL, _REAL, _REAL, _REAL))
    def repeat(address, t, estimate, deviation, inputs, control):  # type: ignore[no-untyped-def]
        kept = carray(address, (size,))
        for i in range(size):
            control[i] = kept[i]

    return Part(repeat.address, memory, (repeat,))


def fmpy_loop(run: Run, samples: int) -> tuple[Floats, float]:
    """The same rows from a Python loop over fmpy's classes, and its time [s]."""
    held = run.scenario.inputs(0, samples, run.period)
    with (
        fmpy_slave(build().fmi3, run.plant_parameters() | run.scenario.first_inputs(run.period)) as slave,
        stepped_plant(run) as plant,
    ):
        inputs = plant.value_references(PLANT_INPUTS).tolist()
        outputs = plant.value_references(OUTPUT_NAMES).tolist()
        return _python_loop(CompiledLoop(run, plant), run.period, slave, inputs, outputs, held)


def _python_loop(
    loop: CompiledLoop, period: float, slave: Any, inputs: list[int], outputs: list[int], held: Floats
) -> tuple[Floats, float]:
    observer, controller, size = loop.observer, loop.controller, len(loop.lib.estimate_names)
    observe = ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * 6)(observer.address)
    act = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_double, *[ctypes.c_void_p] * 4)(controller.address)
    rows = np.zeros((len(held), loop.width))
    estimate, deviation, control = np.zeros(size), np.zeros(size), np.zeros(len(CONTROL_NAMES))
    u, v, measured = np.zeros(2), np.zeros(2), np.zeros(6)
    own, own_controller = pointer(observer.memory), pointer(controller.memory)
    at = tuple(map(pointer, (u, v, measured, estimate, deviation, control)))
    out = slave.getFloat64(outputs)
    began = time.perf_counter()
    for k, values in enumerate(held):
        v[:] = out[:2]
        # What is measured at t_k was held until then; both temperatures follow it at once.
        measured[:4] = held[max(k - 1, 0), 1:]
        measured[4:] = measured[0]
        observe(own, at[0], at[1], at[2], at[3], at[4])
        act(own_controller, k * period, at[3], at[4], at[2], at[5])
        rows[k] = (*estimate, *control, *out)
        u[:] = control[:2]
        slave.setFloat64(inputs, [*u.tolist(), *values.tolist()])
        slave.doStep(k * period, period)
        out = slave.getFloat64(outputs)
    return rows, time.perf_counter() - began
