"""Damping that grows with the square of the displacement, axis by axis (van der Pol form).

    F_x = -d2_x x² x',  F_y = -d2_y y² y'

Squeeze films and lossy springs do this. An oscillation of amplitude A loses energy as with the linear damping d + d2
A²/4 (S. Zaitsev et al., Nonlinear Dynamics 67, 2012, eq. 6).
"""

from gyro_model.anatomy import Energy, Force, Limit
from gyro_model.quantities import size
from gyro_model.symbols import x, x_dot, y, y_dot

D2_X = size("d2_x", "N.s/m3", "nonlinear damping, x axis", nominal=1e5)
D2_Y = size("d2_y", "N.s/m3", "nonlinear damping, y axis", nominal=1e5)
d2_x, d2_y = D2_X.symbol, D2_Y.symbol

EFFECT = Force(
    id="nonlinear_damping",
    parameters=(D2_X, D2_Y),
    force=(-d2_x * x**2 * x_dot, -d2_y * y**2 * y_dot),
    energy=Energy(dissipated=d2_x * x**2 * x_dot**2 + d2_y * y**2 * y_dot**2),
    signature="large oscillations decay faster than small ones; third harmonic in quadrature",
    host_experiment="ring-down from a large amplitude",
    limits=(
        Limit(
            why="1e6 N·s/m³ at 1 µm and 20 mm/s: 1e6 · 1e-12 · 0.02 N, against the velocity",
            at={"d2_x": 1e6, "d2_y": 1e6, "x": 1e-6, "x_dot": 0.02, "y": -2e-6, "y_dot": -0.01},
            gives={"force_x": -2e-8, "force_y": 4e-8},
        ),
    ),
)
