"""A constant voltage at the amplifier's output.

    v_x → v_x + o_x, v_y → v_y + o_y

TW 201137310 names it among the defects of sensing circuits and compensates it on line.
"""

from gyro_model.anatomy import Limit, Map
from gyro_model.quantities import size
from gyro_model.symbols import v_x, v_y

OFFSET_X = size("offset_x", "V", "offset of the x amplifier", nominal=0.01, display="mV")
OFFSET_Y = size("offset_y", "V", "offset of the y amplifier", nominal=0.01, display="mV")

EFFECT = Map(
    id="amplifier_offset",
    parameters=(OFFSET_X, OFFSET_Y),
    slot="amplifier offset",
    output=(v_x + OFFSET_X.symbol, v_y + OFFSET_Y.symbol),
    signature="a mean of the output that no force explains",
    host_experiment="any",
    limits=(
        Limit(
            why="10 mV and -20 mV are added",
            at={"offset_x": 0.01, "offset_y": -0.02, "v_x": 1.0, "v_y": 1.0},
            gives={"v_x": 1.01, "v_y": 0.98},
        ),
    ),
)
