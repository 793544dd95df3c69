"""What a step of the plant costs: from the compiled loop, from C, and through fmpy's classes; and the closed loop."""

import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
from numba import njit

from benchmarks.c_driver import CPlant, CPlants
from benchmarks.closed_loop import closed_loop_rows, sample_rows
from benchmarks.fmpy_plant import fmpy_slave
from benchmarks.report import Options, Report, Row, Table, load, row
from cosim.exchange import exchange
from cosim.fmu import HANDLE_SIZE, INPUT_NAMES, OUTPUT_NAMES, Plant
from gyro_model.build import build
from gyro_model.device import load_device

STEPS: Final = ((5e-6, 5e-6), (5e-6, 1e-6), (1e-6, 1e-6))
"""Communication step and internal step [s]; the first is what the loop uses at 200 kHz."""
CALLS: Final = 40_000
"""Of compiled code in one repeat; fmpy makes a fiftieth of it, in about the same time."""
SLOWER: Final = 50
REPEATS: Final = 21
OVER_C: Final = 1.1
OVER_FMPY: Final = 30.0

Drive = Callable[[int, int], int]
"""(first step, number of steps) -> number done."""


class Ways(NamedTuple):
    """The three ways to call the same plant."""

    loop: Drive
    c: Drive
    fmpy: Drive


@njit(cache=True)
def _drive(handle, inputs, input_values, outputs, output_values, flags, first, count, step):  # type: ignore[no-untyped-def]
    for k in range(count):
        if exchange(handle, inputs, input_values, outputs, output_values, flags, (first + k) * step, step) > 0:
            return k
    return count


@contextmanager
def ways(step: float, internal_step: float) -> Iterator[Ways]:
    """The reference device, ready to be stepped by ``step`` in three ways, each with an instance of its own."""
    parameters = {**load_device("reference").parameters, "x_start": 1e-6}
    parameters |= {"internal_step": internal_step, "sample_period": 5e-6}
    path = build().fmi3
    with ExitStack() as stack:
        plant = stack.enter_context(Plant(path, parameters))
        plants = stack.enter_context(CPlants(path))
        still = {name: np.zeros(1) for name in INPUT_NAMES}
        yield Ways(
            _from_loop(plant, step),
            _from_c(stack.enter_context(plants.start(parameters, still, step))),
            stack.enter_context(_from_fmpy(plant, path, parameters, step)),
        )


def _from_loop(plant: Plant, step: float) -> Drive:
    values = np.zeros(len(INPUT_NAMES)), np.zeros(len(OUTPUT_NAMES)), np.zeros(HANDLE_SIZE)

    def drive(first: int, count: int) -> int:
        return int(
            _drive(plant.handle, plant.inputs, values[0], plant.outputs, values[1], values[2], first, count, step)
        )

    return drive


def _from_c(plant: CPlant) -> Drive:
    return lambda first, count: plant(count)


@contextmanager
def _from_fmpy(plant: Plant, path: Path, parameters: Mapping[str, float], step: float) -> Iterator[Drive]:
    with fmpy_slave(path, parameters) as slave:
        inputs, outputs = plant.inputs.tolist(), plant.outputs.tolist()
        zeros = [0.0] * len(inputs)

        def drive(first: int, count: int) -> int:
            for k in range(first, first + count):
                slave.setFloat64(inputs, zeros)
                slave.doStep(k * step, step)
                slave.getFloat64(outputs)
            return count

        yield drive


def measure(step: float, internal_step: float, calls: int, repeats: int) -> dict[str, list[float]]:
    """Time of a call [ns] by way, one value a repeat; the ways take turns, so that a busy moment meets all."""
    times: dict[str, list[float]] = {name: [] for name in Ways._fields}
    with ways(step, internal_step) as every:
        done = dict.fromkeys(Ways._fields, 0)
        for repeat in range(repeats + 1):
            for name, drive in every._asdict().items():
                count = calls // SLOWER if name == "fmpy" else calls
                began = time.perf_counter()
                if drive(done[name], count) != count:
                    raise RuntimeError(f"the plant stopped ({name})")
                spent = time.perf_counter() - began
                done[name] += count
                if repeat > 0:  # the first compiles and warms up
                    times[name].append(1e9 * spent / count)
    return times


def plant_rows(calls: int, repeats: int) -> list[Row]:
    """Times by way, and their ratios, of minima and of medians."""
    rows = []
    for step, internal in STEPS:
        times = measure(step, internal, calls, repeats)
        best = {name: min(values) for name, values in times.items()}
        middle = {name: float(np.median(values)) for name, values in times.items()}
        label = f"step {1e6 * step:g} µs, internal {1e6 * internal:g} µs"
        for name, said in (("loop", "compiled loop"), ("c", "C driver"), ("fmpy", "fmpy's classes")):
            rows.append(row(f"{label}: {said}", "ns", {"of minima": best[name], "of medians": middle[name]}))
        for name, what, limit in (("c", "loop over C driver", OVER_C), ("fmpy", "fmpy over loop", OVER_FMPY)):
            ratio = {"of minima": best["loop"] / best[name], "of medians": middle["loop"] / middle[name]}
            if name == "fmpy":
                ratio = {column: 1.0 / value for column, value in ratio.items()}
            crowded = name == "fmpy" and internal < step
            note = f"{step / internal:.0f} internal steps are most of the call, whoever calls" if crowded else ""
            rows.append(row(f"{label}: {what}", "1", ratio, limit=limit, at_least=name == "fmpy", note=note))
    return rows


def run(options: Options) -> Report:
    """Plant calls and the closed loop, in this one process."""
    before = load()
    tables = [
        Table("a plant call: set, step, get", plant_rows(CALLS, REPEATS)),
        Table("a sample of the closed loop, constant, one core", sample_rows()),
        Table("the closed loop, constant", closed_loop_rows()),
    ]
    notes = [
        f"{REPEATS} repeats of {CALLS} calls ({CALLS // SLOWER} through fmpy), the ways taking turns.",
        "The internal steps inside a call are the same work for all three ways; the loop takes one a sample at 200 kHz "
        "(first rows), and five where a delay or lag acts.",
        "Before: " + before,
        "After: " + load(),
    ]
    return Report("plant_call", "Plant call and closed loop", tables, notes)
