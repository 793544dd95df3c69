"""Writes ``expansions.h``: of each force that bends the motion the coefficients of its Taylor series in time, from
those of the states, one function an effect (``effect_series.py``)."""

import textwrap
from collections import Counter
from collections.abc import Sequence
from typing import Final

from sympy import Expr, Symbol, simplify, sympify

from gyro_model import symbols
from gyro_model.c_printing import STAMP, c_expression, effect_macro, macro, state_macro
from gyro_model.effect_functions import Places, added_forces
from gyro_model.effect_series import Series, both_axes, has_series, pair_macro, square_macro
from gyro_model.linear_forces import is_linear
from gyro_model.model import Model

Pair = tuple[Symbol, Symbol]
_MOTION: Final[tuple[Pair, ...]] = ((symbols.x, symbols.y), (symbols.x_dot, symbols.y_dot))
MOST_ROWS: Final = 256
"""Room for rows of coefficients; a model whose acting forces ask for more is integrated by stages."""


def expansions(model: Model) -> str:
    """``expansions.h``: a function an effect, the room that each needs, and what calls those that act."""
    bending = [e for e in added_forces(model) if not is_linear(e, model)]
    targets = {target for law in model.laws for target in law.changes} | set(model.followed)
    read = sorted(targets & {symbol for e in bending for symbol in e.symbols}, key=str)
    place = Places(model)
    alone = {e.id: Series(e, place, read) for e in bending if has_series(e, model)}
    squares = Counter(square for one in alone.values() for square in one.squares)
    shared = sorted((square for square, n in squares.items() if n > 1), key=str)
    series = {e.id: Series(e, place, read, shared) for e in bending if e.id in alone}
    functions = "\n".join(one.function() for one in series.values())
    sizes = "".join(
        f"    {series[e.id].size() if e.id in series else _size(e in bending)}, /* {e.id} */\n" for e in model.effects
    )
    cases = "".join(
        f"        case {effect_macro(e)}:\n            series_effect_{e.id}(g, s, &s->plan->place[i], k, h, &force);\n"
        "            break;\n"
        for e in bending
        if e.id in series
    )
    held = set().union(*(one.held for one in series.values()))
    follows = ", ".join("0" if symbol in held else "1" for symbol in read) or "1"
    copies = "".join(f"    read[{i}] = g->p[{macro(symbol.name)}];\n" for i, symbol in enumerate(read))
    bouc_wens = _bouc_wens(list(series.values()))
    slopes = "".join(
        f"    slope[{i}] = {slope};\n" for i, slope in enumerate(_slopes(list(series.values()), set(read)))
    )
    most = [max(1, sum(one.counts()[i] for one in series.values())) for i in range(4)]
    squared = "".join(f"    {square_macro(square)},\n" for square in shared)
    shares = "".join(
        f"    if (s->plan->shared & 1u << {square_macro(square)}) {{\n"
        f"        const gyro_pair *of = s->of[{pair_macro(both_axes(square.base))}];\n"
        f"        s->shared[{square_macro(square)}][k] = series_square(of, k);\n"
        "    }\n"
        for square in shared
    )
    own = [*_MOTION, *(pair for one in series.values() for pair in one.own)]
    own += [(state.symbol, state.symbol) for state in model.states if not any(state.symbol in pair for pair in own)]
    others = sorted({pair for one in alone.values() for pair in one.pairs} - set(own), key=str)
    lanes = {
        symbol: f"lane_of(s->of[{pair_macro(pair)}][k], {lane})" for pair in own for lane, symbol in enumerate(pair)
    }
    made = "".join(f"    s->of[{pair_macro((a, b))}][k] = pair_of({lanes[a]}, {lanes[b]});\n" for a, b in others)
    return f"""{STAMP}
#ifndef GYRO_EXPANSIONS_H
#define GYRO_EXPANSIONS_H

#include "../series.h"
#include "effects.h"

/* Room for what all forces of the model ask for together. */
enum {{
    GYRO_SERIES_ROWS = {min(most[0], MOST_ROWS)},
    GYRO_SERIES_CONSTANTS = {most[1]},
    GYRO_SERIES_CORNERS = {most[2]},
    GYRO_SERIES_BOUNDS = {most[3]},
    GYRO_SERIES_READ = {max(1, len(read))}
}};

/* States by pairs: the motion, states of effects, then pairs made of those. In an effect that is the same for both axes
   `x` stands for (x, y) and `y` for (y, x), elsewhere each for two of itself. */
enum {{
{_names(_MOTION)}    GYRO_MOTION_PAIRS,
{_names(own[2:], "GYRO_MOTION_PAIRS")}    GYRO_STATE_PAIRS = {len(own)},
{_names(others, "GYRO_STATE_PAIRS")}    GYRO_SERIES_PAIRS = {len(own) + len(others)}
}};

/* What effects share. */
enum {{
{squared}    GYRO_SERIES_SHARED
}};

/* States that follow a displacement. */
enum {{ GYRO_BOUC_WENS = {len(bouc_wens)} }};
static const gyro_bouc_wen bouc_wens[GYRO_BOUC_WENS + 1] = {{
{"".join(f"    {{{one}}},{chr(10)}" for one in bouc_wens)}    {{0}}
}};

/* What each of these brings of the force of its axis [N]; no number where anything else moves that, or how it
   follows. */
static inline void bouc_wen_slopes(const gyro_view *g, double slope[GYRO_BOUC_WENS + 1])
{{
    (void)g;
    slope[0] = 0.0;
{slopes}}}

/* One of a pair of series. */
typedef struct {{
    const gyro_pair *row;
    int lane;
}} gyro_lane;

/* Taylor series of the motion from one instant on, in units of the step. */
typedef struct {{
    const gyro_series_plan *plan;
    double step;                                 /* s */
    gyro_pair of[GYRO_SERIES_PAIRS][GYRO_TERMS]; /* states by pairs [SI] */
    gyro_pair shared[GYRO_SERIES_SHARED + 1][GYRO_TERMS];
    gyro_pair w[GYRO_SERIES_ROWS][GYRO_TERMS];   /* rows of the effects */
    gyro_pair c[GYRO_SERIES_CONSTANTS];          /* constants of the effects */
    gyro_lane corner[GYRO_SERIES_CORNERS];       /* what changes its sign where a force has a corner */
    gyro_lane bounded[GYRO_SERIES_BOUNDS];       /* what may change only by `room`; no row: nothing does */
    double room[GYRO_SERIES_BOUNDS];
    double way[GYRO_SERIES_BOUNDS];              /* positive: it may rise by no more, negative: fall, 0: neither */
    double change[GYRO_SERIES_READ];             /* by what laws change what is read in the whole step [SI] */
    double begin;                                /* of the whole step has been done */
    gyro_given given[GYRO_BOUC_WENS + 1];        /* states beside their zeros */
    int n_given;
    double side[GYRO_SERIES_CORNERS];            /* its sign in this part of the step, 1 or -1; 0: not known yet */
}} gyro_series;

/* The k-th coefficients of the pairs made of others. */
static inline void pair_states(gyro_series *s, int k)
{{
    (void)s;
    (void)k;
{made}}}

/* The first coefficients of so many pairs of states: of the motion alone, or of all. */
static inline void take_states(const gyro_view *g, gyro_series *s, int pairs)
{{
{_taken(own[:2])}    if (pairs > GYRO_MOTION_PAIRS) {{
{textwrap.indent(_taken(own[2:]), "    ")}    }}
}}

/* So many pairs of states as those of a view. */
static inline void give_states(const gyro_pair value[GYRO_STATE_PAIRS], gyro_view *g, int pairs)
{{
{_given(own[:2])}    if (pairs > GYRO_MOTION_PAIRS) {{
{textwrap.indent(_given(own[2:]), "    ")}    }}
}}

/* c a where c changes by `change` in the whole step and is as given in its middle. */
static inline gyro_pair following(const gyro_series *s, gyro_pair c, gyro_pair change, const gyro_pair *a, int k)
{{
    const gyro_pair now = pair_product(pair_sum(c, pair_scaled(s->begin - 0.5, change)), a[k]);
    return k == 0 ? now : pair_sum(now, pair_product(pair_scaled(1.0 - s->begin, change), a[k - 1]));
}}

/* Lets a lane of a row change one way by `room`, if that is finite. */
static inline void bound_change(gyro_series *s, int bound, const gyro_pair *row, int lane, double room, double way)
{{
    s->bounded[bound].row = gyro_finite(room) ? row : NULL;
    s->bounded[bound].lane = lane;
    s->room[bound] = room;
    s->way[bound] = way;
}}

/* The sides on which the motion is of so many corners, the lanes of `row` changing their signs there. */
static inline const double *sides_of(gyro_series *s, int corner, const gyro_pair *row, int lanes, int k)
{{
    for (int lane = 0; k == 0 && lane < lanes; lane++) {{
        double *side = &s->side[corner + lane];
        s->corner[corner + lane].row = row;
        s->corner[corner + lane].lane = lane;
        *side = *side != 0.0 ? *side : lane_of(row[0], lane) < 0.0 ? -1.0 : 1.0;
    }}
    return &s->side[corner];
}}

/* What each effect asks for; -1 rows: its force bends the motion and has no series. */
static const gyro_series_size series_sizes[GYRO_N_EFFECTS] = {{
{sizes}}};

{functions}
/* `force` [N] with the k-th coefficients of the forces that bend the motion; the next ones of their own states, `h` [s]
   times the rate, are put in their place. */
static GYRO_INLINE gyro_pair with_series(const gyro_view *g, gyro_series *s, int k, double h, gyro_pair force)
{{
    (void)g;
    (void)k;
    (void)h;
{shares}    for (int i = 0; i < s->plan->n; i++) {{
        switch (s->plan->effect[i]) {{
{cases}        default:
            break;
        }}
    }}
    return force;
}}

/* The same of the first and of later coefficients: a compiler leaves out of each what is for the others. */
static inline gyro_pair with_first(const gyro_view *g, gyro_series *s, double h, gyro_pair force)
{{
    return with_series(g, s, 0, h, force);
}}

static inline gyro_pair with_later(const gyro_view *g, gyro_series *s, int k, double h, gyro_pair force)
{{
    return k > 0 ? with_series(g, s, k, h, force) : force;
}}

/* Whether a series follows what laws change within the step; else it is held at the middle. */
static const int series_follows[GYRO_SERIES_READ] = {{{follows}}};

/* What these forces read that laws change [SI]. */
static inline void read_by_series(const gyro_view *g, double read[GYRO_SERIES_READ])
{{
    (void)g;
    read[0] = 0.0;
{copies}}}

#endif
"""


