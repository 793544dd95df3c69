"""What every effect must fulfil, packaged or a user's own: each check raises InputError with the reason.

Like scikit-learn's ``check_estimator``: the same checks run over the packaged effects in the tests of this package.
"""

import contextlib
import hashlib
import importlib.util
import math
import sys
from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Final

import numpy as np
import platformdirs
from sympy import Expr, Heaviside, Symbol, simplify, sympify

from gyro_model import symbols
from gyro_model.anatomy import Effect, Force, Law, Map
from gyro_model.effect_points import (
    at_limit,
    dimension_of_term,
    exactly,
    found_dimension,
    neutral_point,
    random_point,
    recalled,
    unit_of,
    used_symbols,
)
from gyro_model.errors import InputError
from gyro_model.evaluate import evaluate
from gyro_model.model import Model
from gyro_model.units import Dimension, dimension, text_of

EPS: Final = sys.float_info.epsilon
LIMIT_ROUNDING: Final = 10 * EPS
"""Limit cases are worked out in decimals: a rounding of each operand and operation, of which no term has more than
ten."""
CONSTANT_UNITS: Final = {"BOLTZMANN": "J/K"}
"""Numbers with a dimension that gyro_model.symbols offers, by name."""


def check_effect(effect: Effect, model: Model, file: Path | None = None) -> None:
    """Runs every check over ``effect``, which is part of ``model``. Raises InputError with the first reason.

    file: where it is defined, read once more to see which of its numbers are constants with a dimension.
    """
    for check in CHECKS:
        if check is dimensions and file is not None:
            dimensions(effect, model, terms_with_constants(file))
        else:
            check(effect, model)


def check_files(folders: Sequence[Path], model: Model) -> None:
    """Runs every check over the effects in ``folders``, which are part of ``model``; what has passed is kept in the
    user's cache, by the digest of the files and of this code. Raises InputError with the first reason."""
    files = [path for folder in folders for path in sorted(folder.glob("*.py")) if path.stem != "__init__"]
    code = hashlib.sha256(b"".join(path.read_bytes() for path in (*sorted(Path(__file__).parent.glob("*.py")), *files)))
    passed = Path(platformdirs.user_cache_dir("gyrotwin")) / "checked" / code.hexdigest()
    if passed.is_file():
        return
    for path in files:
        check_effect(model.effect(path.stem), model, path)
    # Without a cache they are checked again.
    with contextlib.suppress(OSError):
        passed.parent.mkdir(parents=True, exist_ok=True)
        passed.touch()


def terms_with_constants(file: Path) -> Mapping[str, Expr]:
    """The terms of the effect in ``file`` with the constants of CONSTANT_UNITS as symbols, so that they can be
    rescaled."""
    numbers = {name: getattr(symbols, name) for name in CONSTANT_UNITS}
    spec = importlib.util.spec_from_file_location(f"_rescaled_{file.stem}", file)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    try:
        for name in numbers:
            setattr(symbols, name, Symbol(name, positive=True))
        spec.loader.exec_module(module)
    finally:
        for name, number in numbers.items():
            setattr(symbols, name, number)
    terms: Mapping[str, Expr] = module.EFFECT.terms()
    return terms


def documentation(effect: Effect, model: Model) -> None:
    """The file says what the effect is, how it shows and why each limit case holds."""
    texts = {"docstring": effect.doc, "signature": effect.signature, "host_experiment": effect.host_experiment}
    texts |= {f"description of {q.name}": q.description for q in effect.parameters}
    texts |= {f"why of limit case {k}": limit.why for k, limit in enumerate(effect.limits, 1)}
    for what, text in texts.items():
        if not text.strip():
            _fail(effect, f"{what} is empty: say it in words")


def starts(effect: Effect, model: Model) -> None:
    """What a state starts at is a parameter of the effect that says nothing else: in its unit, zero by default, used by
    no term and by no other state."""
    stated = [(s, s.start) for s in getattr(effect, "states", ()) if s.start is not None]
    for state, start in stated:
        name = f"the start of {state.symbol.name}, {start.name},"
        if start not in effect.parameters:
            _fail(effect, f"{name} is not among its parameters: add it there")
        if start.role != "start":
            _fail(effect, f"{name} is a {start.role}: make it by gyro_model.quantities.start")
        if start.unit != state.unit:
            _fail(effect, f"{name} is in {start.unit}: give it in {state.unit}, as the state is")
        if start.start != 0.0:
            _fail(effect, f"{name} is {start.start:g} by default: let it be 0, where no run is another")
    for start in effect.starts:
        if sum(own == start for _, own in stated) != 1:
            _fail(effect, f"{start.name} is a start: give it to one state, State(..., start=...)")
        if start.symbol in effect.symbols:
            _fail(effect, f"{start.name} is a start, and a term uses it: add a shape for that")


