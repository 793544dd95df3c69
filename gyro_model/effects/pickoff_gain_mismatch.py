"""The y pickoff has another gain than stated.

    v_y → v_y (1 + ε)

A model with one constant factor for pickoff and amplifier.
"""

from gyro_model.anatomy import Limit, Map
from gyro_model.quantities import size
from gyro_model.symbols import v_x, v_y

MISMATCH = size("pickoff_gain_mismatch", "1", "relative excess of the y pickoff gain", nominal=0.01)

EFFECT = Map(
    id="pickoff_gain_mismatch",
    parameters=(MISMATCH,),
    slot="pickoff gain mismatch",
    output=(v_x, v_y * (1 + MISMATCH.symbol)),
    signature="cross responses x→y and y→x differ; the pattern angle is distorted as sin 2φ",
    host_experiment="any with both axes driven",
    limits=(
        Limit(
            why="3 % more on y alone",
            at={"pickoff_gain_mismatch": 0.03, "v_x": 1.0, "v_y": 2.0},
            gives={"v_x": 1.0, "v_y": 2.06},
        ),
    ),
)
