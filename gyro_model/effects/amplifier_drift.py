"""The output of both amplifiers drifts in proportion to time.

    v → v + r t

A linear model of the drift that TW 201137310 names among the defects of sensing circuits and compensates on line.
"""

from gyro_model.anatomy import Limit, Map
from gyro_model.quantities import size
from gyro_model.symbols import t, v_x, v_y

DRIFT = size("offset_drift", "V/s", "drift of the offset of both amplifiers", nominal=1e-3)

EFFECT = Map(
    id="amplifier_drift",
    parameters=(DRIFT,),
    slot="amplifier drift",
    output=(v_x + DRIFT.symbol * t, v_y + DRIFT.symbol * t),
    signature="a mean of the output that grows with time",
    host_experiment="a long record",
    limits=(
        Limit(
            why="10 mV/s for 2 s",
            at={"offset_drift": 0.01, "t": 2.0, "v_x": 1.0, "v_y": 0.0},
            gives={"v_x": 1.02, "v_y": 0.02},
        ),
    ),
)
