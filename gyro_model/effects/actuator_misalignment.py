"""Each actuator also pushes along the other axis.

    u_x → u_x + ε u_y, u_y → u_y + ε u_x

A first-order model of two actuators that are not at right angles, in the small angle ε.
"""

from gyro_model.anatomy import Limit, Map
from gyro_model.quantities import size
from gyro_model.symbols import u_x, u_y

MISALIGNMENT = size("actuator_misalignment", "1", "part of each force that acts on the other axis", nominal=0.01)
epsilon = MISALIGNMENT.symbol

EFFECT = Map(
    id="actuator_misalignment",
    parameters=(MISALIGNMENT,),
    slot="actuator misalignment",
    output=(u_x + epsilon * u_y, u_y + epsilon * u_x),
    signature="a drive along one axis moves the other off resonance too, in phase with it",
    host_experiment="off-resonance drive of one axis",
    limits=(
        Limit(
            why="both see a tenth of the other's force before the change",
            at={"actuator_misalignment": 0.1, "u_x": 1e-6, "u_y": -2e-6},
            gives={"u_x": 8e-7, "u_y": -1.9e-6},
        ),
    ),
)
