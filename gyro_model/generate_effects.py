"""Writes ``effects.h``: the functions of every effect, then the stages that call those that are active. Formulae are
printed as they stand in the effect files, one function each, nothing shared between them."""

import re
import textwrap
import zlib
from collections.abc import Iterable, Sequence
from itertools import groupby

from sympy import Symbol

from gyro_model import symbols
from gyro_model.anatomy import SLOTS, Delay, Effect, Follow, Lag, Law, Map
from gyro_model.c_printing import (
    STAMP,
    c_double,
    effect_macro,
    lagging_macro,
    macro,
    memory_macro,
    state_macro,
)
from gyro_model.effect_functions import (
    Places,
    added_forces,
    called,
    follow_function,
    follows_of,
    force_call,
    force_function,
    guarded,
    law_function,
    map_functions,
    memory_functions,
)
from gyro_model.linear_forces import is_linear, linear_parts, uneven, unsteady
from gyro_model.model import Model, chain


def indexes(model: Model) -> str:
    """States, what lags, what is remembered, and effects by index."""
    units = ["m", "m/s", "m", "m/s", *(s.unit for s in model.states)]
    states = "\n".join(
        f"    {state_macro(symbol)} = {index}, /* [{unit}] */"
        for index, (symbol, unit) in enumerate(zip(model.state_symbols, units, strict=True))
    )
    lagging = "\n".join(f"    {lagging_macro(target)} = {index}," for index, target in enumerate(model.followed))
    memories = "\n".join(
        f"    {memory_macro(memory.symbol)} = {index}, /* [{memory.unit}] */"
        for index, memory in enumerate(model.memories)
    )
    listed = "\n".join(f"    {effect_macro(effect)} = {index}," for index, effect in enumerate(model.effects))
    return f"""/* Continuous states. */
enum {{
{states}
    GYRO_N_STATES = {len(model.state_symbols)}
}};

/* Quantities that may lag. */
enum {{
{lagging}
    GYRO_N_LAGGING = {len(model.followed)}
}};

/* What effects remember, that which flows by time itself first. */
enum {{
{memories}
    GYRO_N_FLOWING = {sum(memory.flows for memory in model.memories)},
    GYRO_N_MEMORIES = {max(len(model.memories), 1)} /* room for one where there is none */
}};

/* Effects, those of the nominal device first. */
enum {{
{listed}
    GYRO_N_PINK = {sum(bool(e.symbols & set(symbols.PINK)) for e in model.effects)}, /* of which draw pink numbers */
    GYRO_N_EFFECTS = {len(model.effects)}
}};
"""


def effects(model: Model) -> str:
    """``effects.h``: every effect's function, then the stages that call those that are active."""
    place = Places(model)
    parts = [_PROLOGUE.replace("INDEXES", indexes(model))]
    parts += [force_function(e, place) for e in model.forces]
    parts += [memory_functions(e, place) for e in model.effects if e.memories]
    parts += [follow_function(e) for e in follows_of(model)]
    parts += [law_function(e, place) for e in model.laws]
    parts += [map_functions(e, place) for e in model.effects if isinstance(e, Map)]
    parts += [
        _activity(model),
        _begin(model),
        _streams(model),
        _events(model),
        _laws(model),
        _remembering(model),
        _holds(model),
        _derivative(model),
        linear_parts(model, place),
        _kick(model),
    ]
    parts += [_stage(model, *stage) for stage in _STAGES]
    parts += [_stage(model, *stage, moving=True) for stage in _STAGES if stage[0] in ("pick_off", "amplify")]
    return f"{STAMP}\n#ifndef GYRO_EFFECTS_H\n#define GYRO_EFFECTS_H\n\n" + "\n".join(parts) + "\n#endif\n"


