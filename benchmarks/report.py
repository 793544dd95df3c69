"""What a benchmark gives: rows with their targets, where it was measured, and how that is printed and written."""

import json
import math
import os
import platform
import subprocess
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

import numba
import numpy as np
from rich import table as rich_table
from rich.console import Console
from rich.markup import escape

from gyro_model.compiling import find_compiler
from gyro_model.errors import InputError

RESULTS: Final = Path(__file__).parent / "results"
NONE: Final = "–"
SEEDS: Final = 10
"""Of measures whose runs are long."""
MANY_SEEDS: Final = 100
"""Of measures whose runs are short."""


class Options(NamedTuple):
    """What the command line asks for: the number of seeds, None: each measure's own, and of processes at a time."""

    seeds: int | None = None
    jobs: int = 2

    def seeds_or(self, own: int) -> int:
        """The number of seeds where ``own`` is that of the measure."""
        return own if self.seeds is None else self.seeds


class Row(NamedTuple):
    """One measure.

    values: by column, in ``unit``; None where there is none (never converged). limit: the target, an upper one unless
    ``at_least``; judged: the columns that it holds for, all if empty; note: what the reader should know beside.
    """

    what: str
    unit: str
    values: Mapping[str, float | None]
    limit: float | None = None
    at_least: bool = False
    judged: tuple[str, ...] = ()
    note: str = ""

    @property
    def target(self) -> str:
        """The target as text, empty without one."""
        return "" if self.limit is None else f"{'≥' if self.at_least else '≤'} {self.limit:.4g}"

    @property
    def met(self) -> str:
        """``yes``, ``no``, or which of the columns meet the target; empty without one."""
        if self.limit is None:
            return ""
        columns = self.judged or tuple(self.values)
        good = [column for column in columns if self._meets(self.values[column])]
        return "yes" if len(good) == len(columns) else f"{', '.join(good)} only" if good else "no"

    def _meets(self, value: float | None) -> bool:
        if value is None or self.limit is None:
            return False
        return value >= self.limit if self.at_least else value <= self.limit


class Table(NamedTuple):
    """Rows with the same columns."""

    title: str
    rows: list[Row]


class Report(NamedTuple):
    """The result of one benchmark; ``data``: what else goes into the JSON; ``files``: further files by name."""

    name: str
    title: str
    tables: list[Table]
    notes: list[str]
    data: Mapping[str, Any] = {}
    files: Mapping[str, str] = {}


def row(what: str, unit: str, values: Mapping[str, float], **rest: Any) -> Row:
    """A row whose values may be infinite or NaN, for what was never reached."""
    finite = {name: float(value) if math.isfinite(value) else None for name, value in values.items()}
    return Row(what, unit, finite, **rest)


def spread(values: Iterable[float]) -> dict[str, float]:
    """Median, 95 % and worst of sizes that should be small; infinity counts as a size, and what is no number as
    infinity."""
    ordered = sorted(np.inf if np.isnan(value) else abs(value) for value in values)
    if not ordered:
        return dict.fromkeys(("median", "95 %", "worst"), np.nan)
    return {"median": _quantile(ordered, 0.5), "95 %": _quantile(ordered, 0.95), "worst": ordered[-1]}


def _quantile(ordered: Sequence[float], share: float) -> float:
    """The quantile between two neighbours, as numpy has it, but where both are infinite it is too."""
    at = share * (len(ordered) - 1)
    low, high = ordered[math.floor(at)], ordered[math.ceil(at)]
    return low if low == high else low + (at - math.floor(at)) * (high - low)


def machine() -> str:
    """The machine and the tools, in a line."""
    versions = f"Python {platform.python_version()}, numba {numba.__version__}, numpy {np.__version__}"
    return f"{_processor()}, {os.cpu_count()} cores, {platform.system()}, {versions}, {_compiler()}"


def load() -> str:
    """How busy the machine is, as a sentence."""
    if not hasattr(os, "getloadavg"):
        return "The load of the machine is not known."
    return (
        f"Load average (runnable processes, over 1 and 5 minutes): {os.getloadavg()[0]:.2f}, {os.getloadavg()[1]:.2f} "
        f"on {os.cpu_count()} cores; where it exceeds what this benchmark itself runs, others took part of the time."
    )


def _processor() -> str:
    info = Path("/proc/cpuinfo")
    if info.is_file():
        for line in info.read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()


def _compiler() -> str:
    try:
        answer = subprocess.run([*find_compiler(), "--version"], capture_output=True, text=True, check=True).stdout
    except (InputError, subprocess.CalledProcessError):
        return "no C compiler"
    return answer.splitlines()[0]


def text_of(value: float | None) -> str:
    """Three significant digits."""
    return NONE if value is None else f"{value:.3g}"


def show(report: Report, console: Console) -> None:
    """Prints the tables and the notes."""
    for table in report.tables:
        shown = rich_table.Table(title=escape(table.title), title_justify="left")
        for heading in _headings(table):
            right = heading not in ("measure", "unit", "note", "met")
            shown.add_column(heading, justify="right" if right else "left", overflow="fold")
        for line in table.rows:
            style = "red" if line.met == "no" else "yellow" if line.met.endswith("only") else None
            shown.add_row(*(escape(cell) for cell in _cells(line)), style=style)
        console.print(shown)
    for note in report.notes:
        console.print(f"- {note}", markup=False, highlight=False)


def write(report: Report, command: str, folder: Path = RESULTS) -> None:
    """Writes NAME.json and NAME.md and the further files into ``folder``."""
    folder.mkdir(parents=True, exist_ok=True)
    where = machine()
    content = {
        "name": report.name,
        "command": command,
        "machine": where,
        "tables": [{"title": t.title, "rows": [_as_json(line) for line in t.rows]} for t in report.tables],
        "notes": report.notes,
        **_finite(report.data),
    }
    texts = {
        f"{report.name}.json": json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False) + "\n",
        f"{report.name}.md": _markdown(report, command, where),
        **report.files,
    }
    for name, text in texts.items():
        (folder / name).write_text(text, encoding="utf-8")


def _finite(value: Any) -> Any:
    """What JSON has no number for, such as a measure that does not apply, is None."""
    if isinstance(value, Mapping):
        return {name: _finite(one) for name, one in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(one) for one in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _as_json(line: Row) -> dict[str, Any]:
    return {
        "what": line.what,
        "unit": line.unit,
        "values": dict(line.values),
        "target": line.target,
        "met": line.met,
        "note": line.note,
    }


def _markdown(report: Report, command: str, where: str) -> str:
    lines = [f"# {report.title}", "", f"    {command}", "", f"Measured on {where}."]
    for table in report.tables:
        headings = _headings(table)
        lines += ["", f"## {table.title}", "", "| " + " | ".join(headings) + " |"]
        lines.append("| --- |" + " --- |" * (len(headings) - 1))
        lines += ["| " + " | ".join(cell.replace("|", "\\|") for cell in _cells(line)) + " |" for line in table.rows]
    if report.notes:
        lines += ["", *(f"- {note}" for note in report.notes)]
    lines += ["", *(f"![{report.title}]({name})" for name in report.files if name.endswith(".svg"))]
    return "\n".join(lines).rstrip() + "\n"


def _headings(table: Table) -> list[str]:
    return ["measure", "unit", *table.rows[0].values, "target", "met", "note"]


def _cells(line: Row) -> list[str]:
    return [line.what, line.unit, *map(text_of, line.values.values()), line.target, line.met, line.note]
