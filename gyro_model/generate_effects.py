"""Writes ``effects.h``: one C function an effect, then the stages that call those that are active. Formulae are
printed as they stand in the effect files, one function each, nothing shared between them."""

import re
import textwrap
import zlib
from collections.abc import Iterable, Mapping, Sequence
from functools import lru_cache
from itertools import combinations_with_replacement

from sympy import Expr, Symbol, diff, sympify

from gyro_model import symbols
from gyro_model.anatomy import SLOTS, Delay, Effect, Follow, Force, Lag, Law, Map, Memory
from gyro_model.c_printing import (
    STAMP,
    c_double,
    c_expression,
    effect_macro,
    lagging_macro,
    macro,
    memory_macro,
    state_macro,
)
from gyro_model.model import Model, chain


def _comment(text: str) -> str:
    lines = text.strip().splitlines()
    body = "\n".join(f"   {line}".rstrip() for line in lines[1:])
    return f"/* {lines[0]}" + (f"\n{body}" if body else "") + " */\n"


def _rate_of(symbol: Symbol) -> Symbol:
    return Symbol(f"{symbol.name}_rate", real=True)


_SIGNALS = {
    symbol: f"{array}[{axis}]"
    for array, pair in {
        "u": (symbols.u_x, symbols.u_y),
        "q": (symbols.q_x, symbols.q_y),
        "v": (symbols.v_x, symbols.v_y),
        "q_rate": (_rate_of(symbols.q_x), _rate_of(symbols.q_y)),
        "v_rate": (symbols.v_x_rate, symbols.v_y_rate),
    }.items()
    for axis, symbol in enumerate(pair)
}