_PROLOGUE = """#include <stdint.h>

#include "../gyro_math.h"
#include "model.h"

INDEXES
/* All that an effect may read. */
typedef struct {
    double p[GYRO_N_VARIABLES];           /* variables by value reference, laws applied, SI */
    double s[GYRO_N_STATES];              /* continuous states, SI */
    double u[2];                          /* force on its way to the mass, N */
    double held[2];                       /* noise force, held until the next sample, N */
    double q[2];                          /* displacement on its way to the pickoff, m */
    double s_rate[GYRO_N_STATES];         /* rate of the states at the latest sample, SI/s; where any_rate */
    double q_rate[2];                     /* rate of q, m/s; where any_rate */
    double v_rate[2];                     /* rate of v, V/s; where any_rate */
    double v[2];                          /* voltage on its way to the converter, V */
    double change[GYRO_N_INPUTS];         /* by how much each held input has just changed, SI */
    double t;                             /* time, s */
    double since;                         /* time since `lagging`, s; two late dates would differ by less */
    double lagging[GYRO_N_LAGGING];       /* quantities that lag, at the start of the step, SI */
    double lagging_now[GYRO_N_LAGGING];   /* the same, now */
    double remembered[GYRO_N_MEMORIES];   /* what effects remember, at the start of the step */
    double remembered_now[GYRO_N_MEMORIES]; /* the same, now */
    double inverse_mass;                  /* 1/kg */
    double drawn[GYRO_N_EFFECTS][2];      /* normal or pink numbers of each effect, of the latest sample */
    double after[GYRO_N_EFFECTS];         /* 1 from the event of each effect on, 0 before */
    unsigned char active[GYRO_N_EFFECTS]; /* a size parameter differs from neutral */
    unsigned char any_law;
    unsigned char moving; /* laws change parameters within the present step */
    unsigned char any_curved; /* a force acts that is not linear in the motion, or has states of its own */
    unsigned char steady; /* the motion is linear, and nothing but the rate changes its slopes */
    unsigned char even; /* the same where forces with states of their own act, of all states */
    unsigned char any_impulse;
    unsigned char any_map; /* an effect acts that changes force, displacement or voltage on their way */
    unsigned char any_rate; /* the converter asks for the rate of the voltage */
    unsigned char any_state; /* a force with states of its own acts */
    unsigned char any_memory; /* an effect that remembers acts */
    unsigned char any_renewed; /* and what it remembers changes at samples */
    int n_acting;            /* forces that act beyond the nominal and the held ones */
    int acting[GYRO_N_EFFECTS]; /* these forces, by effect */
} gyro_view;

static inline double larger(double a, double b) { return a > b ? a : b; }
static inline double smaller(double a, double b) { return a < b ? a : b; }
static inline double unit_step(double a) { return a > 0.0 ? 1.0 : a < 0.0 ? 0.0 : 0.5; }

/* 1 - e^-z, z >= 0; the series, off by z^6/720 < 1e-18 z, is fast where a lag is long. */
static inline double decayed(double z)
{
    return z < 1e-3 ? z * (1.0 - z / 2.0 * (1.0 - z / 3.0 * (1.0 - z / 4.0 * (1.0 - z / 5.0)))) : -gyro_expm1(-z);
}

/* The variable `vr` nears its value as set with the time constant `lag` [s]; `index` is its place in `lagging`. */
static inline void follow(gyro_view *g, int vr, int index, double lag)
{
    const double set = g->p[vr];
    if (lag > 0.0 && g->lagging[index] != set) {
        g->p[vr] = g->lagging[index] + (set - g->lagging[index]) * decayed(g->since / lag);
    }
    g->lagging_now[index] = g->p[vr];
}
"""


def _activity(model: Model) -> str:
    lines = []
    for effect in model.effects:
        switches = [q for e in (effect, *model.wakers(effect)) for q in e.sizes]
        tests = [f"g->p[{macro(q.name)}] != {c_double(q.start)}" for q in switches]
        lines.append(f"    g->active[{effect_macro(effect)}] = {' || '.join(tests) or '1'};\n")
    law = " || ".join(f"g->active[{effect_macro(e)}]" for e in (*follows_of(model), *model.laws)) or "0"
    state = _any_of(e for e in added_forces(model) if e.states)
    memory = _any_of(e for e in model.effects if e.memories)
    mapped = _any_of(e for e in model.effects if isinstance(e, Map) and not e.nominal)
    renewed = _any_of(e for e in model.effects if _is_renewed(e))
    acting = "".join(guarded(e, f"g->acting[g->n_acting++] = {effect_macro(e)};\n") for e in added_forces(model))
    bent = " || ".join(f"g->active[{effect_macro(e)}]" for e in added_forces(model) if not is_linear(e, model)) or "0"
    changing = "".join(f" && !g->active[{effect_macro(e)}]" for e in unsteady(model))
    crooked = "".join(f" && !g->active[{effect_macro(e)}]" for e in uneven(model))
    impulse = " || ".join(f"g->active[{effect_macro(e)}]" for e in model.forces if e.impulse) or "0"
    rate = " || ".join(f"g->active[{effect_macro(e)}]" for e in model.effects if _asks_rate(e)) or "0"
    owners = ", ".join(effect_macro(e) for e in model.forces for _ in e.states) or "GYRO_N_EFFECTS"
    return (
        "/* The effects that own the states beside the motion, by state. */\n"
        f"static const int gyro_owners[] = {{{owners}}};\n\n"
        "/* Marks the effects that a size parameter switches on, their own or that of a law which changes one. */\n"
        "static inline void find_active(gyro_view *g)\n{\n"
        + "".join(lines)
        + f"    g->any_law = {law};\n    g->any_impulse = {impulse};\n"
        + f"    g->any_map = {mapped};\n    g->any_rate = {rate};\n"
        + f"    g->any_state = {state};\n    g->any_curved = {bent};\n"
        + f"    g->any_memory = {memory};\n    g->any_renewed = {renewed};\n"
        + f"    g->steady = !g->any_curved{changing};\n"
        + f"    g->even = g->any_state{crooked};\n    g->n_acting = 0;\n"
        + textwrap.indent(acting, "    ")
        + "}\n"
    )


