"""The compiled loop: plant, observer and controller, sample by sample (SYSTEM.md sections 1 to 3).

At t_k: sample k is there, taken just before the force changes; the observer predicts with the force held until now
and corrects with the sample; the controller sets u_k; the plant moves to t_{k+1} with u_k and the rate held.
"""

from typing import Final

import numpy as np
from numba import float64, int64, njit, types, uint32, void

from cosim.controllers.record import FORCE_X, OUTPUT_SIZE
from cosim.fmu import HANDLE_SIZE, INPUT_NAMES, OUTPUT_NAMES, exchange
from cosim.layout import ESTIMATE_SIZE

N_INPUTS: Final = len(INPUT_NAMES)
N_OUTPUTS: Final = len(OUTPUT_NAMES)

# One row a sample, full rate.
ESTIMATE: Final = 0
DEVIATION: Final = ESTIMATE + ESTIMATE_SIZE
CONTROL: Final = DEVIATION + ESTIMATE_SIZE
PLANT: Final = CONTROL + OUTPUT_SIZE
ROW_SIZE: Final = PLANT + N_OUTPUTS
"""A row: estimates and deviations (cosim.layout), output of the controller, outputs of the plant at t_k
(OUTPUT_NAMES)."""

_ARRAY = float64[::1]
_OBSERVER_STEP = types.FunctionType(void(_ARRAY, _ARRAY, float64, float64, float64, float64, _ARRAY, _ARRAY))
_CONTROLLER_STEP = types.FunctionType(void(_ARRAY, _ARRAY, float64, _ARRAY, _ARRAY, _ARRAY))
_BLOCK = int64(
    int64[::1], uint32[::1], uint32[::1],  # plant: handle, value references of inputs and outputs
    _OBSERVER_STEP, _ARRAY, _ARRAY,  # observer: step, memory, settings
    _CONTROLLER_STEP, _ARRAY, _ARRAY,  # controller: step, memory, settings
    int64, float64, _ARRAY,  # first sample, sample period, rate held over each sample
    _ARRAY, _ARRAY,  # values at the border between blocks: inputs, outputs of the plant
    float64[:, ::1],  # rows
)  # fmt: skip


@njit(_BLOCK, cache=True)
def run_block(  # type: ignore[no-untyped-def]
    handle,
    inputs,
    outputs,
    observer_step,
    observer_memory,
    observer_settings,
    controller_step,
    controller_memory,
    controller_settings,
    first,
    period,
    omega_z,
    input_values,
    output_values,
    rows,
):
    """Runs the samples first .. first + n - 1 and records a row of each, n = len(omega_z).

    Gives n, or the index in the block of the sample from which the plant could not go on. ``input_values`` (u_x, u_y,
    omega_z) and ``output_values`` (OUTPUT_NAMES) hold what the last block left and are left for the next. It is
    compiled once for all observers and controllers, which come as compiled functions.
    """
    estimate = np.zeros(ESTIMATE_SIZE)
    deviation = np.zeros(ESTIMATE_SIZE)
    control = np.zeros(OUTPUT_SIZE)
    flags = np.zeros(HANDLE_SIZE)
    for k in range(len(omega_z)):
        # From the count, not by addition: rounding would add up.
        t = (first + k) * period
        observer_step(
            observer_memory,
            observer_settings,
            input_values[0],
            input_values[1],
            output_values[0],
            output_values[1],
            estimate,
            deviation,
        )
        controller_step(controller_memory, controller_settings, t, estimate, deviation, control)
        row = rows[k]
        for i in range(ESTIMATE_SIZE):
            row[ESTIMATE + i] = estimate[i]
            row[DEVIATION + i] = deviation[i]
        for i in range(OUTPUT_SIZE):
            row[CONTROL + i] = control[i]
        for i in range(N_OUTPUTS):
            row[PLANT + i] = output_values[i]
        input_values[0] = control[FORCE_X]
        input_values[1] = control[FORCE_X + 1]
        input_values[2] = omega_z[k]
        if exchange(handle, inputs, input_values, outputs, output_values, flags, t, period) > 0:
            return k
    return len(omega_z)
