"""Which forces are linear in the motion, and the C of their slopes and rests."""

import textwrap
from collections.abc import Iterable, Sequence
from functools import lru_cache
from itertools import combinations_with_replacement

from sympy import Expr, Symbol, diff, sympify

from gyro_model import symbols
from gyro_model.anatomy import Effect, Force
from gyro_model.c_printing import c_expression, effect_macro, state_macro
from gyro_model.effect_functions import Places, follows_of
from gyro_model.model import Model


def is_curved(exprs: Iterable[Expr], signals: Sequence[Symbol]) -> bool:
    """Whether some expression is not affine in ``signals``."""
    # A derivative that is zero in disguise only has its effect followed the longer way, which is as right.
    return any(
        diff(expr, *pair) != 0
        for expr in map(sympify, exprs)
        for pair in combinations_with_replacement([s for s in signals if s in expr.free_symbols], 2)
    )


def is_linear(effect: Force, model: Model) -> bool:
    """Whether the force is affine in the motion, stays while nothing else does, and has no states of its own."""
    return effect.id in _linear(model)


@lru_cache(maxsize=8)
def _linear(model: Model) -> frozenset[str]:
    # Kept: second derivatives of some hundred forces take a second.
    forces = (e for e in model.forces if not (symbols.t in e.symbols or e.states))
    return frozenset(e.id for e in forces if not is_curved(e.force, model.state_symbols))


def _stay(slopes: Iterable[Expr], model: Model) -> bool:
    """Whether slopes stay while parameters do, but for the rate, in which they are quadratic."""
    moving = {q.symbol for q in model.quantities if q.role == "input"} | set(model.followed) | set(symbols.SET_BY)
    moving |= {symbols.u_x, symbols.u_y}
    own = list(slopes)
    read = set().union(*(expr.free_symbols for expr in own))
    return not read & (moving - {symbols.omega_z}) and all(diff(expr, symbols.omega_z, 3) == 0 for expr in own)


def _is_steady(effect: Force, model: Model) -> bool:
    return _stay([expr for row in _slopes(effect) for expr in row], model)


def bends(effect: Force, model: Model) -> bool:
    """Whether what a force adds to the rates of all states has slopes that go with these, with the command or with
    time."""
    return effect.id in _bending(model)


@lru_cache(maxsize=8)
def _bending(model: Model) -> frozenset[str]:
    signals = [*model.state_symbols, symbols.u_x, symbols.u_y]
    return frozenset(e.id for e in model.forces if symbols.t in e.symbols or is_curved(_rates(e), signals))


def _rates(effect: Force) -> list[Expr]:
    """The force and the rates of its own states."""
    return [sympify(expr) for expr in (*effect.force, *(state.rate for state in effect.states))]


def uneven(model: Model) -> list[Effect]:
    """The forces that bend or of which the slopes may change otherwise than with the rate, and all laws."""
    even = (e for e in model.forces if not bends(e, model))
    slopes = {e.id: [expr.diff(s) for expr in _rates(e) for s in model.state_symbols] for e in even}
    straight = {name for name, own in slopes.items() if _stay(own, model)}
    return [*(e for e in model.forces if e.id not in straight), *model.laws, *follows_of(model)]


def unsteady(model: Model) -> list[Effect]:
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
    head = f"static inline void slope_effect_{effect.id}(const gyro_view *g, double slope[2][4])"
    return f"{head}\n{{\n{place.declare(effect, (*slopes[0], *slopes[1]))}{lines}}}\n" if lines else ""


def _still(effect: Force, place: Places) -> str:
    """What is left of a linear force at rest."""
    rest = _at_rest(effect)
    lines = "".join(f"    still[{axis}] += {c_expression(expr)};\n" for axis, expr in enumerate(rest) if expr != 0)
    head = f"static inline void still_effect_{effect.id}(const gyro_view *g, double still[2])"
    return f"{head}\n{{\n{place.declare(effect, rest)}{lines}}}\n" if lines else ""


def linear_parts(model: Model, place: Places) -> str:
    """Slopes and rests of the linear forces, and the functions that add them up."""
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
    """The calls of ``what``_effect_ID(g, ``what``): of the nominal forces, then of those that act."""
    nominal = "".join(f"    {what}_effect_{e.id}(g, {what});\n" for e in forces if e.nominal)
    others = "".join(
        f"case {effect_macro(e)}:\n    {what}_effect_{e.id}(g, {what});\n    break;\n" for e in forces if not e.nominal
    )
    loop = f"""    for (int i = 0; i < g->n_acting; i++) {{
        switch (g->acting[i]) {{
{textwrap.indent(others, "        ")}        default:
            break;
        }}
    }}
"""
    return nominal + (loop if others else "")