def _any_of(effects: Iterable[Effect]) -> str:
    return " || ".join(f"g->active[{effect_macro(e)}]" for e in effects) or "0"


def _is_renewed(effect: Effect) -> bool:
    return any(memory.sample is not None for memory in effect.memories)


def _begin(model: Model) -> str:
    wakes = "".join(
        f"if (g->active[{effect_macro(e)}] && !acted[{effect_macro(e)}]) {{\n{indented}}}\n"
        for e in follows_of(model)
        for indented in (textwrap.indent(_lag_starts(e), "    "),)
    )
    rests = "".join(
        f"if (!g->active[{effect_macro(e)}]) {{\n{zeros}}}\n"
        for e in model.forces
        if (zeros := "".join(f"    g->s[{state_macro(s.symbol)}] = 0.0;\n" for s in e.states))
    )
    rests += "".join(
        f"if (!g->active[{effect_macro(e)}]) {{\n{zeros}}}\n"
        for e in model.effects
        if (
            zeros := "".join(
                f"    g->{what}[{memory_macro(m.symbol)}] = 0.0;\n"
                for m in e.memories
                for what in ("remembered", "remembered_now")
            )
        )
    )
    return (
        "/* After find_active, where the effects in `acted` did: what lags begins to do so from its value as set, and\n"
        "   states and memories of an effect that does not act rest. */\n"
        "static inline void begin_acting(gyro_view *g, const unsigned char acted[GYRO_N_EFFECTS],\n"
        "                                const double value[GYRO_N_VARIABLES])\n"
        f"{{\n    (void)acted;\n    (void)value;\n{textwrap.indent(wakes + rests, '    ')}}}\n"
    )


def _lag_starts(effect: Follow) -> str:
    return "".join(
        f"g->lagging[{lagging_macro(target)}] = value[{macro(symbols.SET_BY.get(target, target).name)}];\n"
        for target in effect.follows
    )


def _streams(model: Model) -> str:
    pink = [e for e in model.effects if e.symbols & set(symbols.PINK)]
    places = "".join(f"    {pink.index(e) if e in pink else -1}, /* {e.id} */\n" for e in model.effects)
    rows = _stream_rows(model, [e for e in model.effects if e.drawn])
    start_rows = _stream_rows(model, [e for e in model.effects if e.drawn_at_start])
    return (
        "/* The noise stream of each effect, 0 where it draws none. It is made from the effect's id, so that a new\n"
        "   effect leaves the noise of the others alone. */\n"
        f"static const uint32_t streams[GYRO_N_EFFECTS] = {{\n{rows}}};\n\n"
        "/* Likewise of effects that draw as they begin to act: the numbers of sample 0. */\n"
        f"static const uint32_t start_streams[GYRO_N_EFFECTS] = {{\n{start_rows}}};\n\n"
        "/* The place of each effect that draws pink numbers among those that do, -1 of the others. */\n"
        f"static const int pink_places[GYRO_N_EFFECTS] = {{\n{places}}};\n"
    )


def _stream_rows(model: Model, drawing: Sequence[Effect]) -> str:
    return "".join(
        f"    {zlib.crc32(e.id.encode()):#010x}u, /* {e.id} */\n" if e in drawing else f"    0u, /* {e.id}: none */\n"
        for e in model.effects
    )


