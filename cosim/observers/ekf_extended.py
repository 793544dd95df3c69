"""Extended Kalman filter that also estimates the defects of the pickoff and the amplifier.

Offset and drift of either axis, the ratio of the two sense gains, the mismatch of the capacitor
pair and the gap. The common gain is a gauge (SYSTEM.md section 1): lengths, m, k and d are those of
the nominal `sense_gain_x`; k/m, d/m, omega_z and the angle don't depend on it.
estimate[OFFSET_X], estimate[OFFSET_Y] are the offsets at t_k, drift included.
"""

from typing import Final

from numba import njit

from cosim.observers.adaptive import start_filter, step_filter
from cosim.observers.adaptive_layout import EXTENDED, EXTENDED_SETTINGS, MEMORY_SIZE
from cosim.observers.record import INIT_SIGNATURE, STEP_SIGNATURE, Observer


@njit(INIT_SIGNATURE, cache=True)
def _init(memory, settings, start, start_deviation, sensor, period):  # type: ignore[no-untyped-def]
    start_filter(memory, settings, start, start_deviation, sensor, period, EXTENDED)


@njit(STEP_SIGNATURE, cache=True)
def _step(memory, settings, u_x, u_y, v_x, v_y, estimate, deviation):  # type: ignore[no-untyped-def]
    step_filter(memory, settings, u_x, u_y, v_x, v_y, estimate, deviation, EXTENDED)


OBSERVER: Final = Observer("ekf_extended", MEMORY_SIZE, EXTENDED_SETTINGS, _init, _step)
