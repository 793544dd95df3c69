"""The force is not proportional to the command.

    u → u + a2 u² + a3 u³

Electrostatic actuators pull with the square of the voltage; a2 and a3 are what linearisation
leaves of that, in a Taylor model of third order.
"""

from gyro_model.anatomy import Limit, Map
from gyro_model.quantities import size
from gyro_model.symbols import u_x, u_y

A2 = size("actuator_a2", "1/N", "quadratic part of the actuator curve", nominal=1e3)
A3 = size("actuator_a3", "1/N2", "cubic part of the actuator curve", nominal=1e9)
a2, a3 = A2.symbol, A3.symbol

EFFECT = Map(
    id="actuator_nonlinearity",
    parameters=(A2, A3),
    slot="actuator curve",
    output=(u_x + a2 * u_x**2 + a3 * u_x**3, u_y + a2 * u_y**2 + a3 * u_y**3),
    signature="harmonics and sums of the drive frequencies in the force",
    host_experiment="drive level step",
    limits=(
        Limit(
            why="1e-4 N: 1e-4 + 500 · 1e-8 + 1e6 · 1e-12; the square keeps its sign",
            at={"actuator_a2": 500.0, "actuator_a3": 1e6, "u_x": 1e-4, "u_y": -1e-4},
            gives={"u_x": 1.06e-4, "u_y": -9.6e-5},
        ),
    ),
)