def _bouc_wens(series: Sequence[Series]) -> list[str]:
    """Where each series of a state stands that follows a displacement, as members of ``gyro_bouc_wen``."""
    rows = []
    for one in series:
        states = {state.symbol: state for state in one.effect.states}
        lanes = ((pair, lane, states[symbol]) for pair in one.own for lane, symbol in enumerate(pair))
        for pair, lane, state in lanes:
            if state.follows:
                of, *parameters = state.follows
                axis = _MOTION[0].index(of)
                x, speed = (motion[axis] for motion in _MOTION)
                places = map(state_macro, (state.symbol, x, speed))
                values = (macro(symbol.name) for symbol in parameters)
                rows.append(
                    ", ".join([effect_macro(one.effect), pair_macro(pair), f"{lane}, {axis}", *places, *values])
                )
    return rows


def _slopes(series: Sequence[Series], changing: set[Symbol]) -> list[str]:
    """The derivative of the force of its axis by each of these states, in C: NAN unless the force of the effect is made
    of such states alone, each on the axis that it follows, and nothing in it is in ``changing``."""
    slopes = []
    for one in series:
        states = {state.symbol: state for state in one.effect.states}
        own = [states[symbol] for pair in one.own for symbol in dict.fromkeys(pair)]
        followed = [(state.symbol, state.follows) for state in own if state.follows]
        if not followed:
            continue
        forces = [sympify(expr) for expr in one.effect.force]
        by = [forces[_MOTION[0].index(follows.of)].diff(z) for z, follows in followed]
        rest = list(forces)
        for (z, follows), slope in zip(followed, by, strict=True):
            rest[_MOTION[0].index(follows.of)] -= slope * z
        factors = set().union(*(slope.free_symbols for slope in by))
        read = factors.union(*(follows[1:] for _, follows in followed))
        alone = not factors & one.moving and not read & changing and [simplify(expr) for expr in rest] == [0, 0]
        slopes += [_read(slope) if alone and len(followed) == len(states) else "NAN" for slope in by]
    return slopes


def _read(expr: Expr) -> str:
    """An expression of parameters, read from the view."""
    return c_expression(expr.xreplace({s: Symbol(f"g->p[{macro(s.name)}]", real=True) for s in expr.free_symbols}))


def _names(pairs: Sequence[Pair], first: str = "") -> str:
    """Indexes of pairs, from ``first`` on."""
    starts = [f" = {first}" if first else "", *[""] * len(pairs)]
    return "".join(f"    {pair_macro(pair)}{start},\n" for pair, start in zip(pairs, starts, strict=False))


def _taken(pairs: Sequence[Pair]) -> str:
    return "".join(
        f"    s->of[{pair_macro((a, b))}][0] = pair_of(g->s[{state_macro(a)}], g->s[{state_macro(b)}]);\n"
        for a, b in pairs
    )


def _given(pairs: Sequence[Pair]) -> str:
    return "".join(
        f"    g->s[{state_macro(symbol)}] = lane_of(value[{pair_macro(pair)}], {lane});\n"
        for pair in pairs
        for lane, symbol in enumerate(dict.fromkeys(pair))
    )


def _size(bends: bool) -> str:
    return "{-1, 0, 0, 0, 0}" if bends else "{0, 0, 0, 0, 0}"
