"""Cubic (Duffing) stiffness of the suspension, axis by axis.

    F_x = -k3_x x³,  F_y = -k3_y y³

Large deflections stretch the springs (k3 > 0, hardening); electrostatic forces soften them (k3 < 0). The free
frequency of one axis moves with its amplitude A along the backbone ω²(A) = (k + ¾ k3 A²)/m (A. H. Nayfeh, D. T. Mook,
Nonlinear Oscillations, 1979, section 2.3).
"""

from sympy import Rational

from gyro_model.anatomy import Energy, Force, Limit
from gyro_model.quantities import size
from gyro_model.symbols import x, y

K3_X = size("k3_x", "N/m3", "cubic stiffness, x axis", nominal=1e10)
K3_Y = size("k3_y", "N/m3", "cubic stiffness, y axis", nominal=1e10)
k3_x, k3_y = K3_X.symbol, K3_Y.symbol

EFFECT = Force(
    id="cubic_stiffness",
    parameters=(K3_X, K3_Y),
    force=(-k3_x * x**3, -k3_y * y**3),
    energy=Energy(stored=Rational(1, 4) * (k3_x * x**4 + k3_y * y**4)),
    signature="resonance moves with the square of the amplitude; third harmonic",
    host_experiment="drive level ramp",
    limits=(
        Limit(
            why="2e10 N/m³ at 1 µm: 2e10 · 1e-18 N, against the displacement",
            at={"k3_x": 2e10, "k3_y": 4e10, "x": 1e-6, "y": -1e-6},
            gives={"force_x": -2e-8, "force_y": 4e-8},
        ),
    ),
)
