"""The ideal pickoff: a voltage in proportion to the displacement of each axis.

    v = G q

A linear model. Scaling m, k, d and both gains together changes no sample (gauge), so one gain is held as known.
"""

from gyro_model.anatomy import Limit, Map
from gyro_model.symbols import q_x, q_y, sense_gain_x, sense_gain_y

EFFECT = Map(
    id="ideal_pickoff",
    nominal=True,
    slot="pickoff gain",
    output=(sense_gain_x * q_x, sense_gain_y * q_y),
    signature="the scale of both outputs",
    host_experiment="any",
    limits=(
        Limit(
            why="1 µm and -2 µm at 1 V/µm and 3 V/µm",
            at={"q_x": 1e-6, "q_y": -2e-6, "sense_gain_x": 1e6, "sense_gain_y": 3e6},
            gives={"v_x": 1.0, "v_y": -6.0},
        ),
    ),
)
