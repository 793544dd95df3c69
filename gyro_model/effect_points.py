"""Values at which any effect can be evaluated, made from what its own file says: limit cases, start values, units."""

import math
from collections.abc import Iterable, Mapping
from fractions import Fraction
from typing import Any

import numpy as np
from sympy import Expr, Float, Rational, Symbol, pi, preorder_traversal

from gyro_model import symbols
from gyro_model.anatomy import SLOTS, Delay, Effect, Follow, Force, Lag, Law, Map
from gyro_model.evaluate import compiled, evaluate
from gyro_model.model import Model, load_model
from gyro_model.units import Dimension, dimension

MODEL = load_model()
IDS = [effect.id for effect in MODEL.effects]

# What is usual in a gyroscope, by unit: for signals and states that a limit case leaves at zero.
_TYPICAL = {"m": 1e-6, "m/s": 2e-2, "N": 1e-5, "V": 1.0, "rad/s": 5.0, "m/s2": 10.0, "K": 300.0, "s": 0.5, "1": 1.0}
# A neutral value beyond this stands for "no limit", not for a size.
_UNLIMITED = 1e100
_OWN_UNITS = {
    "t": "s",
    "since": "s",
    "after": "1",
    "normal_x": "1",
    "normal_y": "1",
    "q_x": "m",
    "q_y": "m",
    "omega_z_change": "rad/s",
    "pink_x": "Hz0.5",
    "pink_y": "Hz0.5",
    "v_x_rate": "V/s",
    "v_y_rate": "V/s",
}


def unit_of(name: str, model: Model = MODEL) -> str:
    """The unit of any symbol that a term may use."""
    states = {state.symbol.name: state.unit for state in model.states}
    states |= {memory.symbol.name: memory.unit for memory in model.memories}
    return _OWN_UNITS.get(name) or states.get(name) or model.by_name[name].unit


def dimension_of_term(effect: Effect, name: str, model: Model = MODEL) -> Dimension:
    """The dimension that a term must have."""
    remembered = {term: memory.unit for memory in effect.memories for term in memory.terms()}
    if name in remembered:
        return dimension(remembered[name])
    if isinstance(effect, (Delay, Follow, Lag)):
        return dimension("s")
    if isinstance(effect, Force):
        rates = {f"d_{state.symbol.name}": dimension(state.unit) * dimension("s-1") for state in effect.states}
        return rates.get(name, dimension("N.s" if name.startswith("impulse") else "N"))
    return dimension(unit_of(name, model))


def used_symbols(effect: Effect) -> list[str]:
    """Names of all that the terms use or change, sorted."""
    entering = SLOTS[effect.slot].enters if isinstance(effect, Map) else ()
    targets = effect.changes if isinstance(effect, Law) else ()
    return sorted({s.name for s in (*effect.symbols, *entering, *targets)})


def in_limits(effect: Effect, name: str) -> float:
    """The first value other than zero of that symbol in the limit cases; 0 where there is none."""
    return next((limit.at[name] for limit in effect.limits if limit.at.get(name)), 0.0)


def at_limit(effect: Effect, at: Mapping[str, float], model: Model = MODEL) -> dict[str, float]:
    """All symbols of the effect: those of a limit case as given, others at their start (signals and states: zero)."""
    starts = {q.name: q.start for q in model.quantities}
    moving = {s.name for s in (*model.state_symbols, symbols.u_x, symbols.u_y, symbols.v_x, symbols.v_y)}
    moving |= {memory.symbol.name for memory in effect.memories}
    return {name: at.get(name, 0.0 if name in moving else starts.get(name, 0.0)) for name in used_symbols(effect)}


def random_point(effect: Effect, rng: np.random.Generator, model: Model = MODEL) -> dict[str, float]:
    """A generic point: parameters 0.5 to 1 times a limit case (else their start), signals and states of either sign."""
    point = {}
    moving = {s.name for s in model.state_symbols} | {"u_x", "u_y", "v_x", "v_y", *_OWN_UNITS}
    moving = moving - {"t", "since", "after"} | {memory.symbol.name for memory in effect.memories}
    for name in used_symbols(effect):
        quantity = model.by_name.get(name)
        value = (
            in_limits(effect, name) or (quantity.start if quantity else 0.0) or _TYPICAL.get(unit_of(name, model), 1.0)
        )
        sign = rng.choice((-1.0, 1.0)) if name in moving else 1.0
        point[name] = float(sign * value * rng.uniform(0.5, 1.0))
    if "after" in point:
        point["after"] = float(rng.integers(2))
    return point