class Places:
    """Where an effect's symbols live in ``gyro_view``, as declarations of local constants."""

    def __init__(self, model: Model) -> None:
        self.model = model
        self.state_rates = {_rate_of(state): state for state in model.state_symbols}
        self.units = {s.symbol: s.unit for s in model.states} | dict(
            zip(symbols.STATES, ("m", "m/s", "m", "m/s"), strict=True)
        )

    def declare(self, effect: Effect, exprs: Iterable[Expr], remembered: str = "remembered_now") -> str:
        """``remembered``: where what effects remember is taken from."""
        used = sorted(set().union(*(expr.free_symbols for expr in exprs)), key=lambda symbol: symbol.name)
        return "".join(f"    const double {s.name} = {self._place(s, effect, remembered)};\n" for s in used)

    def _place(self, symbol: Symbol, effect: Effect, remembered: str) -> str:
        if symbol in {memory.symbol for memory in effect.memories}:
            return f"g->{remembered}[{memory_macro(symbol)}]"
        if symbol == symbols.since:
            return "g->since"
        if symbol in _SIGNALS:
            return f"g->{_SIGNALS[symbol]}"
        if symbol in self.state_rates:
            return f"g->s_rate[{state_macro(self.state_rates[symbol])}]"
        if symbol in self.units:
            return f"g->s[{state_macro(symbol)}]"
        if symbol in symbols.CHANGES:
            return f"g->change[{macro(symbols.CHANGES[symbol].name)}]"
        if symbol == symbols.t:
            return "g->t"
        if symbol == symbols.after:
            return f"g->after[{effect_macro(effect)}]"
        for numbers in (symbols.NORMAL, symbols.PINK):
            if symbol in numbers:
                return f"g->drawn[{effect_macro(effect)}][{numbers.index(symbol)}]"
        return f"g->p[{macro(symbol.name)}]"


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
    parts += [_force(e, place) for e in model.forces]
    parts += [_memories(e, place) for e in model.effects if e.memories]
    parts += [_follow(e) for e in follows_of(model)]
    parts += [_law(e, place) for e in model.laws]
    parts += [_map(e, place) for e in model.effects if isinstance(e, Map)]
    parts += [
        _activity(model),
        _begin(model),
        _streams(model),
        _events(model),
        _laws(model),
        _remembering(model),
        _holds(model),
        _derivative(model),
        _propagated(model, place),
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
    unsigned char any_impulse;
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


def _function(effect: Effect, arguments: str, body: str) -> str:
    head = f"static inline void effect_{effect.id}({arguments})\n"
    return f"{_comment(effect.doc)}{head}{{\n{body}}}\n"


def _force(effect: Force, place: Places) -> str:
    terms = effect.terms()
    body = place.declare(effect, (expr for name, expr in terms.items() if not name.startswith("impulse")))
    body += _added("force", terms)
    for state in effect.states:
        body += f"    rate[{state_macro(state.symbol)}] = {c_expression(state.rate)};\n"
    rate = ", double *rate" if effect.states else ""
    function = _function(effect, f"const gyro_view *g, double force[2]{rate}", body)
    if effect.impulse:
        declared = place.declare(effect, (terms["impulse_x"], terms["impulse_y"]))
        head = f"static inline void impulse_{effect.id}(const gyro_view *g, double impulse[2])"
        function += f"\n{head}\n{{\n{declared}{_added('impulse', terms)}}}\n"
    return function


def _added(what: str, terms: Mapping[str, Expr]) -> str:
    pair = (terms[f"{what}_x"], terms[f"{what}_y"])
    return "".join(f"    {what}[{axis}] += {c_expression(expr)};\n" for axis, expr in enumerate(pair) if expr != 0)


def _memories(effect: Effect, place: Places) -> str:
    """What the effect remembers as it begins, within a step, after a sample, and its rate where it flows."""
    of = effect.memories
    parts = [_remember("begin", effect, place, "remembered", [(m, m.start) for m in of])]
    parts += [
        _remember("recall", effect, place, "remembered_now", [(m, m.symbol if m.now is None else m.now) for m in of])
    ]
    renewed = [(m, m.sample) for m in of if m.sample is not None]
    parts += [_remember("renew", effect, place, "remembered", renewed)] if renewed else []
    flowing = [m for m in of if m.flows]
    if flowing:
        lines = "".join(f"    rate[{memory_macro(m.symbol)}] = {c_expression(m.rate)};\n" for m in flowing)
        head = f"static inline void flow_{effect.id}(const gyro_view *g, double rate[GYRO_N_FLOWING])"
        parts += [f"{head}\n{{\n{place.declare(effect, [m.rate for m in flowing], 'remembered')}{lines}}}\n"]
    return "\n".join(parts)


def _remember(what: str, effect: Effect, place: Places, to: str, made: Sequence[tuple[Memory, Expr]]) -> str:
    exprs = [sympify(expr) for _, expr in made]
    lines = "".join(
        f"    g->{to}[{memory_macro(m.symbol)}] = {c_expression(expr)};\n"
        for (m, _), expr in zip(made, exprs, strict=True)
    )
    head = f"static inline void {what}_{effect.id}(gyro_view *g)"
    return f"{head}\n{{\n{place.declare(effect, exprs, 'remembered')}{lines}}}\n"


def called(effect: Effect, call: str) -> str:
    """``call`` of a function of ``effect``, with what it remembers recalled before."""
    return f"recall_{effect.id}(g);\n{call}" if effect.memories else call


def _follow(effect: Follow) -> str:
    lines = "".join(
        f"    follow(g, {macro(target.name)}, {lagging_macro(target)}, g->p[{macro(constant.name)}]);\n"
        for target, constant in effect.follows.items()
    )
    return _function(effect, "gyro_view *g", lines)


def _law(effect: Law, place: Places) -> str:
    lines = "".join(f"    g->p[{macro(name)}] = {c_expression(expr)};\n" for name, expr in effect.made().items())
    return _function(effect, "gyro_view *g", place.declare(effect, effect.made().values()) + lines)


def _map(effect: Map, place: Places) -> str:
    lines = "".join(f"    out[{axis}] = {c_expression(expr)};\n" for axis, expr in enumerate(effect.made().values()))
    declared = place.declare(effect, effect.made().values())
    function = _function(effect, "const gyro_view *g, double out[2]", declared + lines)
    return function + ("\n" + _map_rate(effect, place) if effect.stage in ("pickoff", "amplifier") else "")


def _map_rate(effect: Map, place: Places) -> str:
    """The time derivative of a map's output, inputs and parameters held: the chain rule on what moves."""
    moving = (*SLOTS[effect.slot].enters, *place.model.state_symbols)
    rates = [
        sum((expr.diff(symbol) * _rate_of(symbol) for symbol in moving), expr.diff(symbols.t))
        for expr in effect.made().values()
    ]
    lines = "".join(f"    out[{axis}] = {c_expression(expr)};\n" for axis, expr in enumerate(rates))
    unused = "" if any(rate.free_symbols for rate in rates) else "    (void)g;\n"
    head = f"static inline void rate_{effect.id}(const gyro_view *g, double out[2])"
    return f"{head}\n{{\n{place.declare(effect, rates)}{unused}{lines}}}\n"


def _activity(model: Model) -> str:
    lines = []
    for effect in model.effects:
        switches = [q for e in (effect, *model.wakers(effect)) for q in e.sizes]
        tests = [f"g->p[{macro(q.name)}] != {c_double(q.start)}" for q in switches]
        lines.append(f"    g->active[{effect_macro(effect)}] = {' || '.join(tests) or '1'};\n")
    law = " || ".join(f"g->active[{effect_macro(e)}]" for e in (*follows_of(model), *model.laws)) or "0"
    state = _any_of(e for e in added_forces(model) if e.states)
    memory = _any_of(e for e in model.effects if e.memories)
    renewed = _any_of(e for e in model.effects if _is_renewed(e))
    acting = "".join(guarded(e, f"g->acting[g->n_acting++] = {effect_macro(e)};\n") for e in added_forces(model))
    bent = " || ".join(f"g->active[{effect_macro(e)}]" for e in added_forces(model) if not is_linear(e, model)) or "0"
    unsteady = "".join(f" && !g->active[{effect_macro(e)}]" for e in _unsteady(model))
    impulse = " || ".join(f"g->active[{effect_macro(e)}]" for e in model.forces if e.impulse) or "0"
    rate = " || ".join(f"g->active[{effect_macro(e)}]" for e in model.effects if _asks_rate(e)) or "0"
    return (
        "/* Marks the effects that a size parameter switches on, their own or that of a law which changes one. */\n"
        "static inline void find_active(gyro_view *g)\n{\n"
        + "".join(lines)
        + f"    g->any_law = {law};\n    g->any_impulse = {impulse};\n"
        + f"    g->any_rate = {rate};\n    g->any_state = {state};\n    g->any_curved = {bent};\n"
        + f"    g->any_memory = {memory};\n    g->any_renewed = {renewed};\n"
        + f"    g->steady = !g->any_curved{unsteady};\n    g->n_acting = 0;\n"
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
    targets = {target for law in model.laws for target in law.changes} | set(model.followed)
    lines = "".join(as_set(target) for target in sorted(targets, key=str))
    lines += "".join(guarded(e, called(e, f"effect_{e.id}(g);\n")) for e in (*follows_of(model), *model.laws))
    made = "".join(f"    {as_set(symbol)}" for symbol in symbols.SET_BY)
    start = "".join(textwrap.indent(_lag_starts(e), "    ") for e in follows_of(model))
    moving = "".join([*map(_moving, follows_of(model)), *map(_moving, model.laws)])
    return (
        "/* What is made of the inputs, before any law. */\n"
        "static inline void take_made(gyro_view *g, const double value[GYRO_N_VARIABLES])\n"
        f"{{\n{made}}}\n\n"
        "/* What lags starts at its value as set. */\n"
        "static inline void start_lagging(gyro_view *g, const double value[GYRO_N_VARIABLES])\n"
        f"{{\n{start}}}\n\n"
        "/* Parameter laws: from the values as set, at the time and events of the view. */\n"
        "static inline void apply_laws(gyro_view *g, const double value[GYRO_N_VARIABLES])\n"
        f"{{\n{textwrap.indent(lines, '    ')}}}\n\n"
        "/* Whether laws change parameters from now to the next cut: by time itself, or by what has not settled. */\n"
        "static inline int laws_move(const gyro_view *g, const double value[GYRO_N_VARIABLES])\n"
        f"{{\n    int moving = 0;\n    (void)value;\n{textwrap.indent(moving, '    ')}    return moving;\n}}\n"
    )


def _moving(effect: Follow | Law) -> str:
    if isinstance(effect, Law):
        if symbols.t in effect.symbols:
            return guarded(effect, "moving = 1;\n")
        rates = [f"rate[{memory_macro(memory.symbol)}] != 0.0" for memory in effect.memories if memory.flows]
        test = f"double rate[GYRO_N_FLOWING];\nflow_{effect.id}(g, rate);\nmoving = moving || {' || '.join(rates)};\n"
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
    renewed = "".join(guarded(e, f"renew_{e.id}(g);\n") for e in model.effects if _is_renewed(e))
    flowing = [e for e in model.effects if any(memory.flows for memory in e.memories)]
    flow = "".join(guarded(e, f"flow_{e.id}(g, rate);\n") for e in flowing)
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
    return f"if (!acted[{effect_macro(effect)}]) {{\n    begin_{effect.id}(g);\n}}\n"


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


def follows_of(model: Model) -> list[Follow]:
    """The effects that make a quantity lag."""
    return [e for e in model.effects if isinstance(e, Follow)]


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


def is_curved(exprs: Iterable[Expr], signals: Sequence[Symbol]) -> bool:
    """Whether some expression is not affine in ``signals``."""
    pairs = tuple(combinations_with_replacement(signals, 2))
    # A derivative that is zero in disguise only has its effect followed the longer way, which is as right.
    return any(diff(expr, *pair) != 0 for expr in exprs for pair in pairs)


def is_linear(effect: Force, model: Model) -> bool:
    """Whether the force is affine in the motion, stays while nothing else does, and has no states of its own."""
    return effect.id in _linear(model)


@lru_cache(maxsize=8)
def _linear(model: Model) -> frozenset[str]:
    # Kept: second derivatives of some hundred forces take a second.
    forces = (e for e in model.forces if not (symbols.t in e.symbols or e.states))
    return frozenset(e.id for e in forces if not is_curved(e.force, model.state_symbols))


def _is_steady(effect: Force, model: Model) -> bool:
    """Whether the slopes of a linear force stay while parameters do, but for the rate, in which they are quadratic."""
    moving = {q.symbol for q in model.quantities if q.role == "input"} | set(model.followed) | set(symbols.SET_BY)
    moving |= {symbols.u_x, symbols.u_y}
    slopes = [expr for row in _slopes(effect) for expr in row]
    read = set().union(*(expr.free_symbols for expr in slopes))
    return not read & (moving - {symbols.omega_z}) and all(diff(expr, symbols.omega_z, 3) == 0 for expr in slopes)


def _unsteady(model: Model) -> list[Effect]:
    """The linear forces whose slopes may change, and the laws that change a parameter of any slope."""
    linear = [e for e in model.forces if is_linear(e, model)]
    read = {symbol for e in linear for row in _slopes(e) for expr in row for symbol in expr.free_symbols}
    laws = [*(e for e in model.laws if read & set(e.changes)), *(e for e in follows_of(model) if read & set(e.follows))]
    return [*(e for e in linear if not _is_steady(e, model)), *laws]


def _slopes(effect: Force) -> list[list[Expr]]:
    return [[force.diff(state) for state in symbols.STATES] for force in effect.force]


def _at_rest(effect: Force) -> list[Expr]:
    return [force.subs(dict.fromkeys(symbols.STATES, 0)) for force in effect.force]


def _slope(effect: Force, place: Places) -> str:
    """The derivatives of a linear force."""
    slopes = _slopes(effect)
    lines = "".join(
        f"    slope[{axis}][{state_macro(state)}] += {c_expression(expr)};\n"
        for axis in (0, 1)
        for state, expr in zip(symbols.STATES, slopes[axis], strict=True)
        if expr != 0
    )
    head = f"static inline void slope_{effect.id}(const gyro_view *g, double slope[2][4])"
    return f"{head}\n{{\n{place.declare(effect, (*slopes[0], *slopes[1]))}{lines}}}\n" if lines else ""


def _still(effect: Force, place: Places) -> str:
    """What is left of a linear force at rest."""
    rest = _at_rest(effect)
    lines = "".join(f"    still[{axis}] += {c_expression(expr)};\n" for axis, expr in enumerate(rest) if expr != 0)
    head = f"static inline void still_{effect.id}(const gyro_view *g, double still[2])"
    return f"{head}\n{{\n{place.declare(effect, rest)}{lines}}}\n" if lines else ""


def _propagated(model: Model, place: Places) -> str:
    own = [e for e in model.forces if is_linear(e, model) and not e.drawn]
    sloping, standing = [e for e in own if _slope(e, place)], [e for e in own if _still(e, place)]
    functions = "\n".join([_slope(e, place) for e in sloping] + [_still(e, place) for e in standing])
    return f"""{functions}
/* Where any_curved is 0 the force is slope (x, x', y, y') + still [N]; slope [N/m, N.s/m], shape (2, 4). */
static inline void find_slopes(const gyro_view *g, double slope[2][4])
{{
    for (int axis = 0; axis < 2; axis++) {{
        slope[axis][0] = slope[axis][1] = slope[axis][2] = slope[axis][3] = 0.0;
    }}
{_called(sloping, "slope")}}}

static inline void find_still(const gyro_view *g, double still[2])
{{
    for (int axis = 0; axis < 2; axis++) {{
        still[axis] = g->u[axis] + g->held[axis];
    }}
{_called(standing, "still")}}}
"""


def _called(forces: Sequence[Force], what: str) -> str:
    """The calls of ``what``_ID(g, ``what``): of the nominal forces, then of those that act."""
    nominal = "".join(f"    {what}_{e.id}(g, {what});\n" for e in forces if e.nominal)
    others = "".join(
        f"case {effect_macro(e)}:\n    {what}_{e.id}(g, {what});\n    break;\n" for e in forces if not e.nominal
    )
    loop = f"""    for (int i = 0; i < g->n_acting; i++) {{
        switch (g->acting[i]) {{
{textwrap.indent(others, "        ")}        default:
            break;
        }}
    }}
"""
    return nominal + (loop if others else "")


def _kick(model: Model) -> str:
    pushed = "".join(guarded(e, f"impulse_{e.id}(g, impulse);\n") for e in model.forces if e.impulse)
    return (
        "/* The velocities jump by the impulses that a change of the held inputs gives. */\n"
        "static inline void kick(gyro_view *g)\n"
        f"{{\n    double impulse[2] = {{0.0, 0.0}};\n{textwrap.indent(pushed, '    ')}"
        "    g->s[GYRO_STATE_X_DOT] += impulse[0] * g->inverse_mass;\n"
        "    g->s[GYRO_STATE_Y_DOT] += impulse[1] * g->inverse_mass;\n}\n"
    )


def force_call(effect: Force) -> str:
    """The call that adds the force of ``effect``."""
    return f"effect_{effect.id}(g, force{', rate' if effect.states else ''});\n"


def _asks_rate(effect: Effect) -> bool:
    return bool({symbols.v_x_rate, symbols.v_y_rate} & effect.symbols)


def added_forces(model: Model) -> list[Force]:
    """The forces that are neither of the nominal device nor drawn and held."""
    return [e for e in model.forces if not e.nominal and not e.drawn]


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
    body = "".join(slot_lines(slot, members, of) for slot, members in chain(model) if slot in span for of in passes)
    start = "    g->q[0] = g->s[GYRO_STATE_X];\n    g->q[1] = g->s[GYRO_STATE_Y];\n" if name == "pick_off" else ""
    if moving:
        name, text = f"{name}_moving", f"{text} And its rate, before each value that it is made from changes."
        start += _MOVING if start else ""
    declared = "    double out[2];\n" if body else "    (void)g;\n"
    return f"/* {text} */\nstatic inline void {name}(gyro_view *g)\n{{\n{declared}{start}{body}}}\n"


_MOVING = """    state_rate(g, g->s_rate);
    g->q_rate[0] = g->s_rate[GYRO_STATE_X];
    g->q_rate[1] = g->s_rate[GYRO_STATE_Y];
"""


def slot_lines(slot: str, members: Sequence[Map], of: str) -> str:
    """The maps of one slot of the chain, called where they are active; ``of`` is "_rate" for their rates."""
    # Effects that share a slot see the same entering signal, and their changes add up; one alone just replaces the
    # signal, so that a clipped or rounded value is exactly what the effect says.
    enters, leaves = (re.sub("_x$", of, pair[0].name) for pair in SLOTS[slot])
    function = "rate" if of else "effect"
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


def guarded(effect: Effect, lines: str) -> str:
    """``lines`` where ``effect`` is active."""
    return f"if (g->active[{effect_macro(effect)}]) {{\n{textwrap.indent(lines, '    ')}}}\n"