def _events(model: Model) -> str:
    timed = ((e, e.event.name) for e in model.laws if e.event is not None)
    lines = "".join(guarded(e, f"time[{effect_macro(e)}] = g->p[{macro(name)}];\n") for e, name in timed)
    return (
        "/* The time of each active effect's event [s]; the entries of the others stay as they are. */\n"
        "static inline void event_times(const gyro_view *g, double time[GYRO_N_EFFECTS])\n"
        f"{{\n{textwrap.indent(lines, '    ')}}}\n"
    )


def _laws(model: Model) -> str:
    targets = sorted({target for law in model.laws for target in law.changes} | set(model.followed), key=str)
    lines = "".join(map(as_set, targets))
    places = "".join(f"    {macro(target.name)},\n" for target in targets) or "    0, /* none */\n"
    lines += "".join(guarded(e, called(e, f"effect_{e.id}(g);\n")) for e in (*follows_of(model), *model.laws))
    made = "".join(f"    {as_set(symbol)}" for symbol in symbols.SET_BY)
    new = " || ".join(f"value[{macro(n)}] != held[{macro(n)}]" for n in _read_by_laws(model, targets)) or "0"
    start = "".join(textwrap.indent(_lag_starts(e), "    ") for e in follows_of(model))
    moving = "".join([*map(_moving, follows_of(model)), *map(_moving, model.laws)])
    return (
        "/* What is made of the inputs, before any law. */\n"
        "static inline void take_made(gyro_view *g, const double value[GYRO_N_VARIABLES])\n"
        f"{{\n{made}}}\n\n"
        "/* What lags starts at its value as set. */\n"
        "static inline void start_lagging(gyro_view *g, const double value[GYRO_N_VARIABLES])\n"
        f"{{\n{start}}}\n\n"
        "/* What laws change. */\n"
        f"enum {{ GYRO_N_LAW_TARGETS = {max(1, len(targets))} }};\n"
        f"static const int law_targets[GYRO_N_LAW_TARGETS] = {{\n{places}}};\n\n"
        "/* Whether laws or noise forces read an input that is new. */\n"
        "static inline int laws_read_new(const double value[GYRO_N_VARIABLES], const double held[GYRO_N_VARIABLES])\n"
        f"{{\n    (void)value;\n    (void)held;\n    return {new};\n}}\n\n"
        "/* Parameter laws: from the values as set, at the time and events of the view. */\n"
        "static inline void apply_laws(gyro_view *g, const double value[GYRO_N_VARIABLES])\n"
        f"{{\n{textwrap.indent(lines, '    ')}}}\n\n"
        "/* Whether laws change parameters from now to the next cut: by time itself, or by what has not settled. */\n"
        "static inline int laws_move(const gyro_view *g, const double value[GYRO_N_VARIABLES])\n"
        f"{{\n    int moving = 0;\n    (void)value;\n{textwrap.indent(moving, '    ')}    return moving;\n}}\n"
    )


def _read_by_laws(model: Model, targets: Iterable[Symbol]) -> list[str]:
    """Names of the inputs that laws and noise forces read, or that laws change."""
    readers = (*follows_of(model), *model.laws, *(e for e in model.forces if e.drawn))
    read = {symbols.SET_BY.get(symbol, symbol).name for e in readers for symbol in (*e.symbols, *targets)}
    return [quantity.name for quantity in model.quantities if quantity.role == "input" and quantity.name in read]


def _moving(effect: Follow | Law) -> str:
    if isinstance(effect, Law):
        if symbols.t in effect.symbols:
            return guarded(effect, "moving = 1;\n")
        rates = [f"rate[{memory_macro(memory.symbol)}] != 0.0" for memory in effect.memories if memory.flows]
        test = f"double rate[GYRO_N_FLOWING];\nflow_effect_{effect.id}(g, rate);\n"
        test += f"moving = moving || {' || '.join(rates)};\n"
        return guarded(effect, test) if rates else ""
    tests = (
        f"g->lagging[{lagging_macro(target)}] != value[{macro(symbols.SET_BY.get(target, target).name)}]"
        for target in effect.follows
    )
    return guarded(effect, f"moving = moving || {' || '.join(tests)};\n")


