"""What an observer is: a record of two compiled functions on flat arrays."""

from collections.abc import Callable
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

INIT_SIGNATURE: Final = "void(f8[::1], f8[::1], f8[::1], f8[::1], f8[::1], f8)"
STEP_SIGNATURE: Final = "void(f8[::1], f8[::1], f8, f8, f8, f8, f8[::1], f8[::1])"

SENSE_GAIN_X: Final = 0
SENSE_GAIN_Y: Final = 1
NOISE_RMS: Final = 2
INVERSE_GAP: Final = 3
SENSES_VELOCITY: Final = 4
SENSOR_SIZE: Final = 5
"""Length of `sensor`: the two gains [V/m, or V s/m], noise [V rms a sample], 1/g [1/m], 0 or 1."""


class Observer(NamedTuple):
    """An observer; `init` and `step` are compiled with INIT_SIGNATURE and STEP_SIGNATURE.

    init(memory, settings, start, start_deviation, sensor, period): `start` and `start_deviation`
        are first estimates and their standard deviations in the order of cosim.layout.
    step(memory, settings, u_x, u_y, v_x, v_y, estimate, deviation): at t_k; u is the force [N]
        held over [t_{k-1}, t_k) (ignored at k = 0), v is sample k [V]. Writes the estimate and its
        standard deviation at t_k and allocates nothing.
    """

    name: str
    memory_size: int
    settings: dict[str, float]
    init: Callable[..., None]
    step: Callable[..., None]

    def settings_array(self, **changes: float) -> npt.NDArray[np.float64]:
        """Return the settings as the flat array of `init` and `step`, with `changes` made.

        Raises ValueError for a name that the observer does not have.
        """
        return settings_array(self.name, self.settings, changes)


def settings_array(owner: str, defaults: dict[str, float], changes: dict[str, float]) -> npt.NDArray[np.float64]:
    """Return the values of `defaults` with `changes` made, in the order of `defaults`."""
    for name, value in changes.items():
        if name not in defaults:
            known = ", ".join(defaults)
            raise ValueError(f"{owner} has no setting '{name}' (= {value}); it has: {known}")
        if not np.isfinite(value):
            raise ValueError(f"{owner}: setting '{name}' is {value}; give a finite number")
    return np.array([changes.get(name, value) for name, value in defaults.items()], dtype=float)
