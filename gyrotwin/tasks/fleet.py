"""`gyrotwin diagnose --each FOLDER`: every data set of a folder alone, then what they say together."""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any, Final

import typer
from rich.console import Console

from discrepancy.tell.fleet import Estimate, Row, fleet, row_of
from gyro_model.errors import InputError, nearest
from gyro_model.model import load_model
from gyro_model.progress import Steps
from gyro_model.tables import read_table
from gyrotwin.fleet_result import FleetResult
from gyrotwin.interrupt import Interrupted
from gyrotwin.numbers import significant
from gyrotwin.output import check_writable, publish
from gyrotwin.results import write_json
from gyrotwin.tasks import diagnose as one
from gyrotwin.terminal_table import Table

DEVICES: Final = "devices"
ROW: Final = "row.json"
COLUMNS: Final = "devices.csv"
FILE: Final = "dataset.toml"


def find(folder: Path, request: one.Request, progress: Steps | None = None, *, force: bool = False) -> FleetResult:
    """Diagnoses every data set in a folder of ``folder`` and writes what is found of each to ``request.out``; devices
    that were finished there before, from the same data with the same options, are not searched again.

    Raises InputError where there is no data set, or the table of the devices does not fit them. A data set that can't
    be diagnosed is a row with its error.
    """
    names = _names(folder)
    columns = _columns(folder, names)
    one.check_request(request)
    check_writable(request.out, force=force)
    tell = progress or (lambda line: None)
    try:
        rows = [_row(folder, name, request, f"{name} ({k} of {len(names)})", tell) for k, name in enumerate(names, 1)]
    except Interrupted as stop:
        if request.out.is_dir():
            stop.left = f"{request.out} keeps what was found so far: the same command goes on from there"
        raise
    result = FleetResult(folder.resolve().name, fleet(rows, columns))
    publish(request.out, dict(result.writers()), force=force)
    return result


def _names(folder: Path) -> list[str]:
    if not folder.is_dir():
        raise InputError(f"--each {folder}: no such folder")
    names = sorted(path.parent.name for path in folder.glob(f"*/{FILE}"))
    if not names:
        raise InputError(f"--each {folder}: no folder in it holds a {FILE}; `gyrotwin dataset init` writes one")
    return names


def _columns(folder: Path, names: Sequence[str]) -> dict[str, dict[str, float]]:
    """What devices.csv says of each device: the first column names it, the others are numbers."""
    path = folder / COLUMNS
    if not path.is_file():
        return {}
    table = read_table(path)
    first, *headings = table.headings
    listed = [str(name) for name in table.frame[first]]
    missing = [name for name in names if listed.count(name) != 1]
    if missing:
        raise InputError(f"{path}: column {first!r} must name each device once, {missing[0]} does not stand there so"
                         f"{nearest(missing[0], listed)}")  # fmt: skip
    numbers = {heading: dict(zip(listed, table.numbers(heading), strict=True)) for heading in headings}
    return {heading: {name: float(own[name]) for name in names} for heading, own in numbers.items()}


def _row(folder: Path, name: str, request: one.Request, said: str, tell: Steps) -> Row:
    """What the device shows; found before, or now."""
    from discrepancy.data.checks import check, lines
    from discrepancy.name.checkpoint import digest

    own = replace_request(request, folder / name, request.out / DEVICES / name)
    model = load_model(*own.effects)
    try:
        data, notes = one.load_nominal(own, model)
    except InputError as error:
        tell(f"{said}: {error}")
        return Row(name, error=str(error))
    options = {"max_effects": own.max_effects, "seed": own.seed, **asdict(one.criteria_of(own))}
    limits = one.limits_of(own)
    options |= asdict(limits) if limits else {}
    key = digest(data, model, options)
    before = _read(own.out / ROW, name, key)
    if before is not None:
        return before
    tell(said)
    try:
        own.out.mkdir(parents=True, exist_ok=True)
        warnings = [*notes, *lines(check(data))]
        found = one.find(own, data, model, lambda line: tell(f"{said}: {line}"), own.out / one.CHECKPOINT, warnings)
    except InputError as error:
        return Row(name, error=str(error))
    except OSError as error:
        raise InputError(f"output folder {own.out}: {error.strerror}; name another with --out") from None
    row = row_of(name, found.raw, data.axes)
    files = {n: write for n, write in found.writers().items() if not n.endswith(".fmu")}
    publish(own.out, {**files, ROW: write_json({"key": key, **asdict(replace(row, name=""))})}, found.sometimes)
    return row


