"""The damping of the axes against one another is another at each turn-on: the bias does not come back.

    dxy → dxy + turn_on n √(dxx dyy), n normal, drawn from the seed at the start

The scatter from one turn-on to the next that IEEE Std 528-2019 calls the repeatability of the bias, as a normal model.
Each seed is a turn-on; within one nothing tells it from cross damping.
"""

from sympy import Symbol, sqrt

from gyro_model.anatomy import Law, Limit, Memory
from gyro_model.quantities import size
from gyro_model.symbols import dxx, dxy, dyy, normal_x

TURN_ON = size("turn_on", "1", "cross damping of a turn-on, rms, over √(dxx dyy)", low=0.0, nominal=1e-4)
drawn = Symbol("turn_on_drawn", real=True)

EFFECT = Law(
    id="turn_on_offset",
    parameters=(TURN_ON,),
    memories=(Memory(drawn, "1", "what this turn-on drew", start=normal_x),),
    changes={dxy: dxy + TURN_ON.symbol * drawn * sqrt(dxx * dyy)},
    noise=True,
    signature="the bias of the rate, or the drift of the pattern, differs between turn-ons and stays within one",
    host_experiment="many turn-ons, a seed each",
    limits=(
        Limit(
            why="two deviations below: 0.002 · 2 of √(1e-6 · 4e-6) less",
            at={"turn_on": 0.002, "turn_on_drawn": -2.0, "normal_x": 0.5, "dxx": 1e-6, "dyy": 4e-6, "dxy": 3e-7},
            gives={"dxy": 2.92e-7, "start_turn_on_drawn": 0.5},
        ),
    ),
)
