"""Writes ``expansions.h``: of each force that bends the motion the coefficients of its Taylor series in time, from
those of the states, one function an effect.

A product of series is the Cauchy product of their coefficients, and powers, exponentials and the like follow from their
differential equations (A. Griewank, A. Walther, Evaluating Derivatives, 2nd edition 2008, section 13.2, tables 13.1 and
13.2). |a| is s a with the sign s of a, which a step keeps: where it changes, the step ends (``taylor.h``). A
force with any other function has no series and is integrated by stages (``integrator.h``).
"""

from collections.abc import Callable, Sequence
from itertools import groupby, product
from typing import Final

from sympy import Abs, Expr, Heaviside, Max, Min, Symbol, preorder_traversal, sign, sympify
from sympy.core.function import Application

from gyro_model import symbols
from gyro_model.anatomy import Force
from gyro_model.c_printing import STAMP, c_expression, effect_macro, macro, state_macro
from gyro_model.effect_functions import Places, added_forces
from gyro_model.linear_forces import is_linear
from gyro_model.model import Model

_SMOOTH: Final = ("exp", "log", "sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh")
_SATURATING: Final = {"tanh": "fabs({}) - 19.0", "exp": "-{} - 40.0"}
"""By how much an argument may change and leave the function at its end within rounding of 1. There it says nothing of
what comes beyond."""
_CORNERED: Final = (Abs, Max, Min, Heaviside, sign)
MOST_ROWS: Final = 256
"""Room for rows of coefficients; a model whose acting forces ask for more is integrated by stages."""


def expansions(model: Model) -> str:
    """``expansions.h``: a function an effect, the room that each needs, and what calls those that act."""
    bending = [e for e in added_forces(model) if not is_linear(e, model)]
    targets = {target for law in model.laws for target in law.changes} | set(model.followed)
    read = sorted(targets & {symbol for e in bending for symbol in e.symbols}, key=str)
    place = Places(model)
    series = {e.id: _Series(e, place, read) for e in bending if has_series(e, model)}
    functions = "\n".join(one.function() for one in series.values())
    sizes = "".join(
        f"    {series[e.id].size() if e.id in series else _size(e in bending)}, /* {e.id} */\n" for e in model.effects
    )
    cases = "".join(
        f"        case {effect_macro(e)}:\n            series_{e.id}(g, s, &s->plan->place[i], k, force, rate);\n"
        "            break;\n"
        for e in bending
        if e.id in series
    )
    held = set().union(*(one.held for one in series.values()))
    follows = ", ".join("0" if symbol in held else "1" for symbol in read) or "1"
    copies = "".join(f"    read[{i}] = g->p[{macro(symbol.name)}];\n" for i, symbol in enumerate(read))
    most = [max(1, sum(one.counts()[i] for one in series.values())) for i in range(4)]
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

/* Taylor series of the motion from one instant on, in units of the step. */
typedef struct {{
    const gyro_series_plan *plan;
    double step;                              /* s */
    double s[GYRO_N_STATES][GYRO_TERMS];      /* states [SI] */
    double w[GYRO_SERIES_ROWS][GYRO_TERMS];   /* rows of the effects */
    double c[GYRO_SERIES_CONSTANTS];          /* constants of the effects */
    const double *corner[GYRO_SERIES_CORNERS]; /* the row that changes its sign where a force has a corner */
    const double *bounded[GYRO_SERIES_BOUNDS]; /* the row that may change only by `room`; NULL: none does */
    double room[GYRO_SERIES_BOUNDS];
    double change[GYRO_SERIES_READ];          /* by what laws change what is read in the whole step [SI] */
    double begin;                             /* of the whole step has been done */
    double side[GYRO_SERIES_CORNERS];         /* its sign in this part of the step, 1 or -1; 0: not known yet */
}} gyro_series;

/* c a where c changes by `change` in the whole step and is as given in its middle. */
static inline double following(const gyro_series *s, double c, double change, const double *a, int k)
{{
    const double now = (c + (s->begin - 0.5) * change) * a[k];
    return k == 0 ? now : now + (1.0 - s->begin) * change * a[k - 1];
}}

/* Lets a row change by `room`, or by as much as a function of it shows in the powers that there are. */
static inline void bound_change(gyro_series *s, int bound, const double *row, double room, int k)
{{
    if (k == 0) {{
        s->bounded[bound] = row;
        s->room[bound] = larger(0.5 * GYRO_MOST_POWER, room);
    }}
}}

