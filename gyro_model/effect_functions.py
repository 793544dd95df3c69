"""The C functions of one effect: what it adds, changes, maps or remembers, as its formulae stand in the effect file."""

import textwrap
from collections.abc import Iterable, Mapping, Sequence

from sympy import Expr, Symbol, sympify

from gyro_model import symbols
from gyro_model.anatomy import SLOTS, Effect, Follow, Force, Law, Map, Memory
from gyro_model.c_printing import c_expression, effect_macro, lagging_macro, macro, memory_macro, state_macro
from gyro_model.model import Model


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


def _function(effect: Effect, arguments: str, body: str) -> str:
    head = f"static inline void effect_{effect.id}({arguments})\n"
    return f"{_comment(effect.doc)}{head}{{\n{body}}}\n"


def force_function(effect: Force, place: Places) -> str:
    """The force of an effect, the rates of its states, and the impulse that it gives where inputs jump."""
    terms = effect.terms()
    body = place.declare(effect, (expr for name, expr in terms.items() if not name.startswith("impulse")))
    body += _added("force", terms)
    for state in effect.states:
        body += f"    rate[{state_macro(state.symbol)}] = {c_expression(state.rate)};\n"
    rate = ", double *rate" if effect.states else ""
    function = _function(effect, f"const gyro_view *g, double force[2]{rate}", body)
    if effect.impulse:
        declared = place.declare(effect, (terms["impulse_x"], terms["impulse_y"]))
        head = f"static inline void impulse_effect_{effect.id}(const gyro_view *g, double impulse[2])"
        function += f"\n{head}\n{{\n{declared}{_added('impulse', terms)}}}\n"
    return function


def _added(what: str, terms: Mapping[str, Expr]) -> str:
    pair = (terms[f"{what}_x"], terms[f"{what}_y"])
    return "".join(f"    {what}[{axis}] += {c_expression(expr)};\n" for axis, expr in enumerate(pair) if expr != 0)


def memory_functions(effect: Effect, place: Places) -> str:
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
        head = f"static inline void flow_effect_{effect.id}(const gyro_view *g, double rate[GYRO_N_FLOWING])"
        parts += [f"{head}\n{{\n{place.declare(effect, [m.rate for m in flowing], 'remembered')}{lines}}}\n"]
    return "\n".join(parts)


def _remember(what: str, effect: Effect, place: Places, to: str, made: Sequence[tuple[Memory, Expr]]) -> str:
    exprs = [sympify(expr) for _, expr in made]
    lines = "".join(
        f"    g->{to}[{memory_macro(m.symbol)}] = {_recalled(m, expr) if what == 'recall' else c_expression(expr)};\n"
        for (m, _), expr in zip(made, exprs, strict=True)
    )
    head = f"static inline void {what}_effect_{effect.id}(gyro_view *g)"
    return f"{head}\n{{\n{place.declare(effect, exprs, 'remembered')}{lines}}}\n"


def _recalled(memory: Memory, now: Expr) -> str:
    """What flows has not moved where no time has gone by: to the last bit, whatever rounding its formula has."""
    return f"since > 0.0 ? {c_expression(now)} : {memory.symbol.name}" if memory.flows else c_expression(now)


def follow_function(effect: Follow) -> str:
    """What follows another quantity with a lag."""
    lines = "".join(
        f"    follow(g, {macro(target.name)}, {lagging_macro(target)}, g->p[{macro(constant.name)}]);\n"
        for target, constant in effect.follows.items()
    )
    return _function(effect, "gyro_view *g", lines)


def law_function(effect: Law, place: Places) -> str:
    """The parameters that a law makes."""
    lines = "".join(f"    g->p[{macro(name)}] = {c_expression(expr)};\n" for name, expr in effect.made().items())
    return _function(effect, "gyro_view *g", place.declare(effect, effect.made().values()) + lines)


def map_functions(effect: Map, place: Places) -> str:
    """What a map makes of a pair of signals, and its rate where a stage asks for that."""
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
    head = f"static inline void rate_effect_{effect.id}(const gyro_view *g, double out[2])"
    return f"{head}\n{{\n{place.declare(effect, rates)}{unused}{lines}}}\n"


def called(effect: Effect, call: str) -> str:
    """``call`` of a function of ``effect``, with what it remembers recalled before."""
    return f"recall_effect_{effect.id}(g);\n{call}" if effect.memories else call


def guarded(effect: Effect, lines: str) -> str:
    """``lines`` where ``effect`` is active."""
    return f"if (g->active[{effect_macro(effect)}]) {{\n{textwrap.indent(lines, '    ')}}}\n"


def force_call(effect: Force, place: str = "") -> str:
    """The call that adds the force of ``effect``, at a ``place`` of an array."""
    rate = f", rate{place}" if effect.states else ""
    return f"effect_{effect.id}(g, force{place}{rate});\n"


def follows_of(model: Model) -> list[Follow]:
    """The effects that make a quantity lag."""
    return [e for e in model.effects if isinstance(e, Follow)]


def added_forces(model: Model) -> list[Force]:
    """The forces that are neither of the nominal device nor drawn and held."""
    return [e for e in model.forces if not e.nominal and not e.drawn]
