"""Writes ``forces.h``: the forces of a model one by one along the nodes of a run, and what each follows from."""

import textwrap

from gyro_model import symbols
from gyro_model.anatomy import Force, Map
from gyro_model.c_printing import STAMP, effect_macro, macro, state_macro
from gyro_model.effect_functions import force_call
from gyro_model.linear_forces import bends
from gyro_model.model import Model


def forces(model: Model) -> str:
    """``forces.h`` of ``model``."""
    own = [e for e in model.forces if not e.drawn]
    reads = [f"{{{effect_macro(e)}, {macro(name)}}}" for e in own for name in _reads(e, model)]
    bending = [effect_macro(e) for e in own if bends(e, model)]
    on_force = [effect_macro(e) for e in model.effects if isinstance(e, Map) and e.stage == "actuator"]
    cases = "".join(_case(e, model) for e in own)
    return f"""{STAMP}
#ifndef GYRO_FORCES_H
#define GYRO_FORCES_H

#include "nodes.h"

enum {{ GYRO_N_FORCES = {len(own)}, GYRO_N_READS = {len(reads)}, GYRO_N_BENDING = {len(bending)},
       GYRO_N_ON_FORCE = {len(on_force)} }};

/* The forces that are not drawn, by effect. */
static const int gyro_forces[GYRO_N_FORCES] = {{{", ".join(map(effect_macro, own))}}};

/* Those of which the slopes go with the states, the force or the time, by effect. */
static const int gyro_bending[] = {{{", ".join(bending) or "GYRO_N_EFFECTS"}}};

/* What changes the command on its way to the mass, by effect. */
static const int gyro_on_force[] = {{{", ".join(on_force) or "GYRO_N_EFFECTS"}}};

/* What they follow from beside the motion: effect and value reference. */
static const int gyro_reads[GYRO_N_READS][2] = {{
    {", ".join(reads)},
}};

/* Adds the force [N] of an effect at nodes, shape (n, 2), and puts rates of its states, shape (n, GYRO_N_STATES). */
static inline void add_force(gyro_view *g, const gyro_nodes *at, int effect, double (*force)[2],
                             double (*rate)[GYRO_N_STATES])
{{
    switch (effect) {{
{textwrap.indent(cases, "    ")}    default:
        break;
    }}
}}

#endif
"""


def _reads(effect: Force, model: Model) -> list[str]:
    """Names of the variables in its force and in the rates of its states."""
    read = {symbol.name for symbol in effect.symbols - set(model.state_symbols)}
    return [quantity.name for quantity in model.quantities if quantity.name in read]


def _case(effect: Force, model: Model) -> str:
    states = [state_macro(symbol) for symbol in model.state_symbols if symbol in effect.symbols]
    # Only what it reads, and here: the compiler then keeps it in registers.
    looked = "".join(f"    g->s[{s}] = at->state[i][{s}];\n" for s in states)
    call = f"""for (int64_t i = 0; i < at->n; i++) {{
{_brought(effect, model)}{looked}    {force_call(effect, "[i]")}}}
"""
    return f"case {effect_macro(effect)}:\n{textwrap.indent(call, '    ')}    break;\n"


def _brought(effect: Force, model: Model) -> str:
    """What brings the inputs that ``effect`` reads."""
    conditions = {q.symbol for q in model.quantities if q.role == "input"} | set(model.followed) | set(symbols.SET_BY)
    if effect.symbols & {symbols.t, symbols.u_x, symbols.u_y}:
        return "    bring_all(g, at, i);\n"
    return "    bring_inputs(g, at, i);\n" if effect.symbols & conditions else ""
