"""`gyrotwin compensate`: fits a temperature compensation to a test, and shows what it leaves of another."""

from collections.abc import Mapping
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final, NamedTuple

import typer
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from gyro_model.errors import InputError, nearest
from gyrotwin.numbers import MISSING, significant

if TYPE_CHECKING:
    from calibration.compensation.choose import Asked
    from calibration.compensation.measures import Result
    from calibration.compensation.model import Compensation
    from calibration.compensation.record import Blocks
    from gyrotwin.results import CompensationResult

console = Console()

HELD_OUT_FOLD: Final = 1
HELD_OUT_STRETCHES: Final = 60
"""Without a second record one in four of these stretches is held out: short enough that a fast warm-up, too, is met at
its start."""


class Judged(NamedTuple):
    """A method with what it leaves of the fitted and of the held-out blocks; score: rms of residual over noise in the
    choice."""

    compensation: "Compensation"
    score: float
    fitted: "Result"
    held_out: "Result"


class Request(NamedTuple):
    """A fit as asked for; None where the program decides. Times in s; ``maps`` and ``scales`` are texts COLUMN=..."""

    record: Path
    test: Path | None = None
    method: str = "best"
    sensor: str | None = None
    segments: int | None = None
    hidden: int = 8
    sampling_time: float = 10.0
    settling: float = 1.0
    settled: bool = False
    outside: str = "refuse"
    maps: tuple[str, ...] = ()
    scales: tuple[str, ...] = ()
    seed: int = 1


def compensate(
    record: Annotated[Path, typer.Argument(help="Temperature test: trace.parquet of `gyrotwin rate`, or a table.")],
    test: Annotated[
        Path | None, typer.Option(help="Another cycle to test on; default: a quarter of RECORD is held out.")
    ] = None,
    method: Annotated[
        str, typer.Option(help="piecewise (source 003), network (002), spline, or best by held-out error.")
    ] = "best",
    sensor: Annotated[
        str | None, typer.Option(help="Of the piecewise lines: structure or circuit; default: structure where given.")
    ] = None,
    segments: Annotated[int | None, typer.Option(help="Of the piecewise lines; default: by held-out error.")] = None,
    hidden: Annotated[int, typer.Option(help="Neurons of the network.")] = 8,
    sampling_time: Annotated[float, typer.Option(help="Inputs and rate are means over this, s.")] = 10.0,
    settling: Annotated[float, typer.Option(help="Left out after a step of rate_true, s.")] = 1.0,
    settled: Annotated[
        bool, typer.Option("--settled", help="Only where the temperatures rest, below 0.05 °C/min.")
    ] = False,
    outside: Annotated[str, typer.Option(help="Beyond the fitted range: refuse, or clamp to it.")] = "refuse",
    maps: Annotated[
        list[str] | None,
        typer.Option("--map", metavar="COLUMN=HEADING", help="As in --map sensor_circuit=Temp; repeatable."),
    ] = None,
    scales: Annotated[
        list[str] | None,
        typer.Option("--scale", metavar="COLUMN=UNIT", help="rad/s, deg/s, counts, K, degC, or FACTOR,OFFSET."),
    ] = None,
    seed: Annotated[int, typer.Option(help="Of the network's starts.")] = 1,
    out: Annotated[Path | None, typer.Option(help="Folder for the results; default results/compensate.")] = None,
    force: Annotated[bool, typer.Option("--force", help="Write even into a folder that holds other files.")] = False,
) -> None:
    """Fit a temperature compensation and write it as TOML and as a C header, with before and after."""
    from gyrotwin.output import check_writable

    folder = out or Path("results") / "compensate"
    check_writable(folder, force=force)
    found = find(
        Request(
            record, test, method, sensor, segments, hidden, sampling_time, settling, settled, outside,
            tuple(maps or ()), tuple(scales or ()), seed,
        )
    )  # fmt: skip
    found.save(folder, force=force)
    console.print(results(found.summary))
    for name in ("compensation.toml", "compensation.h", "report.html"):
        console.print(str(folder / name), soft_wrap=True, highlight=False)


def find(request: Request) -> "CompensationResult":
    """The compensation that ``request`` asks for. Raises InputError, with a remedy, for whatever is wrong."""
    from calibration.compensation.choose import Asked
    from calibration.compensation.export import to_c_header, to_toml
    from calibration.compensation.model import OUTSIDE
    from calibration.compensation.record import CIRCUIT, STRUCTURE, make_blocks
    from gyrotwin.compensate_record import read_test
    from gyrotwin.compensate_report import render
    from gyrotwin.results import CompensationResult, write_json

    sensor, outside = request.sensor, request.outside
    for option, value, known in (("sensor", sensor, (STRUCTURE, CIRCUIT)), ("outside", outside, OUTSIDE)):
        if value is not None and value not in known:
            raise InputError(f"--{option} {value}: give {' or '.join(known)}{nearest(value, known)}")
    asked = Asked(request.method, sensor, request.segments, request.hidden, request.seed, request.sampling_time)

    def blocks_of(path: Path) -> "Blocks":
        table = read_test(path, request.maps, request.scales)
        blocks = make_blocks(table, request.sampling_time, request.settling)
        return _settled(blocks) if request.settled else blocks

    fitted, test = blocks_of(request.record), request.test
    judged, shown = judge_all(fitted, None if test is None else blocks_of(test), asked, outside)
    summary = summarise(judged, request.record.name, None if test is None else test.name)
    chosen = judged[0].compensation
    return CompensationResult(
        summary,
        {
            "compensation.toml": lambda path: path.write_text(to_toml(chosen), encoding="utf-8"),
            "compensation.h": lambda path: path.write_text(to_c_header(chosen, outside), encoding="utf-8"),
            "summary.json": write_json(summary),
            "report.html": lambda path: render(summary, judged, shown, path),
        },
    )


