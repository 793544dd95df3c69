"""Thresholds: one checked record, settable from a file, each with its reason."""

import inspect
from dataclasses import fields
from pathlib import Path

import pytest

from discrepancy import criteria
from discrepancy.criteria import BOUNDS, Criteria, load_criteria
from gyro_model.errors import InputError


def test_every_threshold_has_bounds_and_a_reason() -> None:
    names = [field.name for field in fields(Criteria)]
    assert set(BOUNDS) == set(names)
    source = inspect.getsource(criteria)
    for name in names:
        line = source.index(f"    {name}: float =")
        after = source[line:].split("\n", 2)[1]
        assert after.strip().startswith('"""'), f"{name} has no reason below it"


def test_a_file_sets_them(tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text("left = 0.1\neffect_chance = 1e-4\n")
    found = load_criteria(tmp_path / "mine.toml")
    assert (found.left, found.effect_chance, found.even) == (0.1, 1e-4, Criteria().even)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("lefd = 0.1", "did you mean 'left'"),
        ("left = 2", "from 0 to 1"),
        ('left = "much"', "give a number"),
        ("left = nan", "give a number"),
        ("left = ", "TOML"),
    ],
)
def test_a_wrong_one_is_one_line(tmp_path: Path, text: str, expected: str) -> None:
    (tmp_path / "mine.toml").write_text(text)
    with pytest.raises(InputError, match=expected):
        load_criteria(tmp_path / "mine.toml")