/* The side on which the motion is of a corner, `row` changing its sign there. */
static inline double side_of(gyro_series *s, int corner, const double *row, int k)
{{
    if (k == 0) {{
        s->corner[corner] = row;
        s->side[corner] = s->side[corner] != 0.0 ? s->side[corner] : row[0] < 0.0 ? -1.0 : 1.0;
    }}
    return s->side[corner];
}}

/* What each effect asks for; -1 rows: its force bends the motion and has no series. */
static const gyro_series_size series_sizes[GYRO_N_EFFECTS] = {{
{sizes}}};

{functions}
/* The k-th coefficients of the forces that bend the motion, added to `force` [N], and of the rates of their own states,
   put in `rate` [SI/s]. */
static inline void add_series(const gyro_view *g, gyro_series *s, int k, double force[2], double rate[GYRO_N_STATES])
{{
    (void)g;
    (void)k;
    (void)force;
    (void)rate;
    for (int i = 0; i < s->plan->n; i++) {{
        switch (s->plan->effect[i]) {{
{cases}        default:
            break;
        }}
    }}
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


def _size(bends: bool) -> str:
    return "{-1, 0, 0, 0}" if bends else "{0, 0, 0, 0}"


def has_series(effect: Force, model: Model) -> bool:
    """Whether every function in the force has a recurrence."""
    moving = {*model.state_symbols, symbols.t}
    exprs = [sympify(e) for e in (*effect.force, *(state.rate for state in effect.states))]
    parts = {part for expr in exprs for part in preorder_traversal(expr) if part.free_symbols & moving}
    calls = {type(part) for part in parts if isinstance(part, Application)}
    powers = (part for part in parts if part.is_Pow)
    return all(call in _CORNERED or call.__name__ in _SMOOTH for call in calls) and not any(
        power.exp.free_symbols & moving for power in powers
    )


class _Series:
    """The lines of one effect's function. A row holds the coefficients of one expression that changes with the motion;
    what does not change is a constant, found with coefficient 0."""

    def __init__(self, effect: Force, place: Places, changing: Sequence[Symbol]) -> None:
        self.effect, self.place, self.changing = effect, place, changing
        self.held: set[Symbol] = set()
        self.moving = {*place.model.state_symbols, symbols.t}
        self.lines: list[str] = []
        self.rows: dict[Expr, str] = {}
        self.constants: dict[Expr, str] = {}
        self.corners: dict[Expr, Symbol] = {}
        self.read: set[Symbol] = set()
        self.n_rows = self.n_constants = self.n_bounds = self.terms = 0
        self.sizes = {q.symbol for q in effect.parameters if q.start == 0.0}
        for axis, expr in enumerate(effect.force):
            if expr != 0:
                self._force(axis, self._smooth(sympify(expr)))
        self.lines += [f"    rate[{state_macro(state.symbol)}] = {self._sum(state.rate)};" for state in effect.states]

    def _force(self, axis: int, expr: Expr) -> None:
        """The force of one axis: nothing where no corner lets it act."""
        sides = sorted(expr.free_symbols & set(self.corners.values()), key=str)
        idle = [
            chosen
            for chosen in product((1, -1), repeat=len(sides))
            if sides and expr.subs(dict(zip(sides, chosen, strict=True))) == 0
        ]
        tests = (
            " && ".join(f"{s} {'>' if c > 0 else '<'} 0.0" for s, c in zip(sides, chosen, strict=True))
            for chosen in idle
        )
        test = " || ".join(f"({one})" for one in tests)
        if test:
            self._where(
                f"!({test})" if len(idle) > 1 else f"!{test}",
                lambda: self.lines.append(f"    force[{axis}] += {self._sum(expr)};"),
            )
        else:
            self.lines.append(f"    force[{axis}] += {self._sum(expr)};")

    def _where(self, test: str, add: Callable[[], None]) -> None:
        """The lines that ``add`` adds, under a test. What they make is not there for others."""
        kept, first = (dict(self.rows), dict(self.constants)), len(self.lines)
        add()
        own = [f"    {line}" for line in self.lines[first:]]
        states = {symbol: name for symbol, name in self.rows.items() if symbol in self.place.model.state_symbols}
        self.rows, self.constants = kept
        self.rows |= states
        self.lines[first:] = [f"    if ({test}) {{", *own, "    }"]

    def counts(self) -> tuple[int, int, int, int]:
        """Rows, constants, corners, bounds."""
        return self.n_rows, self.n_constants, len(self.corners), self.n_bounds

    def size(self) -> str:
        """The same as C."""
        return "{" + ", ".join(map(str, self.counts())) + "}"

    def function(self) -> str:
        """The C function."""
        states = [symbol for symbol in self.place.model.state_symbols if symbol in self.rows]
        place = f"static inline void series_{self.effect.id}(const gyro_view *g, gyro_series *s,"
        head = f"{place} const gyro_series_place *at, int k,\n{' ' * 20}double force[2], double *rate)"
        text = self.place.declare(self.effect, self.read)
        text += "".join(f"    const double *{s.name} = s->s[{state_macro(s)}];\n" for s in states)
        text += "    double(*w)[GYRO_TERMS] = s->w + at->row;\n" if self.n_rows else ""
        text += "    double *c = s->c + at->constant;\n" if self.n_constants else ""
        text += "    (void)g;\n    (void)at;\n    (void)k;\n    (void)rate;\n"
        return f"{head}\n{{\n{text}{self._grouped()}}}\n"

    def _grouped(self) -> str:
        # Constants in a row under one test.
        text = []
        for constant, lines in groupby(self.lines, key=lambda line: line.lstrip().startswith("c[")):
            own = list(lines)
            indent = " " * (len(own[0]) - len(own[0].lstrip()))
            text += [f"{indent}if (k == 0) {{", *(f"    {line}" for line in own), f"{indent}}}"] if constant else own
        return "".join(f"{line}\n" for line in text)

    def _moves(self, expr: Expr) -> bool:
        return bool(expr.free_symbols & self.moving)

    def _constant(self, expr: Expr, *, following: bool = False) -> str:
        if expr.is_Integer:
            return c_expression(sympify(float(expr)))
        if expr not in self.constants:
            if not following:
                self.held |= expr.free_symbols & set(self.changing)
            self.constants[expr] = f"c[{self.n_constants}]"
            self.n_constants += 1
            self.read |= expr.free_symbols - set(self.corners.values())
            self.lines.append(f"    {self.constants[expr]} = {c_expression(expr)};")
        return self.constants[expr]

    def _row(self, expr: Expr, line: Callable[[str], str]) -> str:
        """A row for ``expr``; ``line`` gives its coefficient k, of lower ones of its own at most."""
        row = self.rows[expr] = f"w[{self.n_rows}]"
        self.n_rows += 1
        place = len(self.lines)
        text = line(row)
        # Rows of derivatives, which ask for this one, come after it.
        self.lines.insert(place if self._early(expr) else len(self.lines), f"    {row}[k] = {text};")
        return row

    def _early(self, expr: Expr) -> bool:
        return type(expr).__name__ in _SMOOTH

    def _sum(self, expr: Expr) -> str:
        """Coefficient k of a sum of multiples of rows."""
        terms = []
        for term in self._smooth(sympify(expr)).expand(deep=False, mul=False).as_ordered_terms():
            factor, rest = term.as_independent(*self.moving, as_Add=False)
            if rest == 1:
                terms.append(f"first_only(k, {self._constant(factor)})")
            else:
                terms.append(self._term(factor, rest))
        return " + ".join(terms).replace("+ -", "- ") or "0.0"

    def _term(self, factor: Expr, rest: Expr) -> str:
        """Coefficient k of a multiple of a row."""
        if factor == 1 or factor == -1:
            return f"{'-' if factor == -1 else ''}{self._series(rest)}[k]"
        if factor.free_symbols & set(self.changing):
            return self._following(factor, rest)
        constant = self._constant(factor)
        if not (factor.free_symbols & self.sizes) or rest in self.rows or rest in self.place.model.state_symbols:
            return f"{constant} * {self._series(rest)}[k]"
        # A size or shape at zero, as most are, spares the rows.
        self.terms += 1
        name = f"term_{self.terms}"
        self.lines.append(f"    double {name} = 0.0;")
        self._where(
            f"{constant} != 0.0", lambda: self.lines.append(f"    {name} = {constant} * {self._series(rest)}[k];")
        )
        return name

    def _following(self, factor: Expr, rest: Expr) -> str:
        """The same where laws change the factor within a step."""
        slopes = {symbol: factor.diff(symbol) for symbol in sorted(factor.free_symbols & set(self.changing), key=str)}
        of = self._series(rest)
        own, change = self._constant(factor, following=True), f"c[{self.n_constants}]"
        self.n_constants += 1
        self.read |= set().union(*(slope.free_symbols for slope in slopes.values())) - set(self.corners.values())
        course = " + ".join(
            f"({c_expression(e)})*s->change[{self.changing.index(symbol)}]" for symbol, e in slopes.items()
        )
        self.lines.append(f"    {change} = {course};")
        return f"following(s, {own}, {change}, {of}, k)"

    def _series(self, expr: Expr) -> str:
        """The row of an expression without corners."""
        if expr in self.rows:
            return self.rows[expr]
        if expr in self.place.model.state_symbols:
            self.rows[expr] = expr.name
            return expr.name
        if expr == symbols.t:
            return self._row(expr, lambda row: "k == 0 ? g->t : first_only(k - 1, s->step)")
        if expr.is_Add or expr.as_independent(*self.moving, as_Add=False)[0] != 1:
            return self._row(expr, lambda row: self._sum(expr))
        if expr.is_Mul:
            *head, last = expr.args
            first, second = self._series(expr.func(*head)), self._series(last)
            return self._row(expr, lambda row: f"series_product({first}, {second}, k)")
        return self._power(expr) if expr.is_Pow else self._function(expr)

    def _power(self, expr: Expr) -> str:
        base, exponent = expr.args
        if exponent.is_Integer and exponent > 1:
            if exponent % 2:
                first, second = self._series(base ** (exponent - 1)), self._series(base)
                return self._row(expr, lambda row: f"series_product({first}, {second}, k)")
            half = self._series(base ** (exponent / 2))
            return self._row(expr, lambda row: f"series_square({half}, k)")
        of, to = self._series(base), self._constant(exponent)
        at_first = self._at(base, expr, of)
        return self._row(expr, lambda row: f"k == 0 ? {at_first} : series_power({of}, {row}, {to}, k)")

    def _function(self, expr: Expr) -> str:
        [argument] = expr.args
        of = self._series(argument)
        at_first = self._at(argument, expr, of)
        if type(expr).__name__ in _SATURATING:
            self.n_bounds += 1
            room = _SATURATING[type(expr).__name__].format(f"{of}[0]")
            self.lines.append(f"    bound_change(s, at->bound + {self.n_bounds - 1}, {of}, {room}, k);")
        u = Symbol("u", real=True)
        slope = expr.func(u).diff(u).subs(u, argument)
        return self._row(expr, lambda row: f"k == 0 ? {at_first} : series_integral({of}, {self._series(slope)}, k)")

    def _at(self, argument: Expr, expr: Expr, row: str) -> str:
        """``expr`` as C, its argument being the first of a row."""
        value = Symbol("value", real=True, positive=argument.is_positive)
        exponent = Symbol("exponent", real=True)
        symbolic = expr.is_Pow and not expr.exp.is_Number
        text = c_expression(value**exponent if symbolic else expr.func(value, *expr.args[1:]))
        text = text.replace("value", f"{row}[0]")
        return text.replace("exponent", self._constant(expr.exp)) if symbolic else text

    def _smooth(self, expr: Expr) -> Expr:
        """``expr`` with its corners as signs that a step keeps."""
        if not (self._moves(expr) and expr.has(*_CORNERED)):
            return expr
        args = [self._smooth(arg) for arg in expr.args]
        if isinstance(expr, Abs):
            return self._side(args[0]) * args[0] if self._moves(args[0]) else expr.func(*args)
        if isinstance(expr, (Max, Min)):
            first, *others = args
            for other in others:
                side = self._side(first - other) if self._moves(first - other) else sign(first - other)
                above, below = (first, other) if isinstance(expr, Max) else (other, first)
                first = (1 + side) / 2 * above + (1 - side) / 2 * below
            return first
        if isinstance(expr, (Heaviside, sign)) and self._moves(args[0]):
            side = self._side(args[0])
            return side if isinstance(expr, sign) else (1 + side) / 2
        return expr.func(*args)

    def _side(self, expr: Expr) -> Symbol:
        if expr not in self.corners:
            side = Symbol(f"side_{len(self.corners)}", real=True)
            row = self._series(expr)
            self.corners[expr] = side
            self.lines.append(
                f"    const double {side.name} = side_of(s, at->corner + {len(self.corners) - 1}, {row}, k);"
            )
        return self.corners[expr]
