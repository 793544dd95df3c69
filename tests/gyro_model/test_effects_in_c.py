"""The C function of every effect against its limit cases and against the Python evaluation of the same expression."""

import sys
from collections.abc import Callable

import numpy as np
import pytest
from effect_library import EffectLibrary
from sympy import Max, Min, Rational, Symbol, sqrt

from gyro_model.anatomy import Effect, Limit, Map
from gyro_model.c_printing import c_expression
from gyro_model.effect_points import IDS, MODEL, at_limit, condition, random_point
from gyro_model.evaluate import evaluate
from gyro_model.model import Model
from gyro_model.quantities import size
from gyro_model.symbols import nearest_integer, v_x, v_y

EPS = sys.float_info.epsilon
Residual = Callable[[str, float, float], None]
every_effect = pytest.mark.parametrize("effect", MODEL.effects, ids=IDS)


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> EffectLibrary:
    return EffectLibrary(MODEL, tmp_path_factory.mktemp("effects"))


@every_effect
def test_limit_cases(effect: Effect, library: EffectLibrary) -> None:
    for limit in effect.limits:
        terms = library.evaluate(effect, at_limit(effect, limit.at))
        for name, value in limit.gives.items():
            # Worked out in decimals: a rounding of each operand and operation, of which no term has more than ten.
            assert terms[name] == pytest.approx(value, rel=10 * EPS, abs=0.0), f"{limit.why}: {name}"


@every_effect
def test_c_equals_python(effect: Effect, library: EffectLibrary, residual: Residual) -> None:
    rng = np.random.default_rng(5)
    worst = 0.0
    for _ in range(100):
        point = random_point(effect, rng)
        scale, wanted = condition(effect, point), evaluate(effect, point)
        for name, value in library.evaluate(effect, point).items():
            worst = max(worst, abs(value - float(wanted[name])) / (EPS * scale[name] + sys.float_info.min))
    # Both round each operation by half a unit, in another order; the condition counts most operations more than once.
    residual("units in the last place, over the condition of the term", worst, 2.0)


a, b, c = (Symbol(name, real=True) for name in "abc")

# Forms whose C needs care: powers below the line, signs, half powers, several arguments, whole-number division.
FORMS = {
    "one power below": a / b**2,
    "two powers below": a / (b**2 * c**3),
    "a sum squared below": -a / (b + 1) ** 2,
    "inverse square": b**-2,
    "negative inverse square": -(b**-2),
    "sign before a power": -(a**2) + (-b) ** 3,
    "ratio of squares": (a + b) ** 2 / c**2 - (a / b) ** 4,
    "fraction": Rational(1, 3) * a + Rational(2, 7) * b / c**2,
    "half powers": sqrt(a**2 + b**2) ** 3 / sqrt(c) + c ** Rational(3, 2),
    "several arguments": Max(a, b, c) - Min(a, b, -c, 0),
    "rounding": nearest_integer(a / b) * b,
    "a sum in a sum": (a / b**2 + 1) / (c**2 + 1) ** 2,
}


@pytest.fixture(scope="module")
def forms(tmp_path_factory: pytest.TempPathFactory) -> EffectLibrary:
    parameters = tuple(size(name, "1", "any") for name in "abc")
    limit = Limit(why="none", at={}, gives={})
    effects = [
        Map(
            id=f"form_{index}",
            parameters=parameters if index == 0 else (size(f"size_{index}", "1", "unused"),),
            slot="amplifier offset",
            output=(form, v_x * 0 + v_y * 0),
            signature="",
            host_experiment="",
            limits=(limit,),
            doc="A form.",
        )
        for index, form in enumerate(FORMS.values())
    ]
    return EffectLibrary(Model((*MODEL.effects, *effects)), tmp_path_factory.mktemp("forms"))


@pytest.mark.parametrize("form", FORMS)
def test_printed_forms(form: str, forms: EffectLibrary) -> None:
    effect = forms.model.effect(f"form_{list(FORMS).index(form)}")
    rng = np.random.default_rng(6)
    for _ in range(50):
        point = dict(zip("abc", rng.uniform(0.5, 2.0, 3), strict=True))
        wanted, scale = float(evaluate(effect, point)["v_x"]), condition(effect, point)["v_x"]
        # As above; a jump of the rounding between the two is too rare to meet (1e-16 a point).
        assert abs(forms.evaluate(effect, point)["v_x"] - wanted) <= 2 * EPS * scale, c_expression(FORMS[form])
