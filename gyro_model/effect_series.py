"""The C function that expands the force of one effect into its Taylor series.

What acts on both axes alike, x and y exchanged, is expanded for both at once, as pairs; ``x`` is then the pair (x, y)
and ``y`` the pair (y, x). What does not is expanded axis by axis, and both of a pair are the same. A square of a state
that two effects ask for is made once.

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
from gyro_model.anatomy import Force, State
from gyro_model.c_printing import c_expression
from gyro_model.effect_functions import Places
from gyro_model.model import Model

_SMOOTH: Final = ("exp", "log", "sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh")
_SATURATING: Final = {"tanh": ("fabs({}) - 19.0", "-{}"), "exp": ("-{} - 40.0", "1.0")}
"""By how much an argument may change and leave the function at its end within rounding of 1, and which way: there it
says nothing of what comes beyond."""
_OF_PAIRS: Final = {
    "gyro_exp(value)": "exp_of_pair({row}[0])",
    "gyro_tanh(value)": "tanh_of_pair({row}[0])",
    "gyro_power(value, exponent)": "power_of_pair({row}[0], {exponent})",
}
"""Functions that fmu_src/full/pair_math.h has for two numbers at once, by how one is written."""
_CORNERED: Final = (Abs, Max, Min, Heaviside, sign)


def square_macro(square: Expr) -> str:
    """The index of the square of a state, which effects share, in C."""
    return f"GYRO_SHARED_{square.base.name.upper()}_SQUARED"


_AXES: Final = {symbols.x: symbols.y, symbols.y: symbols.x, symbols.x_dot: symbols.y_dot, symbols.y_dot: symbols.x_dot}


def both_axes(symbol: Symbol) -> tuple[Symbol, Symbol]:
    """The motion of an axis and of the other one."""
    return symbol, _AXES[symbol]


def pair_macro(pair: tuple[Symbol, Symbol]) -> str:
    """The index of a pair of states in C."""
    return "GYRO_PAIR_" + "_AND_".join(symbol.name.upper() for symbol in pair)


def _exchange(effect: Force) -> dict[Symbol, Symbol]:
    """What takes the force of x to that of y and back; nothing where those are not the same."""
    own = {symbol.name: symbol for symbol in effect.symbols}
    there = {symbol: own.get(f"{name[:-2]}_y", symbol) for name, symbol in own.items() if name.endswith("_x")}
    exchange = there | {b: a for a, b in there.items()} | _AXES
    rates = {state.symbol: sympify(state.rate) for state in effect.states}
    same = sympify(effect.force[0]).xreplace(exchange) == effect.force[1] and all(
        rates.get(exchange.get(symbol)) == rate.xreplace(exchange) for symbol, rate in rates.items()
    )
    return exchange if same else {}


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


class Series:
    """The lines of one effect's function. A row holds the coefficients of one expression that changes with the motion,
    and of that for the other axis where those go together; what does not change is a constant, found with coefficient
    0."""

    def __init__(self, effect: Force, place: Places, changing: Sequence[Symbol], shared: Sequence[Expr] = ()) -> None:
        self.effect, self.place, self.changing, self.shared = effect, place, changing, shared
        self.squares: set[Expr] = set()
        self.held: set[Symbol] = set()
        self.moving = {*place.model.state_symbols, symbols.t}
        self.lines: list[str] = []
        self.rows: dict[Expr, str] = {}
        self.constants: dict[Expr, str] = {}
        self.corners: dict[Expr, Symbol] = {}
        self.read: set[Symbol] = set()
        self.n_rows = self.n_constants = self.n_bounds = self.terms = 0
        self.sizes = {q.symbol for q in effect.parameters if q.start == 0.0}
        self.exchange = _exchange(effect)
        self.lanes = 2 if self.exchange else 1
        self.pairs: set[tuple[Symbol, Symbol]] = set()
        self.own: list[tuple[Symbol, Symbol]] = []
        self.positive: set[Expr] = set()
        for axis, expr in enumerate(effect.force[: 1 if self.exchange else 2]):
            if expr != 0:
                self._force(axis, self._smooth(sympify(expr)))
        for state in effect.states:
            self._rate(state)

    def _rate(self, state: State) -> None:
        """The next coefficient of a state, and of that which goes with it, once for both."""
        pair = self._states(state.symbol)
        if pair == tuple(sorted(pair, key=str)):
            self.own.append(pair)
            factor, rest = sympify(state.rate).as_independent(*self.moving, as_Add=False)
            # A product of what does not move need not wait for the coefficient.
            step = "both(h)" if factor == 1 else f"pair_scaled(h, {self._constant(factor)})"
            self.lines.append(f"    s->of[{pair_macro(pair)}][k + 1] = pair_product({step}, {self._sum(rest)});")

    def _force(self, axis: int, expr: Expr) -> None:
        """The force of one axis: nothing where no corner lets it act."""
        sides = sorted(expr.free_symbols & set(self.corners.values()), key=str)
        idle = [
            dict(zip(sides, chosen, strict=True))
            for chosen in product((1, -1), repeat=len(sides))
            if sides and expr.subs(dict(zip(sides, chosen, strict=True))) == 0
        ]
        acts = [
            "(" + " || ".join(f"{self._lane(s, lane)} {'<' if c > 0 else '>'} 0.0" for s, c in chosen.items()) + ")"
            for lane in range(self.lanes)
            for chosen in idle
        ]
        acting = [" && ".join(acts[lane * len(idle) :][: len(idle)]) for lane in range(self.lanes)]
        test = " || ".join(acting if len(idle) < 2 else [f"({one})" for one in acting]) if idle else ""
        if test:
            self._where(
                test.removeprefix("(").removesuffix(")") if len(acts) == 1 else test, lambda: self._add(axis, expr)
            )
        else:
            self._add(axis, expr)

    def _add(self, axis: int, expr: Expr) -> None:
        text = self._sum(expr) if self.exchange else f"on_axis({axis}, {self._sum(expr)})"
        self.lines.append(f"    *force = pair_sum(*force, {text});")

    def _lane(self, expr: Expr, lane: int) -> Expr:
        """``expr`` as it is for one of the pair."""
        return expr.xreplace(self.exchange) if lane else expr

    def _pair(self, expr: Expr, text: Callable[[Expr], str] = c_expression) -> str:
        """What does not move, as a pair."""
        first, last = (text(self._lane(expr, lane)) for lane in (0, self.lanes - 1))
        return f"both({first})" if first == last else f"pair_of({first}, {last})"

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
        return self.n_rows, self.n_constants, self.lanes * len(self.corners), self.n_bounds

    def size(self) -> str:
        """The same as C."""
        bits = sum(1 << i for i, square in enumerate(self.shared) if square in self.squares)
        return "{" + ", ".join(map(str, (*self.counts(), bits))) + "}"

    def function(self) -> str:
        """The C function."""
        states = [symbol for symbol in self.place.model.state_symbols if symbol in self.rows]
        place = f"static GYRO_INLINE void series_effect_{self.effect.id}(const gyro_view *g, gyro_series *s,"
        head = f"{place} const gyro_series_place *at, int k,\n{' ' * 20}double h, gyro_pair *force)"
        text = self.place.declare(self.effect, self.read)
        text += "".join(f"    const gyro_pair *{s.name} = s->of[{pair_macro(self._states(s))}];\n" for s in states)
        text += "".join(
            f"    const gyro_pair *{square.base.name}_squared = s->shared[{square_macro(square)}];\n"
            for square in self.shared
            if square in self.squares
        )
        text += "    gyro_pair(*w)[GYRO_TERMS] = s->w + at->row;\n" if self.n_rows else ""
        text += "    gyro_pair *c = s->c + at->constant;\n" if self.n_constants else ""
        text += "    (void)g;\n    (void)at;\n    (void)k;\n    (void)h;\n    (void)force;\n"
        return f"{head}\n{{\n{text}{self._grouped()}}}\n"

    def _states(self, symbol: Symbol) -> tuple[Symbol, Symbol]:
        """The pair that stands for a state."""
        return symbol, self.exchange.get(symbol, symbol)

    def _grouped(self) -> str:
        # What is found with coefficient 0 only, where it stands in a row, under one test.
        text = []
        for constant, lines in groupby(self.lines, key=lambda line: line.lstrip().startswith(("c[", "bound_change("))):
            own = list(lines)
            indent = " " * (len(own[0]) - len(own[0].lstrip()))
            text += [f"{indent}if (k == 0) {{", *(f"    {line}" for line in own), f"{indent}}}"] if constant else own
        return "".join(f"{line}\n" for line in text)

    def _moves(self, expr: Expr) -> bool:
        return bool(expr.free_symbols & self.moving)

    def _constant(self, expr: Expr, *, following: bool = False) -> str:
        if expr.is_Integer:
            return f"both({c_expression(sympify(float(expr)))})"
        if expr not in self.constants:
            if not following:
                self.held |= expr.free_symbols & set(self.changing)
            self.constants[expr] = f"c[{self.n_constants}]"
            self.n_constants += 1
            self._reads(expr.free_symbols)
            self.lines.append(f"    {self.constants[expr]} = {self._pair(expr)};")
        return self.constants[expr]

    def _reads(self, of: set[Symbol]) -> None:
        own = of - set(self.corners.values())
        self.read |= own | {self.exchange.get(symbol, symbol) for symbol in own}

    def _row(self, expr: Expr, line: Callable[[str], str]) -> str:
        """A row for ``expr``; ``line`` gives its coefficient k, of lower ones of its own at most."""
        row = self.rows[expr] = f"w[{self.n_rows}]"
        self.n_rows += 1
        place = len(self.lines)
        text = line(row)
        if expr in self.positive and not expr.is_Pow:
            # At a corner that makes it so, rounding may have left it on the other side.
            text = f"first_size(k, {text})"
        # Rows of derivatives, which ask for this one, come after it.
        self.lines.insert(place if self._early(expr) else len(self.lines), f"    {row}[k] = {text};")
        return row

    def _early(self, expr: Expr) -> bool:
        return type(expr).__name__ in _SMOOTH

    def _sum(self, expr: Expr) -> str:
        """Coefficient k of a sum of multiples of rows."""
        text = ""
        terms = self._smooth(sympify(expr)).expand(deep=False, mul=False).as_ordered_terms()
        factors = self._collected(terms)
        # What may be spared comes last: it may use what the others make, but not they what it makes.
        for factor, rest in sorted(factors, key=lambda pair: bool(pair[0].free_symbols & self.sizes)):
            if rest == 1:
                one = f"first_only(k, {self._constant(factor)})"
            elif factor == -1:
                one = f"{self._series(rest)}[k]"
                text = text and f"pair_difference({text}, {one})"
                one = "" if text else f"pair_negative({one})"
            elif self._may_be_spared(factor, rest):
                text, one = self._spared(text, factor, rest), ""
            else:
                one = self._term(factor, rest)
            text = f"pair_sum({text}, {one})" if text and one else text or one
        return text or "both(0.0)"

    def _collected(self, terms: Sequence[Expr]) -> list[tuple[Expr, Expr]]:
        """Factors that do not move, each with what it multiplies: multiples of one row by the sum of their factors."""
        sums: dict[Expr, Expr] = {}
        for factor, rest in (term.as_independent(*self.moving, as_Add=False) for term in terms):
            sums[rest] = sums.get(rest, sympify(0)) + factor
        return [(factor, rest) for rest, factor in sums.items()]

    def _term(self, factor: Expr, rest: Expr) -> str:
        """Coefficient k of a multiple of a row."""
        if factor == 1:
            return f"{self._series(rest)}[k]"
        if factor.free_symbols & set(self.changing):
            return self._following(factor, rest)
        constant = self._constant(factor)
        return f"pair_product({constant}, {self._series(rest)}[k])"

    def _may_be_spared(self, factor: Expr, rest: Expr) -> bool:
        """Whether a size or shape at zero, as most are, spares rows."""
        there = rest in self.rows or rest in self.place.model.state_symbols
        return bool(factor.free_symbols & self.sizes) and not factor.free_symbols & set(self.changing) and not there

    def _spared(self, text: str, factor: Expr, rest: Expr) -> str:
        """The sum ``text`` with coefficient k of a multiple of a row, under a test: a processor guesses its outcome,
        and need not wait for a sum with nothing."""
        constant = self._constant(factor)
        self.terms += 1
        name = f"sum_{self.terms}"
        self.lines.append(f"    gyro_pair {name} = {text or 'both(0.0)'};")

        def add() -> None:
            one = f"pair_product({constant}, {self._series(rest)}[k])"
            self.lines.append(f"    {name} = {f'pair_sum({name}, {one})' if text else one};")

        self._where(f"!is_zero({constant})", add)
        return name

    def _following(self, factor: Expr, rest: Expr) -> str:
        """The same where laws change the factor within a step."""
        of = self._series(rest)
        own, change = self._constant(factor, following=True), f"c[{self.n_constants}]"
        self.n_constants += 1
        self.lines.append(f"    {change} = {self._pair(factor, self._change)};")
        return f"following(s, {own}, {change}, {of}, k)"

    def _change(self, factor: Expr) -> str:
        """By what laws change a factor within a step, in C."""
        slopes = {symbol: factor.diff(symbol) for symbol in sorted(factor.free_symbols & set(self.changing), key=str)}
        self.read |= set().union(*(slope.free_symbols for slope in slopes.values())) - set(self.corners.values())
        return " + ".join(
            f"({c_expression(slope)})*s->change[{self.changing.index(symbol)}]" for symbol, slope in slopes.items()
        )

    def _series(self, expr: Expr) -> str:
        """The row of an expression without corners."""
        if expr in self.rows:
            return self.rows[expr]
        if expr in self.place.model.state_symbols:
            self.rows[expr] = expr.name
            self.pairs.add(self._states(expr))
            return expr.name
        if expr == symbols.t:
            return self._row(expr, lambda row: "k == 0 ? both(g->t) : first_only(k - 1, both(s->step))")
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
            if self.exchange and exponent == 2 and base in _AXES:
                self.squares.add(expr)
                if expr in self.shared:
                    return f"{base.name}_squared"
            half = self._series(base ** (exponent / 2))
            return self._row(expr, lambda row: f"series_square({half}, k)")
        of, to = self._series(base), self._constant(exponent)
        at_first = self._at(base, expr, of)
        power = "series_power" if exponent.is_Number else "series_any_power"
        if not exponent.is_Number:
            self._bound(of, lambda lane: f"room_of_power(lane_of({of}[0], {lane}), lane_of({to}, {lane})), 0.0")
        return self._row(expr, lambda row: f"k == 0 ? {at_first} : {power}({of}, {row}, {to}, k)")

    def _function(self, expr: Expr) -> str:
        [argument] = expr.args
        of = self._series(argument)
        at_first = self._at(argument, expr, of)
        if type(expr).__name__ in _SATURATING:
            room, way = _SATURATING[type(expr).__name__]
            first = [f"lane_of({of}[0], {lane})" for lane in range(self.lanes)]
            self._bound(of, lambda lane: f"larger(GYRO_SHOWN, {room.format(first[lane])}), {way.format(first[lane])}")
        u = Symbol("u", real=True)
        slope = expr.func(u).diff(u).subs(u, argument)
        rate = self._rate_of(argument, of)
        return self._row(
            expr, lambda row: f"k == 0 ? {at_first} : series_integral({rate}, {of}, {self._series(slope)}, k)"
        )

    def _bound(self, of: str, room: Callable[[int], str]) -> None:
        """Bounds the change of a row's lanes."""
        for lane in range(self.lanes):
            self.lines.append(f"    bound_change(s, at->bound + {self.n_bounds}, {of}, {lane}, {room(lane)});")
            self.n_bounds += 1

    def _rate_of(self, expr: Expr, of: str) -> str:
        """The row of the derivative of ``expr``, times the time: coefficient k is k times that of ``expr``."""
        rate = Symbol(f"rate_of_{of}")
        if rate not in self.rows:
            self._row(rate, lambda row: f"pair_scaled(k, {of}[k])")
        return self.rows[rate]

    def _at(self, argument: Expr, expr: Expr, row: str) -> str:
        """``expr`` as C, its argument being the first of a row."""
        positive = argument.is_positive or argument in self.positive
        value = Symbol("value", real=True, positive=positive)
        exponent = Symbol("exponent", real=True)
        symbolic = expr.is_Pow and not expr.exp.is_Number
        text = c_expression(value**exponent if symbolic else expr.func(value, *expr.args[1:]))
        to = self._constant(expr.exp) if symbolic else ""
        first, last = (
            text.replace("value", f"lane_of({row}[0], {lane})").replace("exponent", f"lane_of({to}, {lane})")
            for lane in (0, self.lanes - 1)
        )
        of_pair = _OF_PAIRS.get(text, "").format(row=row, exponent=to)
        return f"both({first})" if first == last else of_pair or f"pair_of({first}, {last})"

    def _smooth(self, expr: Expr) -> Expr:
        """``expr`` with its corners as signs that a step keeps."""
        if not (self._moves(expr) and expr.has(*_CORNERED)):
            return expr
        args = [self._smooth(arg) for arg in expr.args]
        self.positive |= {arg for arg, own in zip(args, expr.args, strict=True) if own.is_positive and arg != own}
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
            name, place = f"side_{len(self.corners)}", self.lanes * len(self.corners)
            row = self._series(expr)
            side, other = (Symbol(f"{name}[{lane}]", real=True) for lane in (0, 1))
            self.corners[expr] = side
            if self.exchange:
                self.exchange[side] = other
            self.lines.append(f"    const double *{name} = sides_of(s, at->corner + {place}, {row}, {self.lanes}, k);")
        return self.corners[expr]
