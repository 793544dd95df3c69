"""Writes ``starts.h``: what the states of effects begin at."""

from gyro_model.anatomy import Force, State
from gyro_model.c_printing import STAMP, effect_macro, macro, state_macro
from gyro_model.model import Model


def starts(model: Model) -> str:
    """``starts.h`` of ``model``."""
    lines = "".join(_start(force, state) for force in model.forces for state in force.states)
    return f"""{STAMP}
#ifndef GYRO_STARTS_H
#define GYRO_STARTS_H

#include "effects.h"

/* After find_active, as the run begins: the states of effects that act as `value` says, the others at rest. */
static inline void start_states(gyro_view *g, const double value[GYRO_N_VARIABLES])
{{
    (void)g;
    (void)value;
{lines}}}

#endif
"""


def _start(force: Force, state: State) -> str:
    place = f"g->s[{state_macro(state.symbol)}]"
    if state.start is None:
        return f"    {place} = 0.0;\n"
    return f"    {place} = g->active[{effect_macro(force)}] ? value[{macro(state.start.name)}] : 0.0;\n"
