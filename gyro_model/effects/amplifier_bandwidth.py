"""The charge amplifier answers as a first-order lag.

    τ v_out' + v_out = v_in, v_out = v_in at the start

A model with one pole. The update is exact, so that τ may lie far below the step.
"""

from gyro_model.anatomy import Lag, Limit
from gyro_model.quantities import Grid, size

# A small lag is a delay: beside one, it shows by its square alone.
TIME_CONSTANT = size(
    "amplifier_time_constant",
    "s",
    "time constant of the charge amplifier",
    low=0.0,
    nominal=1e-6,
    display="µs",
    search=Grid.log(0.02, 0.2, of="radian", points=2),
)

EFFECT = Lag(
    id="amplifier_bandwidth",
    parameters=(TIME_CONSTANT,),
    time_constant=TIME_CONSTANT.symbol,
    signature="output lags by atan(ωτ) and shrinks by 1/√(1 + (ωτ)²)",
    host_experiment="any drive; best at several frequencies",
    limits=(
        Limit(
            why="the time constant is the parameter",
            at={"amplifier_time_constant": 2e-6},
            gives={"time_constant": 2e-6},
        ),
    ),
)
