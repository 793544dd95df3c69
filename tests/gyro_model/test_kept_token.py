"""Tests of the token that is kept on disk: it is that of the model or not there."""

import os
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from pathlib import Path

import pytest
from sympy import Function, Symbol

from gyro_model import build as building
from gyro_model import kept_token
from gyro_model.anatomy import Force
from gyro_model.build import forms, made_token, model_token
from gyro_model.model import Model, load_model

MODEL = load_model()
NAME = "cubic_stiffness"
_EFFECT = MODEL.effect(NAME)
assert isinstance(_EFFECT, Force)
EFFECT: Force = _EFFECT


class MyForce(Force):
    """An effect of a class of its own, which may do anything."""


class bump(Function):
    """A function that prints itself as it likes."""


class Text(str):
    """Text that may print otherwise than it is written."""


def holding(effect: Force) -> Model:
    return Model(tuple(effect if e.id == effect.id else e for e in MODEL.effects))


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where the tokens are kept in this test alone."""
    monkeypatch.setattr(kept_token.platformdirs, "user_cache_dir", lambda _: str(tmp_path))
    return tmp_path / "tokens"


@pytest.fixture
def makings(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The models whose token is made."""
    made: list[str] = []
    make = building.made_token
    monkeypatch.setattr(building, "made_token", lambda model: made.append(model.NAME) or make(model))
    return made


def test_a_token_is_made_once_and_is_that_which_is_made(folder: Path, makings: list[str]) -> None:
    for form in forms(MODEL):
        assert model_token(form) == model_token(form) == made_token(form)
    assert makings == [form.NAME for form in forms(MODEL)]
    assert len(list(folder.iterdir())) == len(makings)


@pytest.mark.parametrize(
    "damage",
    [
        lambda path: path.write_bytes(b""),
        lambda path: path.write_bytes(path.read_bytes()[:-9]),
        lambda path: path.write_bytes(path.read_bytes() * 2),
        lambda path: path.write_bytes(b"\xff" + path.read_bytes()),
        lambda path: path.write_bytes(path.read_bytes().translate(bytes.maketrans(b"01", b"10"))),
        lambda path: path.write_text("{12345678-1234-1234-1234-123456789abc}\n"),
        lambda path: (path.unlink(), path.mkdir()),
    ],
)
def test_a_damaged_or_foreign_file_is_no_token(
    folder: Path, makings: list[str], damage: Callable[[Path], object]
) -> None:
    token = model_token(MODEL)
    (file,) = folder.iterdir()
    damage(file)
    assert model_token(MODEL) == token
    assert len(makings) == 2


def test_a_file_of_another_key_is_no_token(folder: Path) -> None:
    kept_token.keep("one", model_token(MODEL))
    (folder / "one").rename(folder / "other")
    assert kept_token.kept("other") is None


def test_a_wrong_token_lasts_until_it_is_made(folder: Path) -> None:
    token = model_token(MODEL)
    (file,) = folder.iterdir()
    wrong = "{12345678-1234-1234-1234-123456789abc}"
    kept_token.keep(file.name, wrong)
    assert model_token(MODEL) == wrong
    assert f'"{token}"' in building.generated_files(MODEL)["generated/model.c"], "what is generated asks no file"
    assert model_token(MODEL) == token


def test_without_a_cache_it_is_made(folder: Path, makings: list[str]) -> None:
    folder.write_text("a file in the place of the folder")
    assert model_token(MODEL) == model_token(MODEL)
    assert len(makings) == 2


def test_whatever_is_generated_from_has_a_key_of_its_own(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    k3 = EFFECT.parameters[0]
    positive = {symbol: Symbol(symbol.name, positive=True) for symbol in EFFECT.symbols}
    models = [
        *forms(MODEL),
        Model(MODEL.effects[:-1]),
        holding(replace(EFFECT, doc="another text")),
        holding(replace(EFFECT, parameters=(replace(k3, high=1e15), *EFFECT.parameters[1:]))),
        holding(replace(EFFECT, force=(2 * EFFECT.force[0], EFFECT.force[1]))),
        holding(replace(EFFECT, force=(EFFECT.force[0].xreplace(positive), EFFECT.force[1]))),
    ]
    keys = [building._token_key(model) for model in models]
    for name, value in (("_CODE", "another"), ("_UNDER", ("another",))):
        with monkeypatch.context() as context:
            context.setattr(kept_token, name, value)
            keys.append(building._token_key(MODEL))
    with monkeypatch.context() as context:
        context.setattr(building.generate_package, "finished_files", lambda _: {"license.txt": b"another"})
        keys.append(building._token_key(MODEL))
    assert None not in keys
    assert len(set(keys)) == len(keys) == len(models) + 3


def test_what_its_fields_do_not_state_is_not_kept(folder: Path, makings: list[str]) -> None:
    own = MyForce(**{field.name: getattr(EFFECT, field.name) for field in fields(EFFECT)})
    bent = replace(EFFECT, force=(bump(EFFECT.force[0]), EFFECT.force[1]))
    for effect in (own, bent, replace(EFFECT, doc=Text("a text of a class of its own"))):
        assert building._token_key(holding(effect)) is None
    model = holding(own)
    assert model_token(model) == model_token(model) == made_token(model)
    assert makings == [model.NAME] * 2
    assert not folder.exists()


def test_the_model_of_one_device_is_not_kept(folder: Path) -> None:
    started = MODEL.starting_at({"m": 3e-7})
    assert building._token_key(started) is None
    assert model_token(started) == made_token(started) != made_token(MODEL)


def test_a_form_of_ones_own_is_not_kept() -> None:
    @dataclass(frozen=True, eq=False)
    class Own(Model):
        LAYERS = ("device",)

    assert building._token_key(Own(MODEL.effects)) is None


def test_the_same_key_in_another_process() -> None:
    program = "from gyro_model import build, model; print(build._token_key(model.load_model()))"
    for seed in ("1", "2"):
        environment = {**os.environ, "PYTHONHASHSEED": seed}
        found = subprocess.run([sys.executable, "-c", program], env=environment, capture_output=True, text=True)
        assert found.stdout.strip() == building._token_key(MODEL)
