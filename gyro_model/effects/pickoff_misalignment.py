"""Each pickoff also sees the other axis.

    x → x + ε y, y → y + ε x

A first-order model of two pickoffs that are not at right angles, in the small angle ε.
"""

from gyro_model.anatomy import Limit, Map
from gyro_model.quantities import size
from gyro_model.symbols import q_x, q_y

MISALIGNMENT = size("pickoff_misalignment", "1", "part of each displacement that the other pickoff sees", nominal=0.01)
epsilon = MISALIGNMENT.symbol

EFFECT = Map(
    id="pickoff_misalignment",
    parameters=(MISALIGNMENT,),
    slot="pickoff misalignment",
    output=(q_x + epsilon * q_y, q_y + epsilon * q_x),
    signature="a mode along one axis shows in the other output, in phase with it",
    host_experiment="any with the modes apart",
    limits=(
        Limit(
            why="both see a tenth of the other before the change",
            at={"pickoff_misalignment": 0.1, "q_x": 1e-6, "q_y": -2e-6},
            gives={"q_x": 8e-7, "q_y": -1.9e-6},
        ),
    ),
)
