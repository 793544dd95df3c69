"""The package accelerates, and the mass lags behind.

    F_x = c_x m a_x,  F_y = c_y m a_y; physically c = -1, a tuning fork's two tines cancel most of it

Newton's law in the frame of the package gives F = -m a. The model has one number c an axis for what a suspension of
several masses leaves of it.
"""

from gyro_model.anatomy import Force, Limit
from gyro_model.quantities import size
from gyro_model.symbols import a_x, a_y, m

GAIN_X = size("acceleration_gain_x", "1", "part of the package's acceleration that moves the mass, x axis", nominal=1.0)
GAIN_Y = size("acceleration_gain_y", "1", "part of the package's acceleration that moves the mass, y axis", nominal=1.0)

EFFECT = Force(
    id="linear_acceleration",
    parameters=(GAIN_X, GAIN_Y),
    force=(GAIN_X.symbol * m * a_x, GAIN_Y.symbol * m * a_y),
    energy=None,
    signature="the output follows the acceleration of the package; its mean moves by c m a/k",
    host_experiment="added acceleration",
    limits=(
        Limit(
            why="1e-7 kg at 20 m/s² with c = -1, and a tenth of it on y",
            at={"acceleration_gain_x": -1.0, "acceleration_gain_y": -0.1, "m": 1e-7, "a_x": 20.0, "a_y": 20.0},
            gives={"force_x": -2e-6, "force_y": -2e-7},
        ),
    ),
)
