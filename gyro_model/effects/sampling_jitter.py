"""The converter samples a little early or late, by a random time.

    v → v + v' δ, δ normal

v' is the rate at which the voltage enters the converter. On a sine of amplitude A the noise is A ω σ/√2 rms (IEEE Std
1241-2010, section 4.1, aperture uncertainty).
"""

from gyro_model.anatomy import Limit, Map
from gyro_model.quantities import size
from gyro_model.symbols import normal_x, normal_y, v_x, v_x_rate, v_y, v_y_rate

JITTER = size("sampling_jitter", "s", "rms error of the sampling instant", low=0.0, nominal=1e-9, display="ns")

EFFECT = Map(
    id="sampling_jitter",
    parameters=(JITTER,),
    noise=True,
    slot="sampled noise",
    output=(v_x + v_x_rate * JITTER.symbol * normal_x, v_y + v_y_rate * JITTER.symbol * normal_y),
    signature="noise that grows with amplitude and frequency, strongest at the zero crossings",
    host_experiment="large amplitude",
    limits=(
        Limit(
            why="1 ns late at 2e4 V/s: 20 µV more; 2 ns late at -1e4 V/s: 20 µV less",
            at={
                "sampling_jitter": 1e-9,
                "v_x": 1.0,
                "v_x_rate": 2e4,
                "normal_x": 1.0,
                "v_y": 0.0,
                "v_y_rate": -1e4,
                "normal_y": 2.0,
            },
            gives={"v_x": 1.00002, "v_y": -2e-5},
        ),
    ),
)
