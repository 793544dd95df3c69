"""What every effect must fulfil, on its own expressions. A new effect file is covered as soon as it is there."""

import importlib.util
import math
import re
import sys

import numpy as np
import pytest
from effect_points import (
    IDS,
    MODEL,
    at_limit,
    dimension_of_term,
    exactly,
    floats_in,
    neutral_point,
    random_point,
    unit_of,
    used_symbols,
)
from sympy import Expr, Float, Heaviside, Symbol, simplify
from sympy import symbols as make_symbols

import gyro_model.symbols
from gyro_model.anatomy import Effect, Force, Law, Map
from gyro_model.evaluate import evaluate
from gyro_model.model import EFFECTS_FOLDER
from gyro_model.units import Dimension, dimension

# The numbers with a dimension that gyro_model.symbols offers, by name.
CONSTANT_UNITS = {"BOLTZMANN": "J/K"}
EPS = sys.float_info.epsilon

every_effect = pytest.mark.parametrize("effect", MODEL.effects, ids=IDS)
switchable = pytest.mark.parametrize("effect", [e for e in MODEL.effects if not e.nominal], ids=lambda e: e.id)


@every_effect
def test_documents_itself(effect: Effect) -> None:
    assert re.search(r"[Ss]ource \d{3}|SYSTEM\.md|(19|20)\d\d", effect.doc), "the docstring names no source"
    assert effect.doc.strip().splitlines()[0].endswith("."), "the docstring begins with a sentence"
    assert effect.signature.strip()
    assert effect.host_experiment.strip()
    for limit in effect.limits:
        assert limit.why.strip()
    for quantity in effect.parameters:
        assert quantity.description.strip()
        assert quantity.role in ("size", "shape")


@every_effect
def test_limit_cases(effect: Effect) -> None:
    for limit in effect.limits:
        assert set(limit.at) <= set(used_symbols(effect)), "a limit case sets what no term uses"
        terms = evaluate(effect, at_limit(effect, limit.at))
        assert set(limit.gives) == set(terms), "a limit case leaves a term out"
        for name, value in limit.gives.items():
            # Worked out in decimals: a rounding of each operand and operation, of which no term has more than ten.
            assert float(terms[name]) == pytest.approx(value, rel=10 * EPS, abs=0.0), f"{limit.why}: {name}"


@every_effect
def test_limit_cases_exercise_every_size(effect: Effect) -> None:
    for quantity in effect.sizes:
        assert any(limit.at.get(quantity.name, quantity.start) != quantity.start for limit in effect.limits), (
            quantity.name
        )


@switchable
def test_neutral_size_leaves_everything_as_it_is(effect: Effect) -> None:
    rng = np.random.default_rng(1)
    for _ in range(50):
        point = neutral_point(effect, rng)
        wanted = {name: expr if expr.is_Number else point[expr.name] for name, expr in effect.neutral().items()}
        with np.errstate(all="ignore"):
            try:
                terms = {name: float(evaluate(effect, point)[name]) for name in wanted}
            except ZeroDivisionError:
                terms = {name: math.nan for name in wanted}
        for name, value in wanted.items():
            if math.isnan(terms[name]):
                # A term may divide by a neutral size of zero, where the C does not call it; it must tend to neutral.
                assert _distance(effect, point, name, value, 1e-9) <= 1e-9
            else:
                assert terms[name] == float(value), name


def _distance(effect: Effect, point: dict[str, float], name: str, wanted: float, size: float) -> float:
    near = point | {q.name: q.start + size for q in effect.sizes}
    return abs(float(evaluate(effect, near)[name]) - float(wanted))


@pytest.fixture
def with_constants_as_symbols(monkeypatch: pytest.MonkeyPatch):
    """Loads effects anew with the dimensional constants as symbols, so that they can be rescaled."""
    for name in CONSTANT_UNITS:
        assert isinstance(getattr(gyro_model.symbols, name), Float)
        monkeypatch.setattr(gyro_model.symbols, name, Symbol(name, positive=True))

    def load(effect: Effect) -> dict[str, Expr]:
        spec = importlib.util.spec_from_file_location(f"_rescaled_{effect.id}", EFFECTS_FOLDER / f"{effect.id}.py")
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        return module.EFFECT.terms()

    return load


def test_every_dimensional_constant_is_declared() -> None:
    numbers = {name for name, value in vars(gyro_model.symbols).items() if isinstance(value, Float)}
    assert numbers == set(CONSTANT_UNITS)