def limit_cases(effect: Effect, model: Model) -> None:
    """The terms give what the limit cases, computed by hand, say; each size is used by one."""
    for limit in effect.limits:
        unused = set(limit.at) - set(used_symbols(effect))
        if unused:
            _fail(effect, f"limit case sets {', '.join(sorted(unused))}, which no term uses")
        terms = evaluate(effect, at_limit(effect, limit.at, model))
        if set(limit.gives) != set(terms):
            _fail(
                effect, f"limit case gives {', '.join(sorted(limit.gives))}; the terms are {', '.join(sorted(terms))}"
            )
        for name, value in limit.gives.items():
            if not abs(float(terms[name]) - value) <= LIMIT_ROUNDING * abs(value):
                _fail(effect, f"limit case {limit.why!r}: {name} is {float(terms[name])!r}, by hand {value!r}")
    for quantity in effect.sizes:
        if all(limit.at.get(quantity.name, quantity.start) == quantity.start for limit in effect.limits):
            _fail(effect, f"no limit case uses {quantity.name}: add one where it is not {quantity.start:g}")


def neutral_size(effect: Effect, model: Model) -> None:
    """At neutral sizes an effect that can be switched leaves everything as it is."""
    if effect.nominal:
        return
    rng = np.random.default_rng(1)
    for _ in range(50):
        point = recalled(effect, neutral_point(effect, rng, model))
        for name, expr in effect.neutral().items():
            wanted = float(expr) if expr.is_Number else point[expr.name]
            with np.errstate(all="ignore"):
                try:
                    value = float(evaluate(effect, point)[name])
                except ZeroDivisionError:
                    value = math.nan
            if math.isnan(value):
                # A term may divide by a neutral size of zero, where the C does not call it; it must tend to neutral.
                near = point | {q.name: q.start + 1e-9 for q in effect.sizes}
                distance, allowed = abs(float(evaluate(effect, near)[name]) - wanted), 1e-9
            else:
                distance, allowed = abs(value - wanted), 0.0
            if not distance <= allowed:
                _fail(effect, f"at its neutral size {name} is {value:g} instead of {wanted:g}")


def memory(effect: Effect, model: Model) -> None:
    """What an effect remembers is taken at no time in between or at any: it is the same after two parts of a time as
    after the whole, and after none what it was."""
    rng = np.random.default_rng(5)
    for _ in range(50):
        point = random_point(effect, rng, model)
        first, second = rng.uniform(0.0, 2.0, 2) * point.get("since", 1.0)
        still, whole, part = (recalled(effect, point | {"since": float(s)}) for s in (0.0, first + second, first))
        for own in effect.memories:
            name = own.symbol.name
            [twice] = [recalled(effect, part | {"since": float(second)})[name]]
            # Exponentials of times add up to some roundings of their argument.
            allowed = 100 * EPS * max(abs(point[name]), abs(whole[name]), abs(whole[name] - point[name]))
            if own.flows and not abs(still[name] - point[name]) <= allowed:
                _fail(effect, f"{name} after no time is {still[name]:g}, and was {point[name]:g}")
            if not abs(twice - whole[name]) <= (allowed if own.flows else 0.0):
                _fail(effect, f"{name} is {whole[name]!r}, but {twice!r} where it is taken on the way too")


def dimensions(effect: Effect, model: Model, terms: Mapping[str, Expr] | None = None) -> None:
    """The terms scale with the units as their dimension says, to the last bit."""
    rng = np.random.default_rng(2)
    for _ in range(20):
        # Powers of four: even their square roots are exact, so a right dimension rescales to the last bit.
        powers = rng.permutation(np.arange(-3, 4))[:5]
        scale = dict(zip(("kg", "m", "s", "A", "K"), (4.0 ** float(power) for power in powers), strict=True))
        point = random_point(effect, rng, model) | {name: 1.38e-23 for name in CONSTANT_UNITS}
        units = {name: CONSTANT_UNITS.get(name) or unit_of(name, model) for name in point}
        rescaled = {name: value * _factor(dimension(units[name]), scale) for name, value in point.items()}
        for name, expr in (terms if terms is not None else effect.terms()).items():
            wanted = exactly(expr, point) * _factor(dimension_of_term(effect, name, model), scale)
            if exactly(expr, rescaled) != wanted:
                _fail(
                    effect, f"{name} = {expr}: wrong dimension: {_units_told(effect, expr, name, model, point, units)}"
                )


def _units_told(
    effect: Effect, expr: Expr, name: str, model: Model, point: Mapping[str, float], units: Mapping[str, str]
) -> str:
    """What a term is in, what it must be in, and with which unit of one of its parameters it would be."""
    due = dimension_of_term(effect, name, model)
    found = found_dimension(expr, point, units)
    # The check that failed is to the last bit: parts too small to be found are there all the same.
    if found is None or text_of(found) == text_of(due):
        return f"it adds up parts in unlike units; {text_of(due)} is due; check the units of its parameters"
    fitting = []
    for q in effect.parameters:
        power = found_dimension(expr, point, {n: "kg" if n == q.name else "1" for n in units})
        if power is not None and power.kg:
            other = dimension(q.unit) * (due * found ** Fraction(-1)) ** (1 / power.kg)
            fitting.append(f"{q.name} in {text_of(other)} instead of {q.unit}")
    would = f"; it would be with {' or '.join(fitting)}" if fitting else ""
    return f"it is in {text_of(found)}, {text_of(due)} is due{would}"


