"""The co-simulation master: plant, observer and controller for a run, stepped block by block in C, and judged after
each block."""

import ctypes
import time
from collections.abc import Callable
from typing import Final

import numpy as np

from cosim.core.library import CONTROL_NAMES, pointer
from cosim.fmu import GET, INSTANCE, SET, STEP, Plant, open_plant
from cosim.monitor import Monitor
from cosim.recorder import Recorder, Result
from cosim.run import Run
from cosim.running import begin_controller, begin_observer, design_for, known_values
from cosim.scenarios import INPUT_NAMES
from gyro_model import symbols
from gyro_model.anatomy import Follow

Progress = Callable[[float, float], None]
"""Called with the time reached and the duration [s]."""

BLOCK_DURATION: Final = 0.005
"""Length of a block [s]: the flag is set and withdrawn at its end; Ctrl-C is heard and progress told."""
FORCE_NAMES: Final = ("u_x", "u_y")
OUTPUT_NAMES: Final = ("v_x", "v_y", "x", "x_dot", "y", "y_dot")


def simulate(run: Run, progress: Progress | None = None) -> Result:
    """Runs the loop to its end, or to where the plant could not go on; the result says which.

    Raises InputError where the FMU refuses a parameter.
    """
    parameters = run.plant_parameters()
    with open_plant(parameters, run.device.model, run.scenario.first_inputs(run.period)) as plant:
        return _simulate(run, plant, progress)


def _simulate(run: Run, plant: Plant, progress: Progress | None) -> Result:
    lib, observer = begin_observer(run.observer, run.design, run.period, run.observer_settings())
    design = design_for(run.observer, run.design)
    controller = begin_controller(run.controller, design, lib, run.period, run.controller_settings())
    monitor = Monitor(run.observer, run.design, lib, observer, run.period, run.monitor_settings())
    recorder = Recorder(run, lib, monitor)
    memory = lib.memory("loop")
    inputs = plant.value_references((*FORCE_NAMES, *INPUT_NAMES))
    outputs = plant.value_references(OUTPUT_NAMES)
    lags, known = _temperature_lags(run), known_values(design, lib, run.period)
    lib.call.core_loop_start(
        pointer(memory),
        *(ctypes.c_void_p(int(plant.handle[slot])) for slot in (INSTANCE, SET, STEP, GET)),
        pointer(inputs),
        pointer(outputs),
        ctypes.c_void_p(observer.address),
        pointer(observer.memory),
        ctypes.c_void_p(controller.address),
        pointer(controller.memory),
        pointer(known),
        ctypes.c_double(run.period),
        pointer(lags),
    )
    size = max(round(BLOCK_DURATION * run.sample_rate), 1)
    width = 2 * len(lib.estimate_names) + len(CONTROL_NAMES) + len(OUTPUT_NAMES)
    rows = np.empty((min(size, run.samples), width))
    clock = _Clock()
    for first in range(0, run.samples, size):
        count = min(size, run.samples - first)
        held = np.ascontiguousarray(run.scenario.inputs(first, count, run.period))
        done = lib.call.core_loop_run(
            pointer(memory), ctypes.c_int64(first), ctypes.c_int64(count), pointer(held), pointer(rows)
        )
        # The sample before a step that the plant refuses was still taken, even the first of the run.
        taken = min(done + 1, count)
        recorder.keep(first, rows[:taken], held[:taken])
        clock.tick(taken)
        if done < count:
            recorder.stop((first + done) * run.period, plant.complaint())
            break
        if progress is not None:
            progress((first + count) * run.period, run.duration)
    return recorder.result(clock.wall_time())


def _temperature_lags(run: Run) -> np.ndarray:
    """Time constants that the design knows of the temperatures of structure and circuit [s]."""
    values = run.design.all_values
    acting = [e for e in run.design.known_model.dynamics.effects if isinstance(e, Follow)]
    constants = {target: values[constant.name] for e in acting for target, constant in e.follows.items()}
    return np.array([constants.get(target, 0.0) for target in symbols.SET_BY])


class _Clock:
    """Wall time of the whole run at the pace after the first block, in which compiled code is still being loaded."""

    def __init__(self) -> None:
        self._times = [time.perf_counter()]
        self._counts = [0]

    def tick(self, count: int) -> None:
        """Another block of ``count`` samples is done."""
        self._times.append(time.perf_counter())
        self._counts.append(self._counts[-1] + count)

    def wall_time(self) -> float:
        """Wall time [s]."""
        first = 1 if len(self._times) > 2 else 0
        pace = (self._times[-1] - self._times[first]) / max(self._counts[-1] - self._counts[first], 1)
        return pace * self._counts[-1]
