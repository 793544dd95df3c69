"""A gap-closing pair of capacitors: the difference signal grows faster than the displacement.

    q → q/(1 - (q/g)²)

Two plates at gap g, C = εA/(g ∓ q): ΔC = 2εA/g · (q/g)/(1 - (q/g)²). S. D. Senturia, Microsystem Design, 2001,
section 19.3.
"""

from sympy import Expr, Symbol

from gyro_model.anatomy import Limit, Map
from gyro_model.quantities import size
from gyro_model.symbols import q_x, q_y

INVERSE_GAP = size("pickoff_inverse_gap", "1/m", "one over the gap of the sensing capacitors", low=0.0, nominal=1e5)
inverse_gap = INVERSE_GAP.symbol


def _through_gap(q: Symbol) -> Expr:
    return q / (1 - (q * inverse_gap) ** 2)


EFFECT = Map(
    id="pickoff_nonlinearity",
    parameters=(INVERSE_GAP,),
    slot="pickoff pair",
    output=(_through_gap(q_x), _through_gap(q_y)),
    signature="third harmonic in the output that is not in the motion; resonance does not move",
    host_experiment="drive level step",
    limits=(
        Limit(
            why="half the gap: q/(1 - ¼)",
            at={"pickoff_inverse_gap": 5e5, "q_x": 1e-6, "q_y": -1e-6},
            gives={"q_x": 1e-6 / 0.75, "q_y": -1e-6 / 0.75},
        ),
    ),
)
