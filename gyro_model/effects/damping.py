"""Linear viscous damping along and across the axes.

    F = -[dxx dxy; dxy dyy] q'

TW 201137310, eq. 1.
"""

from gyro_model.anatomy import Energy, Force, Limit
from gyro_model.symbols import dxx, dxy, dyy, x_dot, y_dot

EFFECT = Force(
    id="damping",
    nominal=True,
    force=(-(dxx * x_dot + dxy * y_dot), -(dxy * x_dot + dyy * y_dot)),
    energy=Energy(dissipated=dxx * x_dot**2 + 2 * dxy * x_dot * y_dot + dyy * y_dot**2),
    signature="width of the resonances; free oscillations decay as exp(-d t/(2 m))",
    host_experiment="any",
    limits=(
        Limit(
            why="y' = 10 mm/s alone: -0.2 µN·s/m · 10 mm/s on x, -1 µN·s/m · 10 mm/s on y",
            at={"dxx": 3e-6, "dyy": 1e-6, "dxy": 2e-7, "y_dot": 0.01},
            gives={"force_x": -2e-9, "force_y": -1e-8},
        ),
    ),
)
