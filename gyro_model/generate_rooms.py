"""Writes ``rooms.h``: how far the states may go until a force bends the motion that does so in places alone."""

import textwrap

from gyro_model.anatomy import Force
from gyro_model.c_printing import STAMP, c_expression, effect_macro, state_macro
from gyro_model.effect_functions import Places
from gyro_model.level import Region, regions
from gyro_model.linear_forces import uneven
from gyro_model.model import Model


def rooms(model: Model) -> str:
    """``rooms.h`` of ``model``."""
    level = [e for e in model.forces if regions(e, model)]
    functions = "\n".join(_function(e, model) for e in level)
    cases = "".join(f"case {effect_macro(e)}:\n    level = room_effect_{e.id}(g, room);\n    break;\n" for e in level)
    any_level = " || ".join(f"g->active[{effect_macro(e)}]" for e in level) or "0"
    crooked = "".join(f" && !g->active[{effect_macro(e)}]" for e in uneven(model) if e not in level)
    return f"""{STAMP}
#ifndef GYRO_ROOMS_H
#define GYRO_ROOMS_H

#include "effects.h"

/* How far a state may fall and rise until a force changes with it, in its unit: less, where `distance` is, on the side
   that `direction` says. Gives 0 where the force does so already. */
static inline int limit_room(double room[2], double distance, double direction)
{{
    double *side = &room[direction < 0.0];
    *side = smaller(*side, distance);
    return distance > 0.0;
}}

{functions}
/* The forces that bend the motion in places alone, by effect. */
static const int gyro_level[] = {{{", ".join(map(effect_macro, level)) or "GYRO_N_EFFECTS"}}};
enum {{ GYRO_N_LEVEL = {len(level)} }};

/* Whether one of them acts, and without them the motion is even. */
static inline int is_even_between(const gyro_view *g)
{{
    return ({any_level}){crooked};
}}

/* How far each state may fall and rise until one of them changes with it; gives 0, and not all, where one does. */
static inline int find_room(const gyro_view *g, double room[GYRO_N_STATES][2])
{{
    int level = 1;
    for (int i = 0; i < GYRO_N_STATES; i++) {{
        room[i][0] = room[i][1] = INFINITY;
    }}
    for (int i = 0; i < g->n_acting && level; i++) {{
        switch (g->acting[i]) {{
{textwrap.indent(cases, "        ")}        default:
            break;
        }}
    }}
    return level;
}}

#endif
"""


def _function(effect: Force, model: Model) -> str:
    found = regions(effect, model)
    exprs = [expr for region in found for expr in (*region.factors, *(e for side in region.sides for e in side[1:]))]
    lines = "\n        && ".join(_limits(region) for region in found)
    head = f"static inline int room_effect_{effect.id}(const gyro_view *g, double room[GYRO_N_STATES][2])"
    return f"{head}\n{{\n{Places(model).declare(effect, exprs)}    return {lines};\n}}\n"


def _limits(region: Region) -> str:
    limits = " && ".join(
        f"limit_room(room[{state_macro(state)}], {c_expression(distance)}, {c_expression(direction)})"
        for state, distance, direction in region.sides
    )
    rests = " && ".join(f"{c_expression(factor)} == 0.0" for factor in region.factors)
    return f"(({rests}) || ({limits}))"
