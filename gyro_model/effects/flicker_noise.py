"""Flicker noise of the amplifier: its density falls with frequency.

    v → v + a p, one-sided density a²/f from 1 Hz to half the sample rate

p is pink noise of density 1 Hz/f, made of first-order processes with corners 1.5 a decade (M. S. Keshner, Proc. IEEE
70, 1982): within 3.5 % of the density, flat below about 0.1 Hz. Both axes are independent.
"""

from gyro_model.anatomy import Limit, Map
from gyro_model.quantities import size
from gyro_model.symbols import pink_x, pink_y, v_x, v_y

NOISE = size("flicker_noise", "V/Hz0.5", "amplitude density of flicker noise at 1 Hz", low=0.0, nominal=1e-5)

EFFECT = Map(
    id="flicker_noise",
    parameters=(NOISE,),
    noise=True,
    slot="sampled noise",
    output=(v_x + NOISE.symbol * pink_x, v_y + NOISE.symbol * pink_y),
    signature="a floor in the spectrum of the output that rises towards low frequencies by 10 dB a decade",
    host_experiment="any; a long record shows more of it",
    limits=(
        Limit(
            why="10 µV/√Hz times 3 and -2 √Hz",
            at={"flicker_noise": 1e-5, "pink_x": 3.0, "pink_y": -2.0, "v_x": 0.0, "v_y": 1.0},
            gives={"v_x": 3e-5, "v_y": 0.99998},
        ),
    ),
)
