"""What every effect must fulfil, on its own expressions. A new effect file is covered as soon as it is there."""

import importlib.util
import re
import sys

import numpy as np
import pytest
from sympy import Expr, Float, Symbol
from sympy import symbols as make_symbols

import gyro_model.symbols
from gyro_model import contract
from gyro_model.anatomy import Effect, Force, Law, Map
from gyro_model.effect_points import (
    IDS,
    MODEL,
    floats_in,
    random_point,
)
from gyro_model.evaluate import evaluate
from gyro_model.model import EFFECTS_FOLDER

# The numbers with a dimension that gyro_model.symbols offers, by name.
CONSTANT_UNITS = {"BOLTZMANN": "J/K"}
EPS = sys.float_info.epsilon

every_effect = pytest.mark.parametrize("effect", MODEL.effects, ids=IDS)
switchable = pytest.mark.parametrize("effect", [e for e in MODEL.effects if not e.nominal], ids=lambda e: e.id)


@every_effect
def test_documents_itself(effect: Effect) -> None:
    assert re.search(r"\b(TW|CN) \d{9}|\b(19|20)\d\d\b|\bmodel\b", effect.doc), (
        "neither a document nor what is modelled"
    )
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
    contract.limit_cases(effect, MODEL)


@switchable
def test_neutral_size_leaves_everything_as_it_is(effect: Effect) -> None:
    contract.neutral_size(effect, MODEL)


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
    contract.dimensions(effect, MODEL, with_constants_as_symbols(effect))


@pytest.mark.parametrize("effect", [e for e in MODEL.forces if e.energy is not None], ids=lambda e: e.id)
def test_energy(effect: Force) -> None:
    contract.energy(effect, MODEL)


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
