"""A capacitance to ground at the amplifier's input takes a part of the charge.

    v → v/(1 + r), r = c_p/(A c_f), c_f the feedback capacitance and A the open-loop gain

TW 201137310 names it among the defects of sensing circuits; a first-order model in 1/A. It is a common gain, which no
record can tell from a scaling of m, k and d (gauge).
"""

from gyro_model.anatomy import Limit, Map
from gyro_model.quantities import size
from gyro_model.symbols import v_x, v_y

RATIO = size(
    "parasitic_ratio",
    "1",
    "parasitic capacitance over open-loop gain times feedback capacitance",
    low=0.0,
    nominal=0.01,
)
ratio = RATIO.symbol

EFFECT = Map(
    id="parasitic_capacitance",
    parameters=(RATIO,),
    slot="pickoff parasitic",
    output=(v_x / (1 + ratio), v_y / (1 + ratio)),
    signature="both outputs smaller by one factor; never nameable from a record",
    host_experiment="none: a calibration of the pickoff against a known displacement",
    limits=(
        Limit(
            why="a quarter: 1/1.25 = 0.8",
            at={"parasitic_ratio": 0.25, "v_x": 1.0, "v_y": -2.0},
            gives={"v_x": 0.8, "v_y": -1.6},
        ),
    ),
)
