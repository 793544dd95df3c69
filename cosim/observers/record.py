"""What an observer is: a record of two compiled functions on flat arrays, or one of the loop's own in C."""

from collections.abc import Callable, Mapping
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from cosim.setting import Setting, Table, complete

INIT_SIGNATURE: Final = "void(f8[::1], f8[::1], f8[::1], f8[::1], f8[::1], f8)"
STEP_SIGNATURE: Final = "void(f8[::1], f8[::1], f8, f8, f8, f8, f8[::1], f8[::1])"

SENSE_GAIN_X: Final = 0
SENSE_GAIN_Y: Final = 1
NOISE_RMS: Final = 2
INVERSE_GAP: Final = 3
SENSES_VELOCITY: Final = 4
SENSOR_SIZE: Final = 5
"""Length of `sensor`: the two gains [V/m, or V s/m], noise [V rms a sample], 1/g [1/m] (0: what is known of the gap is
taken out of the voltage beforehand), 0 or 1."""


class Observer(NamedTuple):
    """An observer of one's own; `init` and `step` are compiled with numba with INIT_SIGNATURE and STEP_SIGNATURE.

    init(memory, settings, start, start_deviation, sensor, period): `start` and `start_deviation`
        begin with first estimates and their standard deviations in the order of cosim.layout; zeros follow.
    step(memory, settings, u_x, u_y, v_x, v_y, estimate, deviation): at t_k; u is the force [N]
        held over [t_{k-1}, t_k) (ignored at k = 0), v is sample k [V]. Writes the estimate and its
        standard deviation at t_k, in the same order, and allocates nothing.

    settings: their defaults by name, or each as a Setting, which also says what it can be.

    What the design knows beyond springs and dampers (delay, actuators, pickoff, amplifier) is taken out of u and v
    before the observer sees them.
    """

    name: str
    memory_size: int
    settings: Mapping[str, float | Setting]
    init: Callable[..., None]
    step: Callable[..., None]

    def settings_array(self, **changes: float) -> npt.NDArray[np.float64]:
        """Return the settings as the flat array of `init` and `step`, with `changes` made.

        Raises InputError for a name that the observer does not have, and for a value that can't be.
        """
        return settings_array(self.name, self.settings, changes)


class CoreObserver(NamedTuple):
    """The loop's own observer, in C (cosim/core/filter.c): it estimates whatever the design says. check: of what its
    settings must be together, InputError where they are not."""

    name: str
    settings: Table
    check: Callable[[Mapping[str, float]], None]

    def settings_array(self, **changes: float) -> npt.NDArray[np.float64]:
        """Return the settings in their order, with `changes` made. Raises InputError for an unknown name, and for
        values that can't be."""
        values = complete(self.name, self.settings, changes)
        self.check(values)
        return np.array(list(values.values()))


def settings_array(
    owner: str, settings: Mapping[str, float | Setting], changes: Mapping[str, float]
) -> npt.NDArray[np.float64]:
    """Return the values of `settings` with `changes` made, in their order. Raises InputError for an unknown name, and
    for a value that can't be."""
    table = {name: given if isinstance(given, Setting) else Setting(given) for name, given in settings.items()}
    return np.array(list(complete(owner, table, changes).values()), dtype=float)
