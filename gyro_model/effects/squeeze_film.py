"""Squeeze-film damping: the gas between mass and electrode resists the more, the narrower the gap.

    F_q = -d q'/(1 - (q/g)²)^(3/2),  q = x, y

Damping of a film at small squeeze numbers with the amplitude in it, d being that at rest, beside the linear damping of
the device (M. H. Sadd, A. K. Stiffler, Squeeze film dampers: amplitude effects at low squeeze numbers, ASME Journal of
Engineering for Industry 97, 1975).
"""

from sympy import Expr, Rational, Symbol

from gyro_model.anatomy import Energy, Force, Limit
from gyro_model.quantities import Grid, shape, size
from gyro_model.symbols import x, x_dot, y, y_dot

SQUEEZE_X = size("squeeze_x", "N.s/m", "damping of the film at rest, x axis", low=0.0, nominal=1e-7)
SQUEEZE_Y = size("squeeze_y", "N.s/m", "damping of the film at rest, y axis", low=0.0, nominal=1e-7)
GAP = shape("squeeze_gap", "m", 5e-6, "gap of the film", low=1e-9, display="µm", search=Grid.log(1.1, 30, of="x"))
d_x, d_y, g = SQUEEZE_X.symbol, SQUEEZE_Y.symbol, GAP.symbol


def _narrowed(q: Symbol) -> Expr:
    return (1 - (q / g) ** 2) ** Rational(-3, 2)


EFFECT = Force(
    id="squeeze_film",
    parameters=(SQUEEZE_X, SQUEEZE_Y, GAP),
    force=(-d_x * _narrowed(x) * x_dot, -d_y * _narrowed(y) * y_dot),
    energy=Energy(dissipated=d_x * _narrowed(x) * x_dot**2 + d_y * _narrowed(y) * y_dot**2),
    signature="large oscillations decay faster than small ones, without bound towards the gap",
    host_experiment="ring-down from an amplitude near the gap",
    limits=(
        Limit(
            why="0.28 of the gap: 1 - 0.28² = 0.96², and 0.96³ = 0.884736; at rest 2e-6 N·s/m · 10 mm/s",
            at={
                "squeeze_x": 1e-6,
                "squeeze_y": 2e-6,
                "squeeze_gap": 5e-6,
                "x": 1.4e-6,
                "x_dot": 2e-2,
                "y": 0.0,
                "y_dot": -1e-2,
            },
            gives={"force_x": -2e-8 / 0.884736, "force_y": 2e-8},
        ),
    ),
)
