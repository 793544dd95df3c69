"""Cubic stiffness that couples the axes: the swing of one stiffens the other.

    energy ½ k22 x² y²:  F_x = -k22 x y²,  F_y = -k22 x² y

Tension that both axes share does this. Where the modes lie apart, the mean square of one shifts the other, ω_x² = (kxx
+ ½ k22 A_y²)/m (H. J. R. Westra, M. Poot, H. S. J. van der Zant, W. J. Venstra, Nonlinear modal interactions in
clamped-clamped mechanical resonators, Physical Review Letters 105, 117205, 2010).
"""

from sympy import Rational

from gyro_model.anatomy import Energy, Force, Limit
from gyro_model.quantities import size
from gyro_model.symbols import x, y

K22 = size("k22", "N/m3", "cubic stiffness that couples the axes", nominal=1e10)
k22 = K22.symbol

EFFECT = Force(
    id="cross_cubic_stiffness",
    parameters=(K22,),
    force=(-k22 * x * y**2, -k22 * x**2 * y),
    energy=Energy(stored=Rational(1, 2) * k22 * x**2 * y**2),
    signature="the resonance of each axis moves with the square of the other's amplitude",
    host_experiment="both axes driven, drive level ramp",
    limits=(
        Limit(
            why="2e10 N/m³ at 1 µm and -2 µm: 2e10 · 1e-6 · 4e-12 N and 2e10 · 1e-12 · 2e-6 N, against each",
            at={"k22": 2e10, "x": 1e-6, "y": -2e-6},
            gives={"force_x": -8e-8, "force_y": 4e-8},
        ),
    ),
)
