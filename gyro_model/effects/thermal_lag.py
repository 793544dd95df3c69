"""Structure and circuit warm and cool slowly: each temperature follows the ambient one, with its own lag.

    T' = (temperature - T)/lag, T = temperature at the start, for T_structure and T_circuit

Newton's law of cooling: a model of one heat capacity for each. The update is exact while the ambient temperature is
held, so that a lag may lie far below the step.
"""

from gyro_model.anatomy import Follow, Limit
from gyro_model.quantities import Grid, size
from gyro_model.symbols import temperature_circuit, temperature_structure

# A lag that is long beside a change of temperature keeps it off, whatever its length.
LONG = Grid.log(0.003, 1, of="duration", points=5)
STRUCTURE = size(
    "structure_lag", "s", "time constant of the structure's temperature", low=0.0, nominal=100.0, search=LONG
)
CIRCUIT = size("circuit_lag", "s", "time constant of the circuit's temperature", low=0.0, nominal=100.0, search=LONG)

EFFECT = Follow(
    id="thermal_lag",
    parameters=(STRUCTURE, CIRCUIT),
    follows={temperature_structure: STRUCTURE.symbol, temperature_circuit: CIRCUIT.symbol},
    signature="what temperature changes comes late after a temperature step, exponentially",
    host_experiment="temperature step; acts where another effect depends on temperature",
    limits=(
        Limit(
            why="the time constants are the parameters: 3 ms and 0.5 ms",
            at={"structure_lag": 3e-3, "circuit_lag": 5e-4},
            gives={"time_constant_temperature_structure": 3e-3, "time_constant_temperature_circuit": 5e-4},
        ),
    ),
)