@every_effect
def test_no_numbers_hide_in_expressions(effect: Effect, with_constants_as_symbols) -> None:
    # The smallest normal double stands for "more than zero" in a denominator: it has no digits to be wrong.
    assert floats_in(with_constants_as_symbols(effect).values()) <= {sys.float_info.min}


@every_effect
def test_dimensions(effect: Effect, with_constants_as_symbols) -> None:
    rng = np.random.default_rng(2)
    terms = with_constants_as_symbols(effect)
    for _ in range(20):
        # Powers of four: even their square roots are exact, so a right dimension rescales to the last bit.
        powers = rng.permutation(np.arange(-3, 4))[:5]
        scale = dict(zip(("kg", "m", "s", "A", "K"), (4.0**power for power in powers), strict=True))
        point = random_point(effect, rng) | {name: 1.38e-23 for name in CONSTANT_UNITS}
        units = {name: CONSTANT_UNITS.get(name) or unit_of(name) for name in point}
        rescaled = {name: value * _factor(dimension(units[name]), scale) for name, value in point.items()}
        for name, expr in terms.items():
            factor = _factor(dimension_of_term(effect, name), scale)
            assert exactly(expr, rescaled) == exactly(expr, point) * factor, name


def _factor(of: Dimension, scale: dict[str, float]) -> float:
    return math.prod(scale[base] ** float(getattr(of, base)) for base in scale)


@pytest.mark.parametrize("effect", [e for e in MODEL.forces if e.energy is not None], ids=lambda e: e.id)
def test_power_balance(effect: Force) -> None:
    x, x_dot, y, y_dot = gyro_model.symbols.STATES
    terms, stored, dissipated = effect.terms(), effect.energy.stored, effect.energy.dissipated
    assert not {x_dot, y_dot} & stored.free_symbols, "what a force stores depends on positions and states of its own"
    rates = {x: x_dot, y: y_dot} | {state.symbol: state.rate for state in effect.states}
    stored_rate = sum(stored.diff(symbol) * rate for symbol, rate in rates.items())
    power = terms["force_x"] * x_dot + terms["force_y"] * y_dot
    if (power + stored_rate).has(Heaviside):
        # Algebra does not see through the corners of Max and Min; numbers on both sides of them do.
        _assert_balanced(effect, power, stored_rate, dissipated)
    else:
        assert simplify(power + stored_rate + dissipated) == 0


def _assert_balanced(effect: Force, *powers: Expr) -> None:
    rng = np.random.default_rng(7)
    sizes = []
    for _ in range(300):
        point = random_point(effect, rng)
        point |= {name: rng.uniform(0, 2) * value for name, value in point.items() if name in ("x", "y")}
        values = [exactly(power, point) for power in powers]
        sizes.append(max(map(abs, values)))
        # Each is a sum of four products of ten roundings; a depth is the difference of lengths ten times as large.
        assert abs(sum(values)) <= 400 * EPS * sizes[-1]
    assert 0 < sum(size == 0 for size in sizes) < len(sizes), "the points lie on one side of the corner"


@pytest.mark.parametrize("effect", [e for e in MODEL.forces if e.energy is not None], ids=lambda e: e.id)
def test_dissipation_is_never_negative(effect: Force) -> None:
    rng = np.random.default_rng(3)
    for _ in range(200):
        point = random_point(effect, rng)
        # A passive damping matrix, up to the very border; sizes and shapes of the random point are positive already.
        if {"dxx", "dyy", "dxy"} <= set(point):
            point["dxy"] = float(rng.uniform(-1, 1) * math.sqrt(point["dxx"] * point["dyy"]))
        assert exactly(effect.energy.dissipated, point) >= 0.0


@every_effect
def test_noise_flag(effect: Effect) -> None:
    normals = set(make_symbols("normal_x normal_y pink_x pink_y", real=True))
    draws = bool(normals & effect.symbols)
    rounds = isinstance(effect, Map) and effect.slot == "sampled round"
    assert effect.noise == (draws or rounds)
    if isinstance(effect, Force) and draws:
        assert effect.energy is None, "a random force exchanges energy with the outside"


@every_effect
def test_laws_keep_damping_passive(effect: Effect) -> None:
    if not isinstance(effect, Law):
        return
    rng = np.random.default_rng(4)
    for _ in range(50):
        point = random_point(effect, rng)
        new = point | {name: float(value) for name, value in evaluate(effect, point).items()}
        if {"dxx", "dyy", "dxy"} <= set(new) and point["dxy"] ** 2 <= point["dxx"] * point["dyy"]:
            # Rounding of four products at the border itself.
            assert new["dxy"] ** 2 <= new["dxx"] * new["dyy"] * (1 + 4 * EPS)
