"""The Coriolis force of a package that turns about z.

    F_x = 2 m Ω y',  F_y = -2 m Ω x'

TW 201137310, eq. 1.
"""

from gyro_model.anatomy import Energy, Force, Limit
from gyro_model.symbols import m, omega_z, x_dot, y_dot

EFFECT = Force(
    id="coriolis",
    nominal=True,
    force=(2 * m * omega_z * y_dot, -2 * m * omega_z * x_dot),
    energy=Energy(),
    signature="the pattern of a free oscillation turns by -∫Ω dt in the body (Foucault)",
    host_experiment="any with a rate",
    limits=(
        Limit(
            why="x' = 1 cm/s, Ω = 5 rad/s, m = 2e-7 kg: -2 · 2e-7 · 5 · 0.01",
            at={"m": 2e-7, "omega_z": 5.0, "x_dot": 0.01},
            gives={"force_x": 0.0, "force_y": -2e-8},
        ),
    ),
)
