"""The converter saturates.

    v → clip(v, ±limit)

A model of an ideal limit, the same in both directions.
"""

from sympy import Max, Min

from gyro_model.anatomy import Limit, Map
from gyro_model.quantities import size
from gyro_model.symbols import v_x, v_y

# 1e300 V stands for "no limit": finite, so that it can be written to any file.
LIMIT = size("adc_limit", "V", "largest voltage that the converter can give", neutral=1e300, low=0.0, nominal=1.0)
limit = LIMIT.symbol

EFFECT = Map(
    id="adc_clipping",
    parameters=(LIMIT,),
    slot="sampled clip",
    output=(Min(Max(v_x, -limit), limit), Min(Max(v_y, -limit), limit)),
    signature="flat tops; odd harmonics above one amplitude",
    host_experiment="drive level step",
    limits=(
        Limit(
            why="beyond the limit on either side",
            at={"adc_limit": 1.5, "v_x": 2.0, "v_y": -9.0},
            gives={"v_x": 1.5, "v_y": -1.5},
        ),
        Limit(why="within the limit", at={"adc_limit": 1.5, "v_x": 0.3, "v_y": -1.4}, gives={"v_x": 0.3, "v_y": -1.4}),
    ),
)
