"""The effects are those of the product's specification: ids, parameters, neutral values and defaults of its tables."""

import re
from pathlib import Path
from typing import NamedTuple

import pytest

from gyro_model.effect_points import MODEL
from gyro_model.quantities import Quantity

BESIDE = Path(__file__).parents[3] / "shared"
"""A folder beside the checkout, where a page with the tables of sections 8 and 11 may lie."""


class Named(NamedTuple):
    """A parameter as the table names it; ``start`` is None where the table leaves it to the rule (0, or another
    effect's)."""

    name: str
    role: str
    start: float | None


def table() -> dict[str, list[Named]]:
    """Parameters by effect id, from the table of section 8."""
    return {row[0].split()[0]: parameters(row[2]) for row in rows("## 8.", "## 9.")}


def more() -> dict[str, str]:
    """The cell of the parameters by effect id, from the table of section 11, of which some rows hold several."""
    listed = rows("## 11.", "Record defects")
    return {effect_id: row[2] for row in listed for effect_id in row[0].replace("†", "").replace(",", "").split()}


def rows(begin: str, end: str) -> list[list[str]]:
    """The cells of the table between two headings."""
    pages = [page.read_text(encoding="utf-8") for page in BESIDE.glob("*.md")]
    section = next((page.partition(begin)[2].partition(end)[0] for page in pages if f"\n{begin}" in page), None)
    if section is None:
        pytest.skip("the specification is not beside this checkout")
    lines = [line for line in section.splitlines() if line[:1] == "|"]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines[2:]]


def parameters(cell: str) -> list[Named]:
    """``k3_x, k3_y [N/m³]``, ``angular_gain λ [1] neutral 1`` and ``(t_ref [K] 298.15)`` as parameters."""
    found: list[Named] = []
    shapes = cell.find(", (") if ", (" in cell else len(cell)
    for match in re.finditer(r"(?<![\w/.·])([a-z]\w+|_y)\b([^,\[]*)(\[[^\]]*\])?([^,]*)", cell):
        name = match[1] if match[1] != "_y" else found[-1].name.removesuffix("_x") + "_y"
        shape = match.start() > shapes
        number = re.search(r"-?\d+(\.\d+)?(e[+-]?\d+)?", match[4])
        found.append(Named(name, "shape" if shape else "size", float(number[0]) if number else None if shape else 0.0))
    return found


def test_the_parser_reads_the_table() -> None:
    assert parameters("k3_x, k3_y [N/m³]") == [Named("k3_x", "size", 0.0), Named("k3_y", "size", 0.0)]
    assert parameters("angular_gain λ [1] neutral 1") == [Named("angular_gain", "size", 1.0)]
    assert parameters("tck, tck_split [1/K], (t_ref [K] 298.15)")[2] == Named("t_ref", "shape", 298.15)
    assert parameters("acceleration_gain_x, _y [1]")[1] == Named("acceleration_gain_y", "size", 0.0)


def test_every_effect_of_the_table_is_there_and_no_other() -> None:
    ids = {effect.id for effect in MODEL.effects if not effect.nominal}
    assert set(table()) <= ids <= {*table(), *more()}


def test_parameters_are_those_of_the_table() -> None:
    wanted = {effect_id: named for effect_id, named in table().items()}
    for effect_id, named in wanted.items():
        # Where a run begins is no property of the effect; a shape that is off by default may extend it.
        listed = {n.name for n in named}
        own = {q.name: q for q in MODEL.effect(effect_id).parameters if q.name in listed or not _extends(q)}
        assert [n.name for n in named] == list(own), effect_id
        for name, role, start in named:
            assert own[name].role == role, name
            assert start is None or own[name].start == start, name


def _extends(q: Quantity) -> bool:
    off = q.role == "shape" and q.start == 0.0 and (q.search is None or not q.search.tried)
    return q.role == "start" or off


def test_further_parameters_are_those_of_the_table() -> None:
    for effect_id, cell in more().items():
        for quantity in (q for e in MODEL.effects if e.id == effect_id for q in e.parameters):
            named = re.search(rf"\b{quantity.name}\b", cell)
            # Shapes may be there in words or by a Greek letter.
            assert named or quantity.role == "shape", quantity.name
            if named:
                before = cell[: named.start()]
                assert (before.count("(") > before.count(")")) == (quantity.role == "shape"), quantity.name