def _remembering(model: Model) -> str:
    targets = {target for law in model.laws for target in law.changes} | set(model.followed)
    lines = "".join(as_set(target) for target in sorted(targets, key=str))
    lines += "".join(guarded(e, f"effect_{e.id}(g);\n") for e in follows_of(model))
    for law in model.laws:
        lines += guarded(law, _begun(law) + called(law, f"effect_{law.id}(g);\n"))
    maps = [e for e in model.effects if isinstance(e, Map) and e.memories]
    lines += "".join(guarded(e, _begun(e)) for e in maps)
    renewed = "".join(guarded(e, f"renew_effect_{e.id}(g);\n") for e in model.effects if _is_renewed(e))
    flowing = [e for e in model.effects if any(memory.flows for memory in e.memories)]
    flow = "".join(guarded(e, f"flow_effect_{e.id}(g, rate);\n") for e in flowing)
    return (
        "/* What the effects remember that act and did not in `acted` begins, numbers drawn. */\n"
        "static inline void begin_memories(gyro_view *g, const double value[GYRO_N_VARIABLES],\n"
        "                                  const unsigned char acted[GYRO_N_EFFECTS])\n"
        f"{{\n    (void)acted;\n{textwrap.indent(lines, '    ')}}}\n\n"
        "/* What effects remember after a sample, `since` the one before, numbers drawn. */\n"
        "static inline void renew_memories(gyro_view *g)\n"
        f"{{\n    (void)g;\n{textwrap.indent(renewed, '    ')}}}\n\n"
        "/* The rate of what flows [SI/s], laws applied. */\n"
        "static inline void flow_memories(const gyro_view *g, double *rate)\n"
        "{\n    for (int i = 0; i < GYRO_N_FLOWING; i++) {\n        rate[i] = 0.0;\n    }\n"
        f"    (void)g;\n{textwrap.indent(flow, '    ')}}}\n"
    )


def _begun(effect: Effect) -> str:
    if not effect.memories:
        return ""
    return f"if (!acted[{effect_macro(effect)}]) {{\n    begin_effect_{effect.id}(g);\n}}\n"


def _holds(model: Model) -> str:
    delay = next((e.delay.name for e in model.effects if isinstance(e, Delay)), None)
    lag = next((e.time_constant.name for e in model.effects if isinstance(e, Lag)), None)
    acts = next((f"g->active[{effect_macro(e)}]" for e in model.effects if isinstance(e, Lag)), None)
    body = [
        f"    return g->p[{macro(name)}];\n" if name else "    (void)g;\n    return 0.0;\n" for name in (delay, lag)
    ]
    answer = f"    return {acts};\n" if acts else "    (void)g;\n    return 0;\n"
    return (
        "/* Delay of the force [s]. */\n"
        f"static inline double force_delay(const gyro_view *g)\n{{\n{body[0]}}}\n\n"
        "/* Time constant of the amplifier [s]. */\n"
        f"static inline double lag_time_constant(const gyro_view *g)\n{{\n{body[1]}}}\n\n"
        "/* Whether the amplifier lags. */\n"
        f"static inline int lag_acts(const gyro_view *g)\n{{\n{answer}}}\n"
    )


def as_set(target: Symbol) -> str:
    """The line that gives ``target`` its value as set."""
    return f"g->p[{macro(target.name)}] = value[{macro(symbols.SET_BY.get(target, target).name)}];\n"


def _derivative(model: Model) -> str:
    nominal = "".join(f"    {force_call(e)}" for e in model.forces if e.nominal)
    others = "".join(f"case {effect_macro(e)}:\n    {force_call(e)}    break;\n" for e in added_forces(model))
    held = "".join(guarded(e, force_call(e)) for e in model.forces if e.drawn)
    quiet = "".join(f"    rate[{state_macro(s.symbol)}] = 0.0;\n" for s in model.states)
    return f"""/* The noise forces [N], drawn with the latest sample. */
static inline void hold_noise(gyro_view *g)
{{
    double force[2] = {{0.0, 0.0}};
{textwrap.indent(held, "    ")}    g->held[0] = force[0];
    g->held[1] = force[1];
}}

/* Newton's law: rate [SI/s] of every state, shape (GYRO_N_STATES), from states, parameters and force of the view. */
static inline void state_rate(const gyro_view *g, double rate[GYRO_N_STATES])
{{
    double force[2] = {{g->u[0] + g->held[0], g->u[1] + g->held[1]}};
{quiet}{nominal}    /* A list, not a row of tests: a model may have hundreds of forces of which one acts. */
    for (int i = 0; i < g->n_acting; i++) {{
        switch (g->acting[i]) {{
{textwrap.indent(others, "        ")}        default:
            break;
        }}
    }}
    rate[GYRO_STATE_X] = g->s[GYRO_STATE_X_DOT];
    rate[GYRO_STATE_Y] = g->s[GYRO_STATE_Y_DOT];
    rate[GYRO_STATE_X_DOT] = force[0] * g->inverse_mass;
    rate[GYRO_STATE_Y_DOT] = force[1] * g->inverse_mass;
}}
"""


