"""Runs trials: makes the data, seals the label, asks the tool, hashes its answer, opens the label. One file a trial."""

import ast
import hashlib
import importlib
import json
import math
import time
import traceback
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from functools import cache
from multiprocessing import get_context
from pathlib import Path
from typing import Any, Final, NamedTuple

from benchmarks.blind.plan import Entry
from benchmarks.blind.store import DATA, digest, opened, save
from gyro_model.digest import digest_of
from gyro_model.whole_file import whole_file

ROOT: Final = Path(__file__).parents[2]
RESULTS: Final = "results"
Tool = Callable[[Path], dict[str, Any]]


class Ask(NamedTuple):
    """What to do with a trial. folder: where everything goes; tool: ``module:function`` from a data set's folder to a
    report; keep: leave the tables on disk."""

    folder: Path
    tool: str = "benchmarks.blind.tool:diagnosis"
    keep: bool = True


def run_all(entries: Iterable[Entry], ask: Ask, jobs: int) -> Iterator[dict[str, Any]]:
    """Results as they come; a trial that this code has answered, by its result file, is not run again."""
    waiting = []
    for entry in entries:
        done = result_file(ask.folder, entry.name)
        result = json.loads(done.read_text(encoding="utf-8")) if done.is_file() else {}
        if result.get("code") == code(ask.tool):
            yield result
        else:
            waiting.append(entry)
    if jobs == 1:
        yield from (run_one(entry, ask) for entry in waiting)
        return
    # Spawned: the threads of numba and polars do not survive a fork.
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
        for future in as_completed([pool.submit(run_one, entry, ask) for entry in waiting]):
            yield future.result()


def result_file(folder: Path, name: str) -> Path:
    """Where the result of a trial stands."""
    return folder / RESULTS / f"{name}.json"


def run_one(entry: Entry, ask: Ask) -> dict[str, Any]:
    """One trial from data to result, written to its file."""
    try:
        trial = entry.make()
    except RuntimeError as error:
        return _written(ask, {"id": entry.name, "kind": entry.kind, "not_made": str(error)})
    data = save(trial, ask.folder)
    sealed = digest(dict(trial.label))
    tool = tool_of(ask.tool)
    begin, wall = time.process_time(), time.perf_counter()
    answer: dict[str, Any]
    try:
        answer = finite(tool(data))
    except Exception as error:  # the tool's every failure is a result
        answer = {"error": f"{type(error).__name__}: {error}", "trace": traceback.format_exc(limit=-3)}
    seconds, wall = time.process_time() - begin, time.perf_counter() - wall
    hashed = digest(answer)
    if not ask.keep:
        for table in data.glob("*.parquet"):
            table.unlink()
    label = opened(ask.folder, entry.name)
    return _written(ask, {"id": entry.name, "kind": entry.kind, "answer": answer, "answer_sha256": hashed,
                          "label": label, "label_sha256": sealed, "cpu_s": seconds, "wall_s": wall})  # fmt: skip


def _written(ask: Ask, result: dict[str, Any]) -> dict[str, Any]:
    result = {**result, "code": code(ask.tool)}
    file = result_file(ask.folder, result["id"])
    with whole_file(file) as written:
        written.write(json.dumps(result, indent=1).encode())
    return result


@cache
def code(tool: str) -> str:
    """Digest of all that made an answer: the generator, the packages of the project, of the loop what these import, and
    the name of the tool."""
    whole = [ROOT / folder for folder in ("benchmarks/blind", "discrepancy", "gyro_model", "fmu_src")]
    found = hashlib.sha256(f"{tool} {digest_of(*whole, suffixes=('.py', '.c', '.h'))}".encode())
    for path in sorted(imported("cosim", whole)):
        found.update(path.relative_to(ROOT).as_posix().encode() + path.read_bytes())
    return found.hexdigest()


def imported(package: str, folders: Sequence[Path]) -> set[Path]:
    """Files of the ``package`` that code in ``folders`` imports, and those that these import."""
    waiting = [path for folder in folders for path in folder.rglob("*.py")]
    found = {ROOT / package / "__init__.py"}
    while waiting:
        places = [ROOT / name.replace(".", "/") for name in _names(waiting.pop()) if name.startswith(f"{package}.")]
        files = {file for place in places for file in (place.with_suffix(".py"), place / "__init__.py")}
        new = {file for file in files if file.is_file()} - found
        found |= new
        waiting += new
    return found


def _names(path: Path) -> Iterator[str]:
    """Modules that a file imports, and what it imports from them, by their dotted names."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (name.name for name in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            yield node.module
            yield from (f"{node.module}.{name.name}" for name in node.names)


def tool_of(name: str) -> Tool:
    """The function that ``module:function`` names."""
    module, _, function = name.partition(":")
    tool: Tool = getattr(importlib.import_module(module), function)
    return tool


def finite(value: Any) -> Any:
    """A JSON value: numbers that are not finite become None, numpy's scalars plain ones."""
    if isinstance(value, dict):
        return {str(key): finite(v) for key, v in value.items()}
    if isinstance(value, list | tuple):
        return [finite(v) for v in value]
    if hasattr(value, "item"):
        value = value.item()
    return None if isinstance(value, float) and not math.isfinite(value) else value


def data_folder(folder: Path, name: str) -> Path:
    """The data set of a trial."""
    return folder / DATA / name
