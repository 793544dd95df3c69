"""White noise of the pickoff and its amplifier, drawn anew at each sample.

    v → v + σ n

A model of independent normal numbers. The device ``reference`` has 20 pm rms at 200 kHz, 20 µV at 1e6 V/m.
"""

from gyro_model.anatomy import Limit, Map
from gyro_model.quantities import size
from gyro_model.symbols import normal_x, normal_y, v_x, v_y

NOISE = size("sense_noise", "V", "white noise, rms a sample", low=0.0, nominal=2e-5, display="µV")

EFFECT = Map(
    id="sense_noise",
    parameters=(NOISE,),
    noise=True,
    slot="sampled noise",
    output=(v_x + NOISE.symbol * normal_x, v_y + NOISE.symbol * normal_y),
    signature="a flat floor in the spectrum of the output",
    host_experiment="any",
    limits=(
        Limit(
            why="one and minus two standard deviations of 20 µV",
            at={"sense_noise": 2e-5, "normal_x": 1.0, "normal_y": -2.0, "v_x": 0.0, "v_y": 1.0},
            gives={"v_x": 2e-5, "v_y": 0.99996},
        ),
    ),
)
