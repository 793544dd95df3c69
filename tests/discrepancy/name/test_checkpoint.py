"""Received folders: a checkpoint is data, whatever is written into it; formulas have a grammar of their own."""

import copy
import json
import random
import shutil
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hidden_sets import MODEL, SHORT, made
from sympy import Abs

from discrepancy import diagnose as naming
from discrepancy.data.dataset import Dataset
from discrepancy.diagnose import diagnose
from discrepancy.discover.term_search import TermSearch
from discrepancy.fit.simulate import Simulator
from discrepancy.name.accepted import Dropped
from discrepancy.name.begin import begin, resume
from discrepancy.name.checkpoint import digest, load, terms_from, terms_state
from discrepancy.name.checkpoint_schema import checked
from discrepancy.name.kept import saved
from discrepancy.name.look import look
from discrepancy.name.search import Given
from discrepancy.terms.effect_file import UNITS, Term
from discrepancy.terms.formula import parse
from discrepancy.terms.library import SIGNALS, forms
from gyro_model import symbols
from gyro_model.errors import InputError

NAMES = {s.name: s for s in SIGNALS}
CODE = "__import__('pathlib').Path('{canary}').write_text('executed')"


class Stop(Exception):
    """Ends a diagnosis at a known point."""


@pytest.fixture(scope="module")
def honest(tmp_path_factory: pytest.TempPathFactory) -> Iterator[SimpleNamespace]:
    """A data set, and what a search of it has kept when it was interrupted."""
    file = tmp_path_factory.mktemp("honest") / "search.checkpoint"
    data = made({"feedthrough": 8.0}, samples=SHORT)

    def interrupt(line: str) -> None:
        if line.startswith("terms against"):
            raise Stop

    with pytest.raises(Stop):
        further = TermSearch(file.parent / "terms", interrupt)
        diagnose(data, MODEL, progress=interrupt, checkpoint=file, further=further)
    yield SimpleNamespace(data=data, content=json.loads(file.read_text()))


def term(number: int = 1) -> dict[str, Any]:
    form = next(form for form in forms(2) if form.parts[0][0] == symbols.x**5)
    [[state]] = terms_state([[Term(type(form)(f"discovered_{number}", form.parts), dict.fromkeys(UNITS, 1e-6))]])
    return dict(state)


