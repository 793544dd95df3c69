"""What the site says works: its effect passes the contract, its plans give points, its Python compiles."""

import ast
import re
import tomllib
from pathlib import Path

import pytest

from gyro_model.errors import InputError
from gyrotwin import contract
from gyrotwin.sweeping.plan import load_plan

DOCS = Path(__file__).parents[2] / "docs"
PAGES = sorted(DOCS.rglob("*.md"))


def blocks(page: Path, language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", page.read_text(encoding="utf-8"), re.S)


def test_the_effect_of_the_how_to_passes_the_contract(tmp_path: Path) -> None:
    (tmp_path / "own_spring.py").write_text(blocks(DOCS / "howto" / "effect.md", "python")[0])
    assert contract.check(tmp_path) == [f"effect own_spring: {len(contract.CHECKS)} checks passed"]


def test_the_observer_of_the_how_to_passes_the_contract(tmp_path: Path) -> None:
    text = blocks(DOCS / "howto" / "observer.md", "python")[0]
    mine = tmp_path / "mine.py"
    mine.write_text(text)
    assert contract.check(mine) == ["observer mine: built, compiled and run for 20 ms"]
    # A mistake in it is said in one line, where it begins and where it steps.
    for old, new in (("start[:12]", "start"), ("estimate[:12] =", "estimate[:] =")):
        assert old in text
        mine.write_text(text.replace(old, new))
        with pytest.raises(InputError, match="observer fixed: ValueError"):
            contract.check(mine)


@pytest.mark.parametrize("page", ["guides/designer.md", "howto/sweep.md"])
def test_plans_give_points(page: str, tmp_path: Path) -> None:
    for text in blocks(DOCS / page, "toml"):
        assert load_plan(tomllib.loads(text)).points()


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(DOCS).as_posix())
def test_python_on_a_page_compiles(page: Path) -> None:
    for text in blocks(page, "python"):
        ast.parse(text)


def test_every_dependency_has_its_licence_on_the_page() -> None:
    project = tomllib.loads((DOCS.parent / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    needed = [*project["dependencies"], *(d for name, extra in project["optional-dependencies"].items()
              if name != "importers" for d in extra)]  # fmt: skip
    page = (DOCS / "reference" / "licences.md").read_text(encoding="utf-8")
    listed = dict(re.findall(r"^\| ([\w.-]+) \| \w* \| (.+?) \|$", page, re.M))
    for dependency in needed:
        name = re.match(r"[\w.-]+", dependency)
        assert name is not None
        assert listed.get(name.group(), "?") != "?", dependency
