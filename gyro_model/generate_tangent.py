"""Writes ``tangent.h``: how rates and signals move when inputs and states move along a direction, effect by effect,
from the symbolic derivatives of their formulae. Noise is held."""

import textwrap
from collections.abc import Iterable, Sequence
from functools import lru_cache

from sympy import DiracDelta, Expr, Heaviside, Piecewise, Symbol, sympify

from gyro_model import symbols
from gyro_model.anatomy import SLOTS, Delay, Effect, Force, Lag, Map
from gyro_model.c_printing import (
    STAMP,
    c_expression,
    effect_macro,
    lagging_macro,
    macro,
    memory_macro,
    state_macro,
)
from gyro_model.effect_functions import Places, added_forces, called, follows_of, guarded
from gyro_model.generate_effects import as_set
from gyro_model.model import Model, chain

_SIGNALS = {"u": (symbols.u_x, symbols.u_y), "q": (symbols.q_x, symbols.q_y), "v": (symbols.v_x, symbols.v_y)}


def tangent(model: Model) -> str:
    """``tangent.h`` of ``model``."""
    places = Places(model)
    forces = [e for e in model.forces if not e.drawn]
    maps = [e for e in model.effects if isinstance(e, Map) and e.stage in ("actuator", "pickoff", "amplifier")]
    parts = [
        _PROLOGUE,
        *(_recall(e, places) for e in model.effects if e.memories),
        *(_function(e, list(e.made().values()), places) for e in model.laws),
        *(_force(e, places) for e in forces),
        *(_function(e, list(e.made().values()), places) for e in maps),
        _laws(model),
        _chain(model, "actuate", "actuator delay", "actuator misalignment", ""),
        _chain(model, "pick_off", "pickoff misalignment", "amplifier feedthrough", _PICK_OFF),
        _rate(model, forces),
        _lags(model),
        _flow(model),
        _jumping(model),
    ]
    return f"{STAMP}\n#ifndef GYRO_TANGENT_H\n#define GYRO_TANGENT_H\n\n" + "\n".join(parts) + "\n#endif\n"


_PROLOGUE = """#include "effects.h"

/* By how much what the view holds moves along a direction, in its own units for one unit of the direction. */
typedef struct {
    double p[GYRO_N_VARIABLES];
    double s[GYRO_N_STATES];
    double lagging[GYRO_N_LAGGING];
    double remembered[GYRO_N_MEMORIES];
    double remembered_now[GYRO_N_MEMORIES];
    double u[2];
    double q[2];
    double v[2];
} gyro_tangent;
"""
_PICK_OFF = """    g->q[0] = g->s[GYRO_STATE_X];
    g->q[1] = g->s[GYRO_STATE_Y];
    d->q[0] = d->s[GYRO_STATE_X];
    d->q[1] = d->s[GYRO_STATE_Y];
"""


def _moves(symbol: Symbol, model: Model, remembered: str = "remembered_now") -> str:
    """Where the tangent of ``symbol`` stands; "" where it does not move."""
    if symbol in {memory.symbol for memory in model.memories}:
        return f"d->{remembered}[{memory_macro(symbol)}]"
    for array, pair in _SIGNALS.items():
        if symbol in pair:
            return f"d->{array}[{pair.index(symbol)}]"
    if symbol in model.state_symbols:
        return f"d->s[{state_macro(symbol)}]"
    return f"d->p[{macro(symbol.name)}]" if symbol.name in _moving_values(model) else ""


@lru_cache(maxsize=8)
def _moving_values(model: Model) -> frozenset[str]:
    """The variables that move with inputs and states: the inputs, what lags behind them, what laws make."""
    made = {target.name for law in model.laws for target in law.changes}
    follow = {target.name for effect in follows_of(model) for target in effect.follows}
    inputs = {q.name for q in model.quantities if q.role == "input"}
    return frozenset(inputs | made | follow | {target.name for target in symbols.SET_BY})


