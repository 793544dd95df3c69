"""What every effect must fulfil, on its own expressions. A new effect file is covered as soon as it is there."""

import re
import sys
from pathlib import Path

import pytest
from sympy import Float

import gyro_model.symbols
from gyro_model import contract
from gyro_model.anatomy import Effect
from gyro_model.effect_points import (
    IDS,
    MODEL,
    floats_in,
)
from gyro_model.model import EFFECTS_FOLDER

every_effect = pytest.mark.parametrize("effect", MODEL.effects, ids=IDS)


def file_of(effect: Effect) -> Path:
    return EFFECTS_FOLDER / f"{effect.id}.py"


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
        assert quantity.role in ("size", "shape", "start")


def test_every_dimensional_constant_is_declared() -> None:
    numbers = {name for name, value in vars(gyro_model.symbols).items() if isinstance(value, Float)}
    assert numbers == set(contract.CONSTANT_UNITS)


@every_effect
def test_no_numbers_hide_in_expressions(effect: Effect) -> None:
    terms = contract.terms_with_constants(file_of(effect))
    # The smallest normal double stands for "more than zero" in a denominator: it has no digits to be wrong.
    assert floats_in(terms.values()) <= {sys.float_info.min}


@every_effect
def test_it_passes_the_contract_of_a_user_s_own(effect: Effect) -> None:
    contract.check_effect(effect, MODEL, file_of(effect))