def noise(effect: Effect, model: Model) -> None:
    """What draws numbers, or rounds, says that it is noise; a random force has no energy of its own."""
    draws = bool({*symbols.NORMAL, *symbols.PINK} & effect.symbols)
    rounds = isinstance(effect, Map) and effect.slot == "sampled round"
    if effect.noise != (draws or rounds):
        _fail(effect, f"noise = {effect.noise}: give {not effect.noise}, by what its terms draw")
    if isinstance(effect, Force) and draws and effect.energy is not None:
        _fail(effect, "a random force exchanges energy with the outside: state no energy")


def passive(effect: Effect, model: Model) -> None:
    """A law that changes damping leaves a passive device passive."""
    if not isinstance(effect, Law):
        return
    rng = np.random.default_rng(4)
    for _ in range(50):
        point = random_point(effect, rng, model)
        new = point | {name: float(value) for name, value in evaluate(effect, point).items()}
        damped = {"dxx", "dyy", "dxy"} <= set(new) and point["dxy"] ** 2 <= point["dxx"] * point["dyy"]
        # Rounding of four products at the border itself.
        if damped and not new["dxy"] ** 2 <= new["dxx"] * new["dyy"] * (1 + 4 * EPS):
            _fail(effect, "dxy^2 exceeds dxx dyy: the damping would be a motor in some direction")


def _factor(of: Dimension, scale: Mapping[str, float]) -> float:
    return math.prod(scale[base] ** float(getattr(of, base)) for base in scale)


def energy(effect: Effect, model: Model) -> None:
    """What a force that states its energy gives is what it stores and dissipates; it dissipates nothing negative."""
    if not isinstance(effect, Force) or effect.energy is None:
        return
    x, x_dot, y, y_dot = symbols.STATES
    terms, stored, dissipated = effect.terms(), effect.energy.stored, effect.energy.dissipated
    if {x_dot, y_dot} & stored.free_symbols:
        _fail(effect, "stored energy depends on a velocity: positions and states of its own alone store")
    rates = {x: x_dot, y: y_dot} | {state.symbol: state.rate for state in effect.states}
    stored_rate = sum(stored.diff(symbol) * rate for symbol, rate in rates.items())
    power = terms["force_x"] * x_dot + terms["force_y"] * y_dot
    power, stored_rate = (sympify(e).subs({symbols.u_x: 0, symbols.u_y: 0}) for e in (power, stored_rate))
    if (power + stored_rate).has(Heaviside):
        # Algebra does not see through the corners of Max and Min; numbers on both sides of them do.
        _check_balance(effect, model, power, stored_rate, dissipated)
    elif simplify(power + stored_rate + dissipated) != 0:
        _fail(effect, f"energy: power {power}, change of what is stored {stored_rate} and dissipation {dissipated} "
                      "do not add up to zero")  # fmt: skip
    rng = np.random.default_rng(3)
    for _ in range(200):
        point = random_point(effect, rng, model)
        # A passive damping matrix, up to the very border; sizes and shapes of the random point are positive already.
        if {"dxx", "dyy", "dxy"} <= set(point):
            point["dxy"] = float(rng.uniform(-1, 1) * math.sqrt(point["dxx"] * point["dyy"]))
        if exactly(dissipated, point) < 0.0:
            _fail(effect, f"energy: dissipation {dissipated} is negative somewhere: the effect would be a motor")


def _check_balance(effect: Effect, model: Model, *powers: Expr) -> None:
    rng = np.random.default_rng(7)
    sizes: list[float] = []
    for _ in range(300):
        point = random_point(effect, rng, model)
        point |= {name: rng.uniform(0, 2) * value for name, value in point.items() if name in ("x", "y")}
        values = [exactly(power, point) for power in powers]
        sizes.append(max(map(abs, values)))
        # Each is a sum of four products of ten roundings; a depth is the difference of lengths ten times as large.
        if abs(sum(values)) > 400 * EPS * sizes[-1]:
            _fail(effect, "energy: power, change of what is stored and dissipation do not add up to zero")
    if not 0 < sum(size == 0 for size in sizes) < len(sizes):
        _fail(effect, "energy: the limit cases lie on one side of the corner; give the range by one on either side")


def _fail(effect: Effect, reason: str) -> None:
    raise InputError(f"effect {effect.id}: {reason}")


CHECKS: Final[tuple[Callable[[Effect, Model], None], ...]] = (
    documentation, starts, limit_cases, neutral_size, memory, dimensions, energy, noise, passive,
)  # fmt: skip