def _along(expr: Expr, model: Model) -> Expr:
    """The derivative of ``expr`` along the symbols ``d_NAME``. A step has no slope, but where it steps."""
    moving = sorted((s for s in expr.free_symbols if _moves(s, model)), key=lambda s: s.name)
    slope = sum((expr.diff(s) * Symbol(f"d_{s.name}", real=True) for s in moving), sympify(0))
    slope = slope.replace(DiracDelta, lambda *_: sympify(0))
    return slope.replace(Heaviside, lambda x, *_: Piecewise((1, x > 0), (0, True)))


def _declared(effect: Effect, exprs: Sequence[Expr], places: Places, remembered: str = "remembered_now") -> str:
    used = {s for expr in exprs for s in expr.free_symbols}
    moving = {s for s in effect.symbols if Symbol(f"d_{s.name}", real=True) in used}
    own = places.declare(effect, [s for s in used if s in effect.symbols], remembered)
    rates = sorted(moving, key=lambda s: s.name)
    return own + "".join(f"    const double d_{s.name} = {_moves(s, places.model, remembered)};\n" for s in rates)


def _recall(effect: Effect, places: Places) -> str:
    """How what the effect remembers moves, and the rate of what flows."""
    now = [sympify(m.symbol if m.now is None else m.now) for m in effect.memories]
    slopes = [_along(expr, places.model) for expr in now]
    lines = "".join(
        f"    d->remembered_now[{memory_macro(m.symbol)}] = {c_expression(expr)};\n"
        for m, expr in zip(effect.memories, slopes, strict=True)
    )
    declared = _declared(effect, slopes, places, "remembered")
    head = f"static inline void tangent_recall_effect_{effect.id}(const gyro_view *g, gyro_tangent *d)"
    text = f"{head}\n{{\n    (void)g;\n{declared}{lines}}}\n"
    flowing = [m for m in effect.memories if m.flows]
    if flowing:
        rates = [_along(m.rate, places.model) for m in flowing]
        lines = "".join(
            f"    rate[{memory_macro(m.symbol)}] = {c_expression(expr)};\n"
            for m, expr in zip(flowing, rates, strict=True)
        )
        declared = _declared(effect, rates, places, "remembered")
        arguments = "const gyro_view *g, const gyro_tangent *d, double *rate"
        head = f"static inline void tangent_flow_effect_{effect.id}({arguments})"
        text += f"\n{head}\n{{\n    (void)g;\n{declared}{lines}}}\n"
    return text


def _flow(model: Model) -> str:
    flowing = [e for e in model.effects if any(m.flows for m in e.memories)]
    lines = "".join(guarded(e, f"tangent_flow_effect_{e.id}(g, d, rate);\n") for e in flowing)
    return (
        "/* The tangent of flow_memories. */\n"
        "static inline void tangent_flow(const gyro_view *g, const gyro_tangent *d, double *rate)\n"
        "{\n    (void)g, (void)d;\n    for (int i = 0; i < GYRO_N_FLOWING; i++) {\n        rate[i] = 0.0;\n    }\n"
        f"{textwrap.indent(lines, '    ')}}}\n"
    )


def _with_memory(effect: Effect, call: str) -> str:
    """``call`` of the tangent of ``effect``, with what it remembers and its tangent recalled before."""
    return called(effect, f"tangent_recall_effect_{effect.id}(g, d);\n{call}") if effect.memories else call


def _head(effect: Effect, arguments: str) -> str:
    return f"static inline void tangent_effect_{effect.id}(const gyro_view *g, const gyro_tangent *d, {arguments})\n"


def _function(effect: Effect, terms: Sequence[Expr], places: Places) -> str:
    slopes = [_along(expr, places.model) for expr in terms]
    lines = "".join(f"    out[{i}] = {c_expression(expr)};\n" for i, expr in enumerate(slopes))
    return f"{_head(effect, 'double *out')}{{\n    (void)g, (void)d;\n{_declared(effect, slopes, places)}{lines}}}\n"


