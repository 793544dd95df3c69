"""Parallel-plate electrodes at a bias voltage pull the mass away from the centre.

    F_q = a V² q/(1 - (q/g)²)², q = x, y, V = v_bias

Two plates at gap g: F = εA V²/2 · [1/(g - q)² - 1/(g + q)²], a = 2 εA/g³ (S. D. Senturia, Microsystem Design, 2001,
section 6.4).
"""

from sympy import Expr, Rational, Symbol

from gyro_model.anatomy import Energy, Force, Limit
from gyro_model.quantities import Grid, shape, size
from gyro_model.symbols import v_bias, x, y

SOFTENING = size("softening", "N/m.V2", "electrostatic softening a, per square of the bias voltage", nominal=1e-3)
GAP = shape(
    "electrode_gap", "m", 1e-5, "gap of the electrodes", low=1e-9, search=Grid.log(1.2, 30, of="x"), display="µm"
)
a, g = SOFTENING.symbol, GAP.symbol


def _pull(q: Symbol) -> Expr:
    return a * v_bias**2 * q / (1 - (q / g) ** 2) ** 2


def _stored(q: Symbol) -> Expr:
    return -Rational(1, 2) * a * v_bias**2 * g**2 / (1 - (q / g) ** 2)


EFFECT = Force(
    id="electrostatic_softening",
    parameters=(SOFTENING, GAP),
    force=(_pull(x), _pull(y)),
    energy=Energy(stored=_stored(x) + _stored(y)),
    signature="resonance falls with the square of the bias voltage",
    host_experiment="bias step",
    limits=(
        Limit(
            why="0.01 N/(m·V²) at 10 V: 1 N/m of softening; half the gap away 1/(1 - ¼)² = 16/9 of it",
            at={"softening": 0.01, "v_bias": 10.0, "electrode_gap": 1e-5, "x": 5e-6, "y": 0.0},
            gives={"force_x": 5e-6 * 16 / 9, "force_y": 0.0},
        ),
    ),
)
