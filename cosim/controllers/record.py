"""What a controller is: a record of two compiled functions on flat arrays, or the loop's own in C."""

from collections.abc import Callable, Mapping
from math import inf
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from cosim.observers.record import settings_array
from cosim.setting import Setting, Table, complete

INIT_SIGNATURE: Final = "void(f8[::1], f8[::1], f8)"
STEP_SIGNATURE: Final = "void(f8[::1], f8[::1], f8, f8[::1], f8[::1], f8[::1])"

FORCE_X: Final = 0
FORCE_Y: Final = 1
CONVERGED: Final = 2
CONVERGED_AT: Final = 3
FORCED: Final = 4
OMEGA_SQUARED: Final = 8
OUTPUT_SIZE: Final = 9
"""Length of `output`: u_x, u_y [N], two numbers that are not used (the loop itself judges convergence), the forced
response x, x', y, y' [m, m/s] to the tones at t_k, omega^2 = k / m of the isotropic oscillator [1/s^2]."""


class Controller(NamedTuple):
    """A controller of one's own; `init` and `step` are compiled with numba with INIT_SIGNATURE and STEP_SIGNATURE.

    init(memory, settings, period); step(memory, settings, t, estimate, deviation, output): at t_k
    [s], after the observer's correction with sample k, sets the force for [t_k, t_{k+1}).
    """

    name: str
    memory_size: int
    settings: Mapping[str, float | Setting]
    init: Callable[..., None]
    step: Callable[..., None]

    def settings_array(self, **changes: float) -> npt.NDArray[np.float64]:
        """Return the settings as the flat array of `init` and `step`, with `changes` made.

        Raises InputError for a name that the controller does not have, and for a value that can't be.
        """
        return settings_array(self.name, self.settings, changes)


class CoreController(NamedTuple):
    """The loop's own controller, in C (cosim/core/foucault.c). check: of what its settings must be together, at a
    sample rate [Hz]; InputError where they are not."""

    name: str
    settings: Table
    check: Callable[[Mapping[str, float], float], None]

    def settings_array(self, sample_rate: float = inf, **changes: float) -> npt.NDArray[np.float64]:
        """Return the settings in their order, with `changes` made. Raises InputError for an unknown name, and for
        values that can't be, or not at `sample_rate` [Hz]."""
        values = complete(self.name, self.settings, changes)
        self.check(values, sample_rate)
        return np.array(list(values.values()))
