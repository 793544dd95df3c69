"""Imports run one way: gyro_model <- cosim <- (discrepancy, calibration) <- gyrotwin, and from room to room within
discrepancy: data <- fit <- defects <- terms <- name <- discover <- tell."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
FLOORS = (("gyro_model",), ("cosim",), ("discrepancy", "calibration"), ("gyrotwin",))
ALL = [package for floor in FLOORS for package in floor]
FILES = [path for package in ALL for path in sorted((ROOT / package).rglob("*.py"))]


def imported(path: Path) -> set[str]:
    """The first name of every module that a file imports, at any depth of its code."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names |= {alias.name.partition(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            names.add(node.module.partition(".")[0])
    return names


def test_there_is_something_to_check() -> None:
    assert set(ALL) <= {path.relative_to(ROOT).parts[0] for path in FILES}


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_a_file_imports_only_its_own_package_and_those_below(path: Path) -> None:
    package = path.relative_to(ROOT).parts[0]
    floor = next(k for k, packages in enumerate(FLOORS) if package in packages)
    below = {name for packages in FLOORS[:floor] for name in packages}
    assert imported(path) & set(ALL) <= {package} | below


ROOMS = ("data", "fit", "defects", "terms", "name", "discover", "tell")
ROOM_FILES = [path for room in ROOMS for path in sorted((ROOT / "discrepancy" / room).rglob("*.py"))]


@pytest.mark.parametrize("path", ROOM_FILES, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_a_room_of_the_diagnosis_imports_only_from_rooms_before(path: Path) -> None:
    own = ROOMS.index(path.relative_to(ROOT / "discrepancy").parts[0])
    tree = ast.walk(ast.parse(path.read_text(encoding="utf-8")))
    modules = [node.module for node in tree if isinstance(node, ast.ImportFrom) and node.module]
    seen = {module.split(".")[1] for module in modules if module.startswith("discrepancy.")}
    assert not seen & {*ROOMS[own + 1 :], "diagnose"}
