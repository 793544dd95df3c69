"""Settings and memory of the adaptive Kalman filters: what cosim.observers.adaptive works on."""

from typing import Final

from cosim.propagation import WORK_SIZE
from gyro_model import symbols

PLAIN: Final = 12
EXTENDED: Final = 19
"""Sizes of the two filters."""

SETTINGS: Final = {
    "omega_walk_min": 0.3,
    "omega_walk_max": 100.0,
    "omega_walk_rate": 0.5,
    "omega_jump": 10.0,
    "surprise": 30.0,
    "surprise_limit": 2.5,
    "surprise_memory": 400.0,
    "settle": 10.0,
    "restart_stiffness": 1e-3,
    "restart_damping": 1.0,
    "restart_limit": 2.5,
    "memory": 5.0,
    "thermal_force": 0.0,
    "temperature": 298.15,
}
"""What the filter can be told.

omega_walk_min, _max: limits of the random walk of omega_z [rad/s per sqrt(s)];
omega_walk_rate: how fast it adapts [1/block]; omega_jump: size of a sudden change [rad/s];
surprise: squared innovation over its variance, both axes, that counts as one;
surprise_limit: so many within surprise_memory [samples] reopen the constants;
settle: samples that a surprise may have taken to show; restart_stiffness, _damping: standard
deviation, relative, of reopened k and m, and of reopened d; restart_limit: so many reopenings
within 10 surprise_memory begin anew, the sensor included; memory: samples of age t count
exp(-t / memory) [s]; thermal_force: 1 expects the thermal force at `temperature` [K].
"""

EXTENDED_SETTINGS: Final = {
    **SETTINGS,
    "mismatch_deviation": 0.05,
    "gap_deviation": 0.1,
}
"""Further: what may be wrong with the gap curve, as standard deviations: mismatch of the pair,
and 1/g relative to its design value (it also takes up the unknowable common gain)."""

(
    WALK_MIN,
    WALK_MAX,
    WALK_RATE,
    JUMP,
    SURPRISE,
    SURPRISE_LIMIT,
    SURPRISE_MEMORY,
    SETTLE,
    RESTART_STIFFNESS,
    RESTART_DAMPING,
    RESTART_LIMIT,
    MEMORY,
    THERMAL,
    TEMPERATURE,
    MISMATCH_DEVIATION,
    GAP_DEVIATION,
) = range(16)

LAG: Final = 0.3
"""Typical age of a jump of omega_z when it shows, over `settle`."""
SLACK: Final = 0.1
"""What that guess leaves unexplained of the state, over what a jump does to it in `settle`."""
BLOCK: Final = 64
"""Samples between two adaptations."""
RATIO_MAX: Final = 10.0
"""Largest evidence that one block may give for a faster random walk."""
ANEW_STIFFNESS: Final = 0.1
ANEW_DAMPING: Final = 1e-3
"""Standard deviations of k and m, relative, and of d/m over sqrt(k/m), where the filter begins anew."""
STROKE_MAX: Final = 0.9
"""Largest |q| over the gap that the gap curve is used for."""
BOLTZMANN: Final = float(symbols.BOLTZMANN)

# States of the sensor, after [x, x', y, y', theta].
OFFSET: Final = 12
DRIFT: Final = 14
RATIO: Final = 16
MISMATCH: Final = 17
GAP: Final = 18

# Memory: the state, the factors D and U of its covariance, scratch, then single numbers.
D: Final = EXTENDED
U: Final = D + EXTENDED
WORK: Final = U + EXTENDED * EXTENDED
ROW: Final = WORK + WORK_SIZE
GAIN: Final = ROW + EXTENDED
DESIGN: Final = GAIN + EXTENDED
(
    GAIN_X,
    GAIN_Y,
    NOISE_X,
    NOISE_Y,
    VELOCITY,
    PERIOD,
    COUNT,
    ORDER,
    WALK,
    SUM,
    SUM_VARIANCE,
    SURPRISES,
    RESTARTS,
    WAIT,
) = range(DESIGN, DESIGN + 14)
VARIANCE: Final = DESIGN + 14  # of the state now, of theta at the last adaptation
START: Final = VARIANCE + EXTENDED
MEMORY_SIZE: Final = START + 10
