"""Play of the actuator: the force stays while the command turns back by less than twice the half width.

    u → p,  p = max(u - b, min(u + b, p before)),  p = 0 at the start

Backlash as a play operator (M. Nordin, P.-O. Gutman, Controlling mechanical systems with backlash - a survey,
Automatica 38, 2002; M. Brokate, J. Sprekels, Hysteresis and Phase Transitions, Springer 1996). It acts before the
actuator's curve; how fast the command changes does not matter.
"""

from sympy import Expr, Max, Min, Symbol

from gyro_model.anatomy import Limit, Map, Memory
from gyro_model.quantities import size
from gyro_model.symbols import u_x, u_y

PLAY = size("play", "N", "half width of the actuator's backlash", low=0.0, nominal=1e-8, display="µN")
p_x, p_y = Symbol("play_x", real=True), Symbol("play_y", real=True)


def _played(u: Symbol, p: Symbol) -> Expr:
    return Max(u - PLAY.symbol, Min(u + PLAY.symbol, p))


EFFECT = Map(
    id="play",
    parameters=(PLAY,),
    memories=(
        Memory(p_x, "N", "force that has come through the play, x axis", now=_played(u_x, p_x)),
        Memory(p_y, "N", "force that has come through the play, y axis", now=_played(u_y, p_y)),
    ),
    slot="actuator play",
    output=(p_x, p_y),
    signature="the force lags and is smaller by the half width; small commands do nothing; odd harmonics",
    host_experiment="drive level ramp",
    limits=(
        Limit(
            why="x gave 0.5 µN, is pushed to 3 µN less 1 µN; y turned back from 4 µN by less than the play: it stays",
            at={"play": 1e-6, "u_x": 3e-6, "play_x": 5e-7, "u_y": 2.5e-6, "play_y": 3e-6},
            gives={
                "u_x": 5e-7,
                "u_y": 3e-6,
                "start_play_x": 0.0,
                "now_play_x": 2e-6,
                "start_play_y": 0.0,
                "now_play_y": 3e-6,
            },
        ),
    ),
)
