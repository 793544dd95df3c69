"""Quadratic stiffness of the suspension, axis by axis: one that is not the same in both directions.

    F_x = -k2_x x²,  F_y = -k2_y y²

Bent beams and one-sided electrodes do this. A vibration of amplitude A shifts its mean by -k2 A²/(2 k) (A. H. Nayfeh,
D. T. Mook, Nonlinear Oscillations, 1979, section 2.3).
"""

from sympy import Rational

from gyro_model.anatomy import Energy, Force, Limit
from gyro_model.quantities import size
from gyro_model.symbols import x, y

K2_X = size("k2_x", "N/m2", "quadratic stiffness, x axis", nominal=1e5)
K2_Y = size("k2_y", "N/m2", "quadratic stiffness, y axis", nominal=1e5)
k2_x, k2_y = K2_X.symbol, K2_Y.symbol

EFFECT = Force(
    id="quadratic_stiffness",
    parameters=(K2_X, K2_Y),
    force=(-k2_x * x**2, -k2_y * y**2),
    energy=Energy(stored=Rational(1, 3) * (k2_x * x**3 + k2_y * y**3)),
    signature="second harmonic and a shift of the mean with the square of the amplitude; both are in the motion",
    host_experiment="drive level step",
    limits=(
        Limit(
            why="3e5 N/m² at 2 µm on either side: 3e5 · 4e-12 N, always the same way",
            at={"k2_x": 3e5, "k2_y": 3e5, "x": 2e-6, "y": -2e-6},
            gives={"force_x": -1.2e-6, "force_y": -1.2e-6},
        ),
    ),
)
