"""What an observer is: a record of two compiled functions on flat arrays, or one of the loop's own in C."""

from collections.abc import Callable, Mapping
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from gyro_model.errors import InputError, nearest

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

    What the design knows beyond springs and dampers (delay, actuators, pickoff, amplifier) is taken out of u and v
    before the observer sees them.
    """

    name: str
    memory_size: int
    settings: dict[str, float]
    init: Callable[..., None]
    step: Callable[..., None]

    def settings_array(self, **changes: float) -> npt.NDArray[np.float64]:
        """Return the settings as the flat array of `init` and `step`, with `changes` made.

        Raises InputError for a name that the observer does not have.
        """
        return settings_array(self.name, self.settings, changes)


class CoreObserver(NamedTuple):
    """The loop's own observer, in C (cosim/core/filter.c): it estimates whatever the design says."""

    name: str
    settings: Mapping[str, float]
    limits: Mapping[str, tuple[float, float]]

    def settings_array(self, **changes: float) -> npt.NDArray[np.float64]:
        """Return the settings in their order, with `changes` made. Raises InputError for an unknown name, and for a
        value beyond what the memory of the C is made for."""
        return limited_settings_array(self.name, self.settings, changes, self.limits)


def limited_settings_array(
    owner: str,
    defaults: Mapping[str, float],
    changes: Mapping[str, float],
    limits: Mapping[str, tuple[float, float]],
) -> npt.NDArray[np.float64]:
    """As ``settings_array``; raises InputError for a value beyond ``limits`` too."""
    values = settings_array(owner, defaults, changes)
    for name, (low, high) in limits.items():
        value = changes.get(name, low)
        if not low <= value <= high:
            raise InputError(f"{owner}: setting {name} = {value:g}: give {low:g} to {high:g}")
    return values


def settings_array(owner: str, defaults: Mapping[str, float], changes: Mapping[str, float]) -> npt.NDArray[np.float64]:
    """Return the values of `defaults` with `changes` made, in the order of `defaults`."""
    for name, value in changes.items():
        if name not in defaults:
            raise InputError(f"{owner} has no setting {name!r} (= {value}){nearest(name, defaults)}")
        if not np.isfinite(value):
            raise InputError(f"{owner}: setting {name!r} is {value}; give a finite number")
    return np.array([changes.get(name, value) for name, value in defaults.items()], dtype=float)
