"""The co-simulation master: plant, observer and controller for a run, stepped block by block in C, and judged after
each block."""

import time
from typing import Final

from cosim.compiled_loop import CompiledLoop
from cosim.fmu import Plant, open_plant
from cosim.monitor import Monitor
from cosim.recorder import Recorder, Result
from cosim.run import Run
from gyro_model.progress import Progress

BLOCK_DURATION: Final = 0.005
"""Length of a block [s]: the flag is set and withdrawn at its end; Ctrl-C is heard and progress told."""
GATHERED: Final = 16_000
"""Samples whose inputs are made at once, and which are recorded at once, in whole blocks: of a few, calls would take
longer than what they do; of more, the rows, of some 60 numbers, would take more than 8 MB."""


def simulate(run: Run, progress: Progress | None = None) -> Result:
    """Runs the loop to its end, or to where the plant could not go on; the result says which.

    Raises InputError where the FMU refuses a parameter.
    """
    parameters = run.plant_parameters()
    with open_plant(parameters, run.device.model, run.scenario.first_inputs(run.period)) as plant:
        return _simulate(run, plant, progress)


def _simulate(run: Run, plant: Plant, progress: Progress | None) -> Result:
    loop = CompiledLoop(run, plant)
    settings, tones = run.monitor_settings(), run.told_tones()
    monitor = Monitor(run.observer, run.design, loop.lib, loop.observer, run.period, settings, tones)
    recorder = Recorder(run, loop.lib, monitor)
    size = max(round(BLOCK_DURATION * run.sample_rate), 1)
    rows = loop.rows(min(max(GATHERED // size, 1) * size, run.samples))
    clock = _Clock()
    for begun in range(0, run.samples, len(rows)):
        inputs = run.scenario.inputs(begun, min(len(rows), run.samples - begun), run.period)
        for place in range(0, len(inputs), size):
            held = inputs[place : place + size]
            first, count = begun + place, len(held)
            done = loop.step(first, held, rows[place : place + count])
            # The sample before a step that the plant refuses was still taken, even the first of the run.
            taken = min(done + 1, count)
            recorder.judge(first, rows[place : place + taken], held[:taken], loop.deviation())
            clock.tick(taken)
            if done < count:
                recorder.stop((first + done) * run.period, plant.complaint())
                break
            if progress is not None:
                progress((first + count) * run.period, run.duration)
        recorder.keep(begun, rows[: place + taken], inputs[: place + taken])
        if done < count:
            break
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
        pace = (self._times[-1] - self._times[first]) / max(self._counts[-1] - self._counts[first], 1)
        return pace * self._counts[-1]