def neutral_point(effect: Effect, rng: np.random.Generator, model: Model = MODEL) -> dict[str, float]:
    """A generic point with the sizes of the effect at neutral."""
    return random_point(effect, rng, model) | {q.name: q.start for q in effect.sizes}


def recalled(effect: Effect, point: Mapping[str, float]) -> dict[str, float]:
    """``point`` with what the effect remembers as it is now, from what it was."""
    terms = effect.terms()
    now = {m.symbol.name: terms[f"now_{m.symbol.name}"] for m in effect.memories if m.now is not None}
    values = {
        name: compiled(expr, _sorted(expr))(*(point[s.name] for s in _sorted(expr))) for name, expr in now.items()
    }
    return dict(point) | {name: float(value) for name, value in values.items()}


def _sorted(expr: Expr) -> tuple[Symbol, ...]:
    return tuple(sorted(expr.free_symbols, key=lambda symbol: symbol.name))


def condition(effect: Effect, point: Mapping[str, float]) -> dict[str, float]:
    """|f| + Σ|p ∂f/∂p| for each term f, which rounds like this times units in the last place, whatever the order."""
    step = 1e-6
    base = {name: float(abs(value)) for name, value in evaluate(effect, point).items()}
    for name, value in point.items():
        above, below = (evaluate(effect, {**point, name: value * (1 + s)}) for s in (step, -step))
        for term in base:
            base[term] += abs(float(above[term]) - float(below[term])) / (2 * step)
    return base


def active_parameters(effect: Effect, rng: np.random.Generator, model: Model = MODEL) -> dict[str, float]:
    """Sizes and shapes that switch the effect on: half way from neutral to its first limit case, and a little more."""
    own = {q.name: q for q in model.quantities if q.role in ("size", "shape")}
    chosen = {}
    for name, value in effect.limits[0].at.items():
        if name in own:
            start = own[name].start if own[name].start < _UNLIMITED else 0.0
            chosen[name] = float(start + (value - start) * rng.uniform(0.5, 0.6))
    return chosen


def floats_in(exprs: Iterable[Expr]) -> set[float]:
    """Every decimal number in the expressions; whole numbers and fractions aside."""
    return {float(node) for expr in exprs for node in preorder_traversal(expr) if isinstance(node, Float)}


def exactly(expr: Expr, values: Mapping[str, float]) -> float:
    """``expr`` in doubles by products and square roots alone, which scale by powers of four without rounding."""
    if isinstance(expr, Symbol):
        return values[expr.name]
    if isinstance(expr, Rational):
        return float(expr.p) / float(expr.q)
    if isinstance(expr, Float) or expr == pi:
        return float(expr)
    if expr.is_Pow:
        if expr.exp.free_symbols:
            # Of a number without a dimension, to a power that is a parameter.
            return exactly(expr.base, values) ** exactly(expr.exp, values)
        return _power(exactly(expr.base, values), expr.exp)
    args = [exactly(arg, values) for arg in expr.args]
    if expr.is_Add:
        return _summed(args)
    if expr.is_Mul:
        return math.prod(args)
    special: dict[str, Any] = {"nearest_integer": round, "Max": max, "Min": min, "Abs": abs}
    special["Heaviside"] = lambda at, middle: 1.0 if at > 0 else 0.0 if at < 0 else middle
    name = type(expr).__name__
    return float(special[name](*args) if name in special else getattr(math, name)(*args))


def _summed(args: list[float]) -> float:
    total = args[0]
    for arg in args[1:]:
        total += arg
    return total


def _power(base: float, exponent: Expr) -> float:
    assert (2 * exponent).is_Integer, f"exponent {exponent} does not scale exactly"
    whole = abs(int(2 * exponent))
    root = math.sqrt(base) if whole % 2 else base
    result = math.prod([root] * (whole if whole % 2 else whole // 2))
    return 1.0 / result if exponent < 0 else result


def found_dimension(expr: Expr, point: Mapping[str, float], units: Mapping[str, str]) -> Dimension | None:
    """The dimension that ``expr`` has at ``point``, by the unit of each symbol; None where it adds up unlike ones."""
    found = {}
    value = exactly(expr, point)
    for base in ("kg", "m", "s", "A", "K"):
        powers = {name: getattr(dimension(unit), base) for name, unit in units.items()}
        scaled = {name: number * 4.0 ** float(powers[name]) for name, number in point.items()}
        ratio = exactly(expr, scaled) / value
        # A fraction such as a half or a third is found again; a mixture of units gives none.
        power = Fraction(math.log(ratio, 4)).limit_denominator(12) if ratio > 0.0 else Fraction(0)
        if not math.isclose(ratio, 4.0 ** float(power), rel_tol=1e-12):
            return None
        found[base] = power
    return Dimension(**found)