def _force(effect: Force, places: Places) -> str:
    terms = {n: _along(e, places.model) for n, e in effect.terms().items() if not n.startswith("impulse")}
    pair = (terms["force_x"], terms["force_y"])
    lines = "".join(f"    force[{i}] += {c_expression(expr)};\n" for i, expr in enumerate(pair) if expr != 0)
    lines += "".join(
        f"    rate[{state_macro(s.symbol)}] = {c_expression(terms[f'd_{s.symbol.name}'])};\n" for s in effect.states
    )
    declared = _declared(effect, list(terms.values()), places)
    unused = "    (void)g, (void)d, (void)force, (void)rate;\n"
    return f"{_head(effect, 'double force[2], double *rate')}{{\n{unused}{declared}{lines}}}\n"


def _laws(model: Model) -> str:
    made = "".join(
        f"    {as_set(s)}    d->p[{macro(s.name)}] = d->p[{macro(source.name)}];\n"
        for s, source in symbols.SET_BY.items()
    )
    targets = {target for law in model.laws for target in law.changes} - set(symbols.SET_BY)
    made += "".join(f"    {as_set(target)}" for target in sorted(targets, key=str))
    steps = ""
    for effect in follows_of(model):
        lags = "".join(
            f"if (g->p[{macro(constant.name)}] > 0.0) {{\n"
            f"    d->p[{macro(target.name)}] = d->lagging[{lagging_macro(target)}];\n}}\n"
            for target, constant in effect.follows.items()
        )
        steps += guarded(effect, f"{lags}effect_{effect.id}(g);\n")
    for law in model.laws:
        taken = "".join(f"d->p[{macro(target.name)}] = out[{i}];\n" for i, target in enumerate(law.changes))
        steps += guarded(law, _with_memory(law, f"tangent_effect_{law.id}(g, d, out);\neffect_{law.id}(g);\n{taken}"))
    most = max((len(law.changes) for law in model.laws), default=1)
    return (
        "/* Laws, as apply_laws applies them, and their tangents from those of the values as set. */\n"
        "static inline void tangent_laws(gyro_view *g, const double value[GYRO_N_VARIABLES], gyro_tangent *d)\n"
        f"{{\n    double out[{most}];\n    (void)out;\n{made}{textwrap.indent(steps, '    ')}}}\n"
    )


def _slot(slot: str, members: Sequence[Map]) -> str:
    enters, leaves = (pair[0].name.removesuffix("_x") for pair in SLOTS[slot])
    if len(members) == 1:
        [effect] = members
        lines = _with_memory(effect, f"tangent_effect_{effect.id}(g, d, moved);\neffect_{effect.id}(g, out);\n")
        lines += "".join(f"g->{leaves}[{i}] = out[{i}];\nd->{leaves}[{i}] = moved[{i}];\n" for i in (0, 1))
        return textwrap.indent(lines if effect.nominal else guarded(effect, lines), "    ")
    lines = f"const double entering[2] = {{g->{enters}[0], g->{enters}[1]}};\n"
    lines += f"const double moving[2] = {{d->{enters}[0], d->{enters}[1]}};\n"
    lines += "double sum[2] = {entering[0], entering[1]}, slope[2] = {moving[0], moving[1]};\n"
    for effect in members:
        add = _with_memory(effect, f"tangent_effect_{effect.id}(g, d, moved);\neffect_{effect.id}(g, out);\n")
        add += "".join(
            f"sum[{i}] += out[{i}] - entering[{i}];\nslope[{i}] += moved[{i}] - moving[{i}];\n" for i in (0, 1)
        )
        lines += guarded(effect, add)
    lines += "".join(f"g->{leaves}[{i}] = sum[{i}];\nd->{leaves}[{i}] = slope[{i}];\n" for i in (0, 1))
    return "    {\n" + textwrap.indent(lines, "        ") + "    }\n"


