"""Extended Kalman filter for the state, the angular rate and the seven parameters.

SYSTEM.md section 2 (source 000, eqs. 3-4), with the sensor known: sensitivity, gap, noise.
"""

from typing import Final

from numba import njit

from cosim.observers.adaptive import start_filter, step_filter
from cosim.observers.adaptive_layout import MEMORY_SIZE, PLAIN, SETTINGS
from cosim.observers.record import INIT_SIGNATURE, STEP_SIGNATURE, Observer


@njit(INIT_SIGNATURE, cache=True)
def _init(memory, settings, start, start_deviation, sensor, period):  # type: ignore[no-untyped-def]
    start_filter(memory, settings, start, start_deviation, sensor, period, PLAIN)


@njit(STEP_SIGNATURE, cache=True)
def _step(memory, settings, u_x, u_y, v_x, v_y, estimate, deviation):  # type: ignore[no-untyped-def]
    step_filter(memory, settings, u_x, u_y, v_x, v_y, estimate, deviation, PLAIN)


OBSERVER: Final = Observer("ekf", MEMORY_SIZE, SETTINGS, _init, _step)
