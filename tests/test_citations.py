"""What the repository cites is in the repository, or published: no document that only its writer has, no page or
equation that is not there."""

import re
import subprocess
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PAGES = sorted((ROOT / "docs" / "theory").glob("*.md"))
PRIVATE = re.compile(r"SYSTEM\.md|\bsources? 00\d\b", re.I)
READERS = {"tests/gyro_model/test_specification.py", "tests/test_citations.py"}
"""May name what others may not: the first reads the specification where there is one."""
CITED = re.compile(r"docs/theory/([\w.-]+\.md)(?:#([\w-]+))?((?:,? \(?eqs?\.\s*\d+(?:(?:-|, | and )\d+)*)?)")
LINKED = re.compile(r"\[[^\]]+\]\((?:\w+/)*([\w.-]+\.md)(?:#([\w-]+))?\)((?:, eqs?\. \d+(?:(?:-|, | and )\d+)*)?)")


def tracked() -> list[str]:
    """Text files under version control."""
    if not (ROOT / ".git").exists():
        pytest.skip("this is no checkout")
    listed = subprocess.run(["git", "grep", "-I", "--name-only", ""], cwd=ROOT, check=True, capture_output=True)
    return listed.stdout.decode().splitlines()


@cache
def anchors(page: Path) -> frozenset[str]:
    """Headings and equations of a page, as its site names them."""
    text = page.read_text(encoding="utf-8")
    headings = re.findall(r"^#+ (.+)$", text, re.M)
    slugs = {re.sub(r"[\s-]+", "-", re.sub(r"[^\w\s-]", "", h).strip().lower()) for h in headings}
    return frozenset(slugs | set(re.findall(r'<a id="([\w-]+)"></a>', text)))


def equations(numbers: str) -> list[int]:
    """The numbers in ``, eqs. 1-3 and 5``."""
    spans = re.findall(r"(\d+)(?:-(\d+))?", numbers)
    return [n for first, last in spans for n in range(int(first), int(last or first) + 1)]


def missing(page: Path, anchor: str, numbers: str) -> list[str]:
    """What a citation names that is not on ``page``."""
    if not page.is_file():
        return [page.name]
    wanted = [*([anchor] if anchor else []), *(f"eq-{n}" for n in equations(numbers))]
    return [f"{page.name}#{name}" for name in wanted if name not in anchors(page)]


def test_nothing_private_is_cited() -> None:
    for name in set(tracked()) - READERS:
        for number, text in enumerate((ROOT / name).read_text(encoding="utf-8").splitlines(), 1):
            assert not PRIVATE.search(text), f"{name}:{number}: cite a page of docs/theory or a published document"


def test_cited_pages_and_equations_are_there() -> None:
    for name in set(tracked()) - READERS:
        for page, anchor, numbers in CITED.findall((ROOT / name).read_text(encoding="utf-8")):
            assert not missing(ROOT / "docs" / "theory" / page, anchor, numbers), f"{name} cites {page}{numbers}"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_pages_cite_equations_that_are_there(page: Path) -> None:
    for other, anchor, numbers in LINKED.findall(page.read_text(encoding="utf-8")):
        if (page.parent / other).is_file():
            assert not missing(page.parent / other, anchor, numbers), f"{page.name} cites {other}{numbers}"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_equations_are_numbered_from_one_each_with_its_anchor(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    numbers = [int(n) for n in re.findall(r"^    .* {3,}\((\d+)\)$", text, re.M)]
    assert numbers == list(range(1, len(numbers) + 1))
    assert re.findall(r'<a id="eq-(\d+)"></a>', text) == [str(n) for n in numbers]


def test_the_tests_see_what_is_wrong() -> None:
    plant = ROOT / "docs" / "theory" / "plant.md"
    assert CITED.findall("(docs/theory/plant.md, eqs. 1 and 99)") == [("plant.md", "", ", eqs. 1 and 99")]
    assert missing(plant, "", ", eqs. 1 and 99") == ["plant.md#eq-99"]
    assert missing(plant, "motion", ", eq. 2") == []
    assert missing(plant.with_name("none.md"), "", "") == ["none.md"]