def _settled(blocks: "Blocks") -> "Blocks":
    from calibration.compensation.record import FEWEST

    if blocks.settled.sum() < FEWEST:
        raise InputError(
            f"{blocks.name}: {int(blocks.settled.sum())} settled blocks, {FEWEST} are needed: let the temperature "
            "rest longer, or leave --settled out"
        )
    return blocks.part(blocks.settled)


def judge_all(blocks: "Blocks", test: "Blocks | None", asked: "Asked", outside: str) -> tuple[list[Judged], "Blocks"]:
    """The methods asked for, best first, and the blocks that they are tested on.

    Without a test a quarter of the blocks is held out, in stretches, as far as the others cover their range.
    """
    import numpy as np

    from calibration.compensation.choose import choose, held_out_stretches
    from calibration.compensation.measures import judge

    shown = test
    if shown is None:
        left_out = held_out_stretches(len(blocks), HELD_OUT_FOLD, HELD_OUT_STRETCHES)
        covered = np.ones(len(blocks), dtype=bool)
        for values in blocks.inputs.values():
            covered &= (values >= values[~left_out].min()) & (values <= values[~left_out].max())
        shown = blocks.part(left_out & covered)
        blocks = blocks.part(~left_out)
    judged = []
    for candidate in choose(blocks, asked):
        compensation = candidate.fit(blocks)
        fitted, held_out = judge(blocks, compensation, "clamp"), judge(shown, compensation, outside)
        judged.append(Judged(compensation, candidate.held_out, fitted, held_out))
    return judged, shown


def summarise(judged: list[Judged], record: str, test: str | None) -> dict[str, Any]:
    """The answer as JSON-ready values."""
    from calibration.compensation.measures import summary

    chosen = judged[0].compensation
    return {
        "record": record,
        "test": test,
        "method": chosen.method,
        "note": chosen.note,
        "unit": chosen.unit,
        "sampling_time_s": chosen.sampling_time,
        "inputs": [{"name": i.name, "unit": i.unit, "low": i.low, "high": i.high} for i in chosen.inputs],
        "methods": {
            j.compensation.method: {
                "note": j.compensation.note,
                "score": j.score if isfinite(j.score) else None,
                "fitted": summary(j.fitted, chosen.unit),
                "held_out": summary(j.held_out, chosen.unit),
            }
            for j in judged
        },
    }


def times(factor: float) -> str:
    """A factor: three digits, and no power of ten above a thousand."""
    return f"{factor:.0f}" if factor >= 100 else f"{factor:.3g}"


HEADINGS: Final = ("method", "before", "after", "factor", "possible", "score")


def rows(summary: Mapping[str, Any], quantity: str) -> list[tuple[str, ...]]:
    """Of each method on the held-out blocks: the columns of HEADINGS for "scale_factor_ppm_per_c" or "bias_per_c"."""
    lines = []
    for name, found in summary["methods"].items():
        change = found["held_out"][quantity]
        if change is not None:
            numbers = (significant(change[key], digits) for key, digits in (("before", 4), ("after", 3)))
            allows = MISSING if change["noise_allows"] is None else times(change["noise_allows"])
            lines.append((name, *numbers, times(change["factor"]), allows, significant(found["score"])))
    return lines


def titles(summary: Mapping[str, Any]) -> dict[str, str]:
    """Headings of the tables by quantity."""
    unit = "°/h" if summary["unit"] == "rad/s" else summary["unit"]
    return {"scale_factor_ppm_per_c": "Scale factor [ppm/°C]", "bias_per_c": f"Bias [{unit}/°C]"}


def results(summary: Mapping[str, Any]) -> Any:
    """The summary as tables for rich."""
    from rich.console import Group

    where = "held-out stretches" if summary["test"] is None else summary["test"]
    parts: list[Any] = [f"{summary['method']}: {summary['note']}; tested on {where}"]
    for quantity, title in titles(summary).items():
        lines = rows(summary, quantity)
        if lines:
            table = Table(title=escape(title), title_justify="left")
            for heading in HEADINGS:
                table.add_column(heading, justify="left" if heading == "method" else "right")
            for line in lines:
                table.add_row(*line)
            parts.append(table)
    clamped = summary["methods"][summary["method"]]["held_out"]["clamped_blocks"]
    if clamped:
        parts.append(f"{clamped} blocks lie beyond the fitted range and are clamped to it")
    return Group(*parts)
