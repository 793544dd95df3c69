"""An unequal pair of sensing capacitors: the signal is not odd in the displacement.

    q → q (1 + e q/g)/(1 - (q/g)²), the rest imbalance nulled; acts where 1/g > 0

Two plates of sizes 1 ± e at gap g: (1 + e)/(1 - q/g) - (1 - e)/(1 + q/g), less its value 2e at rest, over 2/g.
TW 201137310 names this asymmetry among the defects of sensing circuits. It shares its slot with
``pickoff_nonlinearity``, which gives the part without e.
"""

from sympy import Expr, Symbol

from gyro_model.anatomy import Limit, Map
from gyro_model.effects.pickoff_nonlinearity import inverse_gap
from gyro_model.quantities import size
from gyro_model.symbols import q_x, q_y

MISMATCH = size("pickoff_mismatch", "1", "relative mismatch of the pair of sensing capacitors", nominal=0.01)
mismatch = MISMATCH.symbol


def _uneven(q: Symbol) -> Expr:
    return q + mismatch * q**2 * inverse_gap / (1 - (q * inverse_gap) ** 2)


EFFECT = Map(
    id="pickoff_mismatch",
    parameters=(MISMATCH,),
    slot="pickoff pair",
    output=(_uneven(q_x), _uneven(q_y)),
    signature="second harmonic and a shift of the mean in the output, with the square of the amplitude",
    host_experiment="drive level step",
    limits=(
        Limit(
            why="half the gap, e = 0.3: q + 0.3 · q · ½/(1 - ¼) = 1.2 q for q > 0, 0.8 q for q < 0",
            at={"pickoff_mismatch": 0.3, "pickoff_inverse_gap": 5e5, "q_x": 1e-6, "q_y": -1e-6},
            gives={"q_x": 1.2e-6, "q_y": -0.8e-6},
        ),
        Limit(
            why="without a gap it does nothing",
            at={"pickoff_mismatch": 0.3, "pickoff_inverse_gap": 0.0, "q_x": 1e-6, "q_y": -1e-6},
            gives={"q_x": 1e-6, "q_y": -1e-6},
        ),
    ),
)
