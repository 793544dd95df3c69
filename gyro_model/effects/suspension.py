"""The suspension: linear springs along and across the axes.

    F = -[kxx kxy; kxy kyy] q

TW 201137310, eq. 1.
"""

from sympy import Rational

from gyro_model.anatomy import Energy, Force, Limit
from gyro_model.symbols import kxx, kxy, kyy, x, y

EFFECT = Force(
    id="suspension",
    nominal=True,
    force=(-(kxx * x + kxy * y), -(kxy * x + kyy * y)),
    energy=Energy(stored=Rational(1, 2) * (kxx * x**2 + kyy * y**2) + kxy * x * y),
    signature="two resonances, at the eigenvalues of K/m",
    host_experiment="any",
    limits=(
        Limit(
            why="x = 1 µm alone: -2 N/m · 1 µm on x, -0.5 N/m · 1 µm on y",
            at={"kxx": 2.0, "kyy": 3.0, "kxy": 0.5, "x": 1e-6},
            gives={"force_x": -2e-6, "force_y": -5e-7},
        ),
    ),
)
