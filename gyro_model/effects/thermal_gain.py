"""The gain of both pickoffs changes with the temperature of the circuit.

    G → G (1 + tcg (T_circuit - t_ref))

A first-order model.
"""

from gyro_model.anatomy import Law, Limit
from gyro_model.effects.thermal_stiffness import REFERENCE
from gyro_model.quantities import size
from gyro_model.symbols import sense_gain_x, sense_gain_y, temperature_circuit

TCG = size("tcg", "1/K", "temperature coefficient of the pickoff gain", nominal=1e-4, display="ppm/K")

EFFECT = Law(
    id="thermal_gain",
    parameters=(TCG,),
    changes={
        gain: gain * (1 + TCG.symbol * (temperature_circuit - REFERENCE.symbol))
        for gain in (sense_gain_x, sense_gain_y)
    },
    signature="both outputs scale with temperature; resonances stay",
    host_experiment="temperature step",
    limits=(
        Limit(
            why="50 K above at 200 ppm/K: 1 % more",
            at={"tcg": 2e-4, "t_ref": 300.0, "temperature_circuit": 350.0, "sense_gain_x": 1e6, "sense_gain_y": 2e6},
            gives={"sense_gain_x": 1.01e6, "sense_gain_y": 2.02e6},
        ),
    ),
)