def places(value: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Every entry of nested tables and lists, by its path."""
    inner = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    return [path, *(p for key, entry in inner for p in places(entry, (*path, key)))]


def put(state: dict[str, Any], path: tuple[Any, ...], value: Any) -> None:
    target: Any = state
    for key in path[:-1]:
        target = target[key]
    target[path[-1]] = value


def foreign_entry(state: dict[str, Any], rng: random.Random, code: str) -> None:
    """Some entry is of another kind, far too large, or code."""
    path = rng.choice([p for p in places(state) if p and p[0] not in ("terms", "clip")])
    put(state, path, rng.choice([code, {"__class__": code}, [[[]]], float("nan"), 10**400, -1e308, True, "../escaped"]))


def foreign_key(state: dict[str, Any], rng: random.Random, code: str) -> None:
    """A table has an entry that no search writes."""
    path = rng.choice([p for p in places(state) if isinstance(_at(state, p), dict)])
    put(state, (*path, rng.choice(["__init__", "../../escaped", code, "probes ", ""])), 1.0)


def lost_entry(state: dict[str, Any], rng: random.Random, code: str) -> None:
    """An entry is not there."""
    path = rng.choice([(), ("at",), ("refitted",), ("accepted", 0, 0), ("at", "setting")])
    table = _at(state, path)
    table.pop(rng.choice(sorted(table)))


def escaping_term(state: dict[str, Any], rng: random.Random, code: str) -> None:
    """A term whose name leads out of the folder, or is code."""
    name = rng.choice(["../escaped", "/tmp/escaped", "discovered_1/../../x", "discovered_1.py", "discovered_0",
                       "discovered_1\n", "__init__", "conftest", code, ""])  # fmt: skip
    state["terms"] = [[{**term(), "id": name}]]


def code_in_formula(state: dict[str, Any], rng: random.Random, code: str) -> None:
    """A formula that is none."""
    text = rng.choice([code, "x.__class__", "lambda: 0", "x**x", "x**99999999", "(" * 5000 + "x" + ")" * 5000,
                       "x +", "exec('1')", "Abs(Abs(x))", "x*" * 10000 + "x", "é*x", "1e999*x", "x;y", "2000*x",
                       "m*x"])  # fmt: skip
    state["terms"] = [[{**term(), "parts": [[text, "0"]]}]]


def foreign_term(state: dict[str, Any], rng: random.Random, code: str) -> None:
    """A term in right grammar that the library does not have, or seen where nothing can be."""
    wrong = rng.choice([{"parts": [["x**7", "0"]]}, {"parts": [["x**5", "x**5"]]}, {"parts": []}, {"peaks": {}},
                        {"peaks": dict.fromkeys(UNITS, float("inf"))}, {"parts": [["x**5", "0"], ["x**5", "0"]]},
                        {"text": code}])  # fmt: skip
    state["terms"] = [[{**term(), **wrong}]]


def other_fit(state: dict[str, Any], rng: random.Random, code: str) -> None:
    """A fit that is none of these runs, in values that each may stand."""
    wrong = rng.choice([{"kxx": 1e300}, {"kxx": 1e-300}, {"m": 1e-30}, {"k3_x": 1e200}, {"feedthrough": 1e300}])
    state["at"]["parameters"] |= wrong


HOSTILE: list[Callable[[dict[str, Any], random.Random, str], None]] = [
    foreign_entry, foreign_key, lost_entry, escaping_term, code_in_formula, foreign_term, other_fit]  # fmt: skip
RAW = ["[" * 200_000, '{"a":' * 50_000, "9" * 10_000, "\x00\x01", "null", "[]", '{"format": 3}', "import os"]


def _at(state: Any, path: tuple[Any, ...]) -> Any:
    for key in path:
        state = state[key]
    return state


def hostile(number: int, honest: dict[str, Any], canary: Path) -> str:
    """The text of a checkpoint that no search has written."""
    if number < len(RAW):
        return RAW[number]
    content = copy.deepcopy(honest)
    HOSTILE[number % len(HOSTILE)](content["state"], random.Random(number), CODE.format(canary=canary))
    return json.dumps(content)


def test_the_honest_one_is_taken_up(honest: SimpleNamespace, tmp_path: Path) -> None:
    file = tmp_path / "search.checkpoint"
    file.write_text(json.dumps(honest.content))
    kept = load(file, honest.content["key"], honest.data, MODEL)
    assert kept is not None
    assert [entry[0]["effect"] for entry in kept["accepted"]] == ["drive_feedthrough"]


def test_200_hostile_folders(honest: SimpleNamespace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def stop(*_: Any) -> None:
        raise Stop

    monkeypatch.setattr(naming, "begin", stop)
    monkeypatch.setattr(naming, "finish", stop)
    taken = 0
    for number in range(200):
        folder = tmp_path / f"{number}" / "out"
        folder.mkdir(parents=True)
        (folder / "search.checkpoint").write_text(hostile(number, honest.content, tmp_path / "canary"))
        lines: list[str] = []
        # It is said and the search starts anew, or it is data all the same; no other error, and nothing is written.
        with pytest.raises(Stop):
            diagnose(honest.data, MODEL, jobs=1, progress=lines.append, checkpoint=folder / "search.checkpoint",
                     further=TermSearch(folder / "terms"))  # fmt: skip
        refused = [line for line in lines if "is not used" in line]
        taken += any(line.startswith("resumed with") for line in lines)
        assert all("\n" not in line and len(line) < 500 for line in refused)
        left = {path.relative_to(tmp_path / f"{number}").as_posix() for path in (tmp_path / f"{number}").rglob("*")}
        assert left <= {"out", "out/search.checkpoint"}, (number, left)
        shutil.rmtree(tmp_path / f"{number}")
    assert list(tmp_path.iterdir()) == []
    # A number in place of another one, in what the page shows of the steps, is no harm that data could not do.
    assert taken < 20


def test_a_link_under_the_name_of_the_part_is_not_followed(honest: SimpleNamespace, tmp_path: Path) -> None:
    victim, file = tmp_path / "victim", tmp_path / "out" / "search.checkpoint"
    victim.write_text("mine")
    file.parent.mkdir()
    file.with_name(file.name + ".part").symlink_to(victim)
    file.symlink_to(victim)

    def interrupt(line: str) -> None:
        if line.startswith("terms against"):
            raise Stop

    with pytest.raises(Stop):
        diagnose(honest.data, MODEL, checkpoint=file, further=TermSearch(tmp_path / "terms", interrupt))
    assert victim.read_text() == "mine"


def test_a_formula_is_a_product_of_the_library() -> None:
    x, y = symbols.x, symbols.y
    assert parse("-2*x**2*Abs(y)", NAMES) == -2 * x**2 * Abs(y)
    for form in forms(2):
        for part in form.parts:
            for product in part:
                assert product == 0 or parse(str(product), NAMES) == product
    with pytest.raises(InputError, match=r"'x_dt' is unknown.*did you mean 'x_dot'"):
        parse("x*x_dt", NAMES)


def test_every_term_comes_back_from_its_text() -> None:
    for axes in (1, 2):
        terms = [Term(type(f)("discovered_1", f.parts), dict.fromkeys(UNITS, 1e-6)) for f in forms(axes)]
        assert terms_from(json.loads(json.dumps(terms_state([terms]))), axes) == [tuple(terms)]


def test_the_key_follows_the_code_and_the_options(honest: SimpleNamespace, monkeypatch: pytest.MonkeyPatch) -> None:
    data: Dataset = honest.data
    key = digest(data, MODEL, {"max_effects": 6})
    assert digest(data, MODEL, {"max_effects": 5}) != key
    monkeypatch.setattr("discrepancy.name.checkpoint._code", lambda: "other")
    assert digest(data, MODEL, {"max_effects": 6}) != key


def test_a_resumed_search_is_the_one_that_was_interrupted() -> None:
    kept: list[dict[str, Any]] = []
    data = made({}, samples=SHORT)
    with Simulator(MODEL, jobs=1) as simulator:
        search = look(begin(Given(data, keep=kept.append), simulator))
        candidate = next(c for c, _ in search.scored if c.effect.id == "cubic_stiffness")
        # Infinite where the data show nothing.
        gone = Dropped(candidate, {"k3_x": (1e9, 2e9), "k3_y": (0.0, float("inf"))}, 1e-3)
        search = saved(replace(search, dropped=(gone,), refused=frozenset({"play"})))
        state = json.loads(json.dumps(kept[-1]))
        checked(state, MODEL, data)
    with Simulator(MODEL, jobs=1) as other:
        # Of what no column is, so that it is known by the file alone.
        state["columns"]["kinds"].append([[["play", 7.0]], 0])
        again = resume(Given(data), other, (), state)
    # Where columns are compared anew, the same kind may turn out otherwise, and the answer by its last digits.
    assert other.seen.kinds.pop((("play", 7.0),)) is False
    assert other.seen == simulator.seen
    assert other.seen.kinds
    for name in ("accepted", "dropped", "refused", "steps", "stages", "probes", "number", "shortest", "clip"):
        assert getattr(again, name) == getattr(search, name), name
    assert again.dropped == (gone,)
    assert (again.at.cost, again.at.parameters) == (search.at.cost, search.at.parameters)


def test_what_is_taken_out_of_the_record_later_is_taken_out_of_what_is_kept() -> None:
    kept: list[dict[str, Any]] = []
    data = made({}, samples=SHORT)
    # Far out by the noise, 1e-4 of it and more: a square that says so is not the one that was kept.
    spiked = [replace(r, v=r.v + 0.05 * (np.arange(SHORT) % 977 == 976)[:, None]) for r in data.records]
    with Simulator(MODEL, jobs=1) as simulator:
        search = begin(Given(data, keep=kept.append), simulator)
        search = search.on(replace(data, records=tuple(spiked)))
        saved(search.fitted(search.at))
    assert kept[1]["refitted"]["square"] > 2 * kept[0]["refitted"]["square"]
    assert kept[1]["refitted"]["parameters"] == kept[0]["refitted"]["parameters"]