def _chain(model: Model, name: str, first: str, last: str, start: str) -> str:
    order = list(SLOTS)
    span = order[order.index(first) : order.index(last) + 1]
    body = "".join(_slot(slot, members) for slot, members in chain(model) if slot in span)
    return (
        f"/* As {name}, with the tangents. */\n"
        f"static inline void tangent_{name}(gyro_view *g, gyro_tangent *d)\n"
        f"{{\n    double out[2], moved[2];\n    (void)g, (void)d, (void)out, (void)moved;\n{start}{body}}}\n"
    )


def _rate(model: Model, forces: Iterable[Force]) -> str:
    added = added_forces(model)
    nominal = "".join(f"    tangent_effect_{e.id}(g, d, force, rate);\n" for e in forces if e not in added)
    others = textwrap.indent("".join(guarded(e, f"tangent_effect_{e.id}(g, d, force, rate);\n") for e in added), "    ")
    quiet = "".join(f"    rate[{state_macro(s.symbol)}] = 0.0;\n" for s in model.states)
    return f"""/* The tangent of state_rate. */
static inline void tangent_rate(const gyro_view *g, const gyro_tangent *d, double rate[GYRO_N_STATES])
{{
    double force[2] = {{d->u[0], d->u[1]}};
{quiet}{nominal}{others}    rate[GYRO_STATE_X] = d->s[GYRO_STATE_X_DOT];
    rate[GYRO_STATE_Y] = d->s[GYRO_STATE_Y_DOT];
    rate[GYRO_STATE_X_DOT] = force[0] * g->inverse_mass;
    rate[GYRO_STATE_Y_DOT] = force[1] * g->inverse_mass;
}}
"""


def _lags(model: Model) -> str:
    rows = [
        (macro(constant.name), effect_macro(effect), macro(symbols.SET_BY.get(target, target).name))
        for effect in follows_of(model)
        for target, constant in effect.follows.items()
    ]
    names = ("follow_constants", "follow_effects", "follow_sources")
    arrays = "".join(
        f"static const int {name}[GYRO_N_LAGGING] = {{{', '.join(column)}}};\n"
        for name, column in zip(names, zip(*rows, strict=True), strict=True)
    )
    lag = next((e.time_constant.name for e in model.effects if isinstance(e, Lag)), None)
    return (
        "/* Of what lags: the variable of its time constant, its effect, the variable that it follows. */\n"
        f"{arrays}\n"
        "/* The tangent of lag_time_constant. */\n"
        "static inline double lag_tangent(const gyro_tangent *d)\n"
        f"{{\n    (void)d;\n    return {f'd->p[{macro(lag)}]' if lag else '0.0'};\n}}\n"
    )


def _jumping(model: Model) -> str:
    """Which inputs may only jump: the force on its way through a delay, and those whose change is an impulse."""
    tests = ""
    for effect in model.effects:
        names = [n.name for n in (symbols.u_x, symbols.u_y)] if isinstance(effect, Delay) else []
        if isinstance(effect, Force) and effect.impulse:
            used = set().union(*(sympify(expr).free_symbols for expr in effect.impulse))
            names = [source.name for change, source in symbols.CHANGES.items() if change in used]
        if names:
            inputs = " || ".join(f"vr == {macro(name)}" for name in names)
            tests += (
                f'    if (g->active[{effect_macro(effect)}] && ({inputs})) {{\n        id = "{effect.id}";\n    }}\n'
            )
    return (
        "/* The id of an effect that acts, for which the input `vr` may jump but not glide; NULL where it may. */\n"
        "static inline const char *jumping_effect(const gyro_view *g, int vr)\n"
        f"{{\n    const char *id = 0;\n    (void)g, (void)vr;\n{tests}    return id;\n}}\n"
    )