def replace_request(request: one.Request, dataset: Path, out: Path) -> one.Request:
    """The request for one device."""
    return request._replace(dataset=dataset, out=out)


def _read(path: Path, name: str, key: str) -> Row | None:
    """The row in a file; None where it is that of other data or options, or no row."""
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        if content.pop("key") != key:
            return None
        estimates = {part: {n: Estimate(float(e["value"]), float(e["deviation"]), str(e["unit"]))
                            for n, e in content[part].items()} for part in ("values", "absent")}  # fmt: skip
        numbers = [x for part in estimates.values() for e in part.values() for x in (e.value, e.deviation)]
        if not all(map(math.isfinite, numbers)):
            return None
        return Row(
            name,
            str(content["verdict"]),
            {str(n): tuple(map(str, own)) for n, own in content["effects"].items()},
            {str(n): tuple(map(str, own)) for n, own in content["either"].items()},
            tuple(map(str, content["record"])),
            estimates["values"],
            estimates["absent"],
            detectable={str(e): {str(n): float(v) for n, v in own.items()} for e, own in content["detectable"].items()},
            misfit=_optional(content["misfit"]),
            floor=_optional(content["floor"]),
        )
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return None


def _optional(value: Any) -> float | None:
    return None if value is None else float(value)


def execute(folder: Path, request: one.Request, out: Console, *, force: bool = False) -> Mapping[str, Any]:
    """Diagnoses each, writes the files, shows the tables; gives the contents of fleet.json."""
    with one.steps_shown(out) as progress:
        result = find(folder, request, progress, force=force)
    for table in tables(result):
        out.print(table)
    out.print(f"report: {request.out / 'report.html'}", soft_wrap=True, highlight=False)
    if all(row.error for row in result.fleet.rows):
        raise typer.Exit(2)
    return result.summary


def tables(result: FleetResult) -> list[Table]:
    """What is found, for the terminal."""
    found = result.fleet
    shares = _table(f"Effects of {len(found.rows)} devices", "effect", "devices", "share, 95 %", "would show")
    for name, s in found.shares.items():
        shares.add_row(name, f"{s.count} of {s.of}", f"{s.low:.0%} to {s.high:.0%}", str(s.seen))
    spreads = _table("Population (95 %)", "parameter", "unit", "mean", "spread", *(f"per {h}" for h in found.columns))
    for name, own in found.spreads.items():
        p = own.found
        slopes = [f"{significant(s.value)} ± {significant(s.high - s.value, 2)}" for s in p.slopes]
        mean, half = significant(p.mean.value, 4), significant(p.mean.high - p.mean.value, 2)
        spread = f"{significant(p.spread.value, 2)} ({significant(p.spread.low, 2)} to {significant(p.spread.high, 2)})"
        spreads.add_row(name, own.unit, f"{mean} ± {half}", spread, *slopes)
    outliers = _table("Devices that do not belong", "device", "why")
    for outlier in found.outliers:
        outliers.add_row(outlier.device, "\n".join(outlier.reasons))
    failed = _table("Not diagnosed", "device", "why")
    for row in found.rows:
        if row.error:
            failed.add_row(row.name, row.error)
    return [table for table in (shares, spreads, outliers, failed) if table.row_count]


def _table(title: str, *headings: str) -> Table:
    table = Table(title=title, title_justify="left")
    for heading in headings:
        table.add_column(heading, overflow="fold")
    return table
