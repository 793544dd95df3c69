"""A constant force on each axis: weight, a stray charge, a spring that was mounted under load.

    F_x = force_x,  F_y = force_y

It shifts the point about which the mass swings by F/k (L. D. Landau, E. M. Lifshitz, Mechanics, 1960, section 22, eq.
22.2 with a force that is constant). A linear device shows no more of it than a constant voltage.
"""

from gyro_model.anatomy import Energy, Force, Limit
from gyro_model.quantities import size
from gyro_model.symbols import x, y

FORCE_X = size("force_x", "N", "constant force, x axis", nominal=1e-7, display="µN")
FORCE_Y = size("force_y", "N", "constant force, y axis", nominal=1e-7, display="µN")
force_x, force_y = FORCE_X.symbol, FORCE_Y.symbol

EFFECT = Force(
    id="constant_force",
    parameters=(FORCE_X, FORCE_Y),
    force=(force_x, force_y),
    energy=Energy(stored=-force_x * x - force_y * y),
    signature="the mean of both voltages; a transient from rest where the force was not there before",
    host_experiment="any record that begins at rest",
    limits=(
        Limit(
            why="the force is the parameter",
            at={"force_x": 1.5e-6, "force_y": -3e-6},
            gives={"force_x": 1.5e-6, "force_y": -3e-6},
        ),
    ),
)
