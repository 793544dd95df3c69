"""The converter rounds to whole steps.

    v → round(v/lsb) · lsb, ties to even

It looks like white noise of lsb²/12 where the signal crosses many steps (W. R. Bennett, Bell Syst. Tech. J. 27, 1948).
"""

from gyro_model.anatomy import Limit, Map
from gyro_model.quantities import size
from gyro_model.symbols import nearest_integer, v_x, v_y

STEP = size("adc_lsb", "V", "step of the converter", low=0.0, nominal=1e-4, display="mV")
lsb = STEP.symbol

EFFECT = Map(
    id="adc_quantisation",
    parameters=(STEP,),
    noise=True,
    slot="sampled round",
    output=(nearest_integer(v_x / lsb) * lsb, nearest_integer(v_y / lsb) * lsb),
    signature="the output takes whole multiples of one voltage",
    host_experiment="any",
    limits=(
        Limit(
            why="steps of ¼ V (exact in binary): 0.6 V is nearest to 0.5 V; -0.375 V is -1.5 steps: to even",
            at={"adc_lsb": 0.25, "v_x": 0.6, "v_y": -0.375},
            gives={"v_x": 0.5, "v_y": -0.5},
        ),
    ),
)
