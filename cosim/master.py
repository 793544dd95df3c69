"""The co-simulation master: plant, observer and controller for a run, stepped block by block."""

import time
from collections.abc import Callable
from typing import Final

import numpy as np

from cosim import loop
from cosim.fmu import INPUT_NAMES, OUTPUT_NAMES, Plant, open_plant
from cosim.recorder import Recorder, Result
from cosim.run import Run
from gyro_model.errors import InputError

Progress = Callable[[float, float], None]
"""Called with the time reached and the duration [s]."""

BLOCK_DURATION: Final = 0.02
"""Length of a block [s]: short enough for Ctrl-C and progress, long enough that Python's share of the time is small."""


def simulate(run: Run, progress: Progress | None = None) -> Result:
    """Runs the loop.

    Raises InputError where the FMU refuses a parameter, and where the run diverges, saying when and which state.
    """
    with open_plant(run.plant_parameters(), run.device.model) as plant:
        return _simulate(run, plant, progress)


def _simulate(run: Run, plant: Plant, progress: Progress | None) -> Result:
    recorder = Recorder(run)
    controller_settings = run.controller_settings()
    controller_memory = np.zeros(run.controller.memory_size)
    run.controller.init(controller_memory, controller_settings, run.period)
    observer_settings = run.observer.settings_array()
    observer_memory = np.zeros(run.observer.memory_size)
    run.observer.init(observer_memory, observer_settings, *run.first_estimate(), run.sensor(), run.period)

    size = max(round(BLOCK_DURATION * run.sample_rate), 1)
    input_values = np.zeros(len(INPUT_NAMES))
    output_values = plant.get(OUTPUT_NAMES)
    rows = np.empty((min(size, run.samples), loop.ROW_SIZE))
    clock = _Clock()
    for first in range(0, run.samples, size):
        count = min(size, run.samples - first)
        omega_z = run.scenario.omega_z(first, count, run.period)
        done = loop.run_block(
            plant.handle,
            plant.inputs,
            plant.outputs,
            run.observer.step,
            observer_memory,
            observer_settings,
            run.controller.step,
            controller_memory,
            controller_settings,
            first,
            run.period,
            omega_z,
            input_values,
            output_values,
            rows[:count],
        )
        if done < count:
            # A force that is no number comes from an estimate that is none.
            recorder.check(first, rows[: done + 1])
            raise InputError(f"run {plant.complaint()}")
        recorder.keep(first, rows[:count], omega_z)
        clock.tick(count)
        if progress is not None:
            progress((first + count) * run.period, run.duration)
    return recorder.result(clock.wall_time())


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
        pace = (self._times[-1] - self._times[first]) / (self._counts[-1] - self._counts[first])
        return pace * self._counts[-1]
