"""The compiled loop over a plant: observer, controller and plant stepped sample by sample in one call."""

import ctypes
from typing import Final

import numpy as np
from numpy.typing import NDArray

from cosim.core.library import CONTROL_NAMES, Library, pointer
from cosim.fmu import GET, INSTANCE, OUTPUT_NAMES, SET, STEP, Plant
from cosim.run import Run
from cosim.running import Part, begin_controller, begin_observer, design_for, known_values
from cosim.scenarios import INPUT_NAMES
from gyro_model import symbols
from gyro_model.anatomy import Follow

Floats = NDArray[np.float64]

PLANT_INPUTS: Final = ("u_x", "u_y", *INPUT_NAMES)
"""What the loop sets at a sample, in its order: the commands and the inputs of the scenario."""
CACHE_LINE: Final = 64
"""Bytes of a line of the cache of usual processors."""


class CompiledLoop:
    """The loop of a run over its plant, which must stay open.

    ``lib``: the compiled library; ``observer`` and ``controller`` at work; ``width``: length of a row, which holds
    estimates, what the controller gives (CONTROL_NAMES) and the plant's outputs (OUTPUT_NAMES).
    """

    def __init__(self, run: Run, plant: Plant) -> None:
        self._run, self._plant = run, plant
        self.lib: Library
        self.lib, self.observer = begin_observer(run.observer, run.design, run.period, run.observer_settings())
        self._design = design_for(run.observer, run.design)
        self.controller = begin_controller(
            run.controller, self._design, self.lib, run.period, run.controller_settings()
        )
        self.width = len(self.lib.estimate_names) + len(CONTROL_NAMES) + len(OUTPUT_NAMES)
        self._memory = self.lib.memory("loop")
        self.start(self.observer, self.controller)

    def start(self, observer: Part, controller: Part) -> None:
        """Puts these to work from the next sample on."""
        self.observer, self.controller = observer, controller
        inputs = self._plant.value_references(PLANT_INPUTS)
        outputs = self._plant.value_references(OUTPUT_NAMES)
        known, lags = known_values(self._design, self.lib, self._run.period), _temperature_lags(self._run)
        self.lib.call.core_loop_start(
            pointer(self._memory),
            *(ctypes.c_void_p(int(self._plant.handle[slot])) for slot in (INSTANCE, SET, STEP, GET)),
            pointer(inputs),
            pointer(outputs),
            ctypes.c_void_p(observer.address),
            pointer(observer.memory),
            ctypes.c_void_p(controller.address),
            pointer(controller.memory),
            pointer(known),
            ctypes.c_double(self._run.period),
            pointer(lags),
        )

    def rows(self, count: int) -> Floats:
        """Room for ``count`` rows, shape (count, width), which stands column after column: what reads them reads
        columns."""
        line = CACHE_LINE // np.dtype(float).itemsize
        # Odd: the columns of a sample would share a few places of the cache, and push each other out.
        return np.empty((self.width, (-(-count // line) | 1) * line))[:, :count].T

    def step(self, first: int, held: Floats, rows: Floats) -> int:
        """Runs the samples from ``first`` on and fills ``rows``, of those that ``rows`` makes; returns after how many
        the plant went on.

        ``held`` (n, 5): the inputs besides the force. Fewer than n samples: the plant refused the next. Raises
        InputError where an observer or controller of one's own has raised.
        """
        count, (along, apart) = len(held), rows.strides
        if rows.shape[0] < count or rows.shape[1] != self.width or along != rows.itemsize:
            raise ValueError(f"rows: shape {rows.shape}, strides {rows.strides}; take them from CompiledLoop.rows")
        samples = ctypes.c_int64(first), ctypes.c_int64(count)
        place = ctypes.c_void_p(rows.ctypes.data), ctypes.c_int64(apart // rows.itemsize)
        done = int(self.lib.call.core_loop_run(pointer(self._memory), *samples, pointer(held), *place))
        self.observer.complain()
        self.controller.complain()
        return done

    def deviation(self) -> Floats:
        """Standard deviations of the last estimates, by ``Library.estimate_names``."""
        found = np.empty(len(self.lib.estimate_names))
        self.lib.call.core_loop_deviation(pointer(self._memory), pointer(found))
        return found


def parts_of(rows: Floats) -> tuple[Floats, Floats, Floats]:
    """Estimates, what the controller gives, and outputs of the plant, of rows of a loop."""
    last = rows.shape[1] - len(OUTPUT_NAMES)
    first = last - len(CONTROL_NAMES)
    return rows[:, :first], rows[:, first:last], rows[:, last:]


def _temperature_lags(run: Run) -> Floats:
    """Time constants that the design knows of the temperatures of structure and circuit [s]."""
    values = run.design.all_values
    acting = [e for e in run.design.known_model.dynamics.effects if isinstance(e, Follow)]
    constants = {target: values[constant.name] for e in acting for target, constant in e.follows.items()}
    return np.array([constants.get(target, 0.0) for target in symbols.SET_BY])
