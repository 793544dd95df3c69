"""The y actuator gives another force than commanded.

    u_y → u_y (1 + ε)

A model with one constant factor for converter, driver and actuator.
"""

from gyro_model.anatomy import Limit, Map
from gyro_model.quantities import size
from gyro_model.symbols import u_x, u_y

MISMATCH = size("actuator_gain_mismatch", "1", "relative excess of the y force", nominal=0.01)

EFFECT = Map(
    id="actuator_gain_mismatch",
    parameters=(MISMATCH,),
    slot="actuator gain",
    output=(u_x, u_y * (1 + MISMATCH.symbol)),
    signature="responses to u_y are larger than those to u_x explain",
    host_experiment="any with both axes driven",
    limits=(
        Limit(
            why="5 % more on y alone",
            at={"actuator_gain_mismatch": 0.05, "u_x": 1e-6, "u_y": 2e-6},
            gives={"u_x": 1e-6, "u_y": 2.1e-6},
        ),
    ),
)