def _kick(model: Model) -> str:
    pushed = "".join(guarded(e, f"impulse_effect_{e.id}(g, impulse);\n") for e in model.forces if e.impulse)
    return (
        "/* The velocities jump by the impulses that a change of the held inputs gives. */\n"
        "static inline void kick(gyro_view *g)\n"
        f"{{\n    double impulse[2] = {{0.0, 0.0}};\n{textwrap.indent(pushed, '    ')}"
        "    g->s[GYRO_STATE_X_DOT] += impulse[0] * g->inverse_mass;\n"
        "    g->s[GYRO_STATE_Y_DOT] += impulse[1] * g->inverse_mass;\n}\n"
    )


def _asks_rate(effect: Effect) -> bool:
    return bool({symbols.v_x_rate, symbols.v_y_rate} & effect.symbols)


_STAGES = (
    ("actuate", "The force from the command to the mass, after the delay.", "actuator delay", "actuator misalignment"),
    (
        "pick_off",
        "The voltage before the amplifier's lag, from the displacement.",
        "pickoff misalignment",
        "amplifier feedthrough",
    ),
    ("amplify", "The voltage after the amplifier's lag.", "amplifier offset", "amplifier drift"),
    ("convert", "The sample from the voltage.", "sampled noise", "sampled round"),
)


def _stage(model: Model, name: str, text: str, first: str, last: str, *, moving: bool = False) -> str:
    order = list(SLOTS)
    span = order[order.index(first) : order.index(last) + 1]
    passes = ("_rate", "") if moving else ("",)
    slots = [(slot, members) for slot, members in chain(model) if slot in span]
    body = "".join(
        _where_any_acts("".join(slot_lines(slot, members, of) for slot, members in row for of in passes), nominal)
        for nominal, row in groupby(slots, key=lambda pair: any(effect.nominal for effect in pair[1]))
    )
    start = "    g->q[0] = g->s[GYRO_STATE_X];\n    g->q[1] = g->s[GYRO_STATE_Y];\n" if name == "pick_off" else ""
    if moving:
        name, text = f"{name}_moving", f"{text} And its rate, before each value that it is made from changes."
        start += _MOVING if start else ""
    declared = "    double out[2];\n" if body else "    (void)g;\n"
    return f"/* {text} */\nstatic inline void {name}(gyro_view *g)\n{{\n{declared}{start}{body}}}\n"


def _where_any_acts(lines: str, nominal: bool) -> str:
    """``lines`` of maps, under one test for all those of devices that are more than nominal."""
    return lines if nominal else f"    if (g->any_map) {{\n{textwrap.indent(lines, '    ')}    }}\n"


_MOVING = """    state_rate(g, g->s_rate);
    g->q_rate[0] = g->s_rate[GYRO_STATE_X];
    g->q_rate[1] = g->s_rate[GYRO_STATE_Y];
"""


def slot_lines(slot: str, members: Sequence[Map], of: str) -> str:
    """The maps of one slot of the chain, called where they are active; ``of`` is "_rate" for their rates."""
    # Effects that share a slot see the same entering signal, and their changes add up; one alone just replaces the
    # signal, so that a clipped or rounded value is exactly what the effect says.
    enters, leaves = (re.sub("_x$", of, pair[0].name) for pair in SLOTS[slot])
    function = "rate_effect" if of else "effect"
    if len(members) == 1:
        [effect] = members
        call = called(effect, f"{function}_{effect.id}(g, out);\n")
        assign = f"{call}g->{leaves}[0] = out[0];\ng->{leaves}[1] = out[1];\n"
        return textwrap.indent(assign if effect.nominal else guarded(effect, assign), "    ")
    lines = f"const double entering[2] = {{g->{enters}[0], g->{enters}[1]}};\n"
    lines += "double sum[2] = {entering[0], entering[1]};\n"
    for effect in members:
        add = called(effect, f"{function}_{effect.id}(g, out);\n")
        add += "sum[0] += out[0] - entering[0];\nsum[1] += out[1] - entering[1];\n"
        lines += guarded(effect, add)
    lines += f"g->{leaves}[0] = sum[0];\ng->{leaves}[1] = sum[1];\n"
    return "    {\n" + textwrap.indent(lines, "        ") + "    }\n"
