"""`gyrotwin compensate`: fits a temperature compensation to a test, and shows what it leaves of another."""

from collections.abc import Mapping, Sequence
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final, NamedTuple

import typer
from rich.console import Console
from rich.markup import escape

from gyro_model.errors import InputError, nearest
from gyro_model.progress import Progress
from gyrotwin.numbers import MISSING, significant
from gyrotwin.terminal_table import Table

if TYPE_CHECKING:
    from calibration.compensation.floors import Floor
    from calibration.compensation.record import Blocks
    from calibration.compensation.trial import Trial
    from gyrotwin.results import CompensationResult


console = Console()


class Request(NamedTuple):
    """A fit as asked for; None where the program decides. Times in s; ``maps`` and ``scales`` are texts COLUMN=..."""

    records: tuple[Path, ...]
    test: Path | None = None
    method: str = "best"
    sensor: str | None = None
    segments: int | None = None
    hidden: int | None = None
    sampling_time: float = 10.0
    settling: float = 1.0
    settled: bool = False
    outside: str = "refuse"
    maps: tuple[str, ...] = ()
    scales: tuple[str, ...] = ()
    seed: int = 1


def compensate(
    records: Annotated[
        list[Path],
        typer.Argument(help="Temperature tests: trace.parquet of `gyrotwin rate`, or tables."),
    ],
    test: Annotated[
        Path | None, typer.Option(help="Another record to test on; default: the last cycle is held out.")
    ] = None,
    method: Annotated[
        str, typer.Option(help="piecewise, network, spline, history, or best by inner validation.")
    ] = "best",
    sensor: Annotated[
        str | None, typer.Option(help="Of the piecewise lines: structure or circuit; default: structure where given.")
    ] = None,
    segments: Annotated[int | None, typer.Option(help="Of the piecewise lines; default: by inner validation.")] = None,
    hidden: Annotated[int | None, typer.Option(help="Neurons of the network; default: by inner validation.")] = None,
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
    from gyrotwin.progress import shown_progress

    folder = out or Path("results") / "compensate"
    check_writable(folder, force=force)
    request = Request(
        tuple(records), test, method, sensor, segments, hidden, sampling_time, settling, settled, outside,
        tuple(maps or ()), tuple(scales or ()), seed,
    )  # fmt: skip
    with shown_progress(console, "inner validation") as progress:
        found = find(request, progress)
    found.save(folder, force=force)
    console.print(results(found.summary))
    for name in ("compensation.toml", "compensation.h", "report.html"):
        console.print(str(folder / name), soft_wrap=True, highlight=False)


def find(request: Request, progress: Progress | None = None) -> "CompensationResult":
    """The compensation that ``request`` asks for. progress: is called with the shapes tried and all of them.

    Raises InputError, with a remedy, for whatever is wrong.
    """
    from calibration.compensation.export import to_c_header, to_toml
    from calibration.compensation.methods.method import Asked
    from calibration.compensation.model import OUTSIDE
    from calibration.compensation.record import CIRCUIT, STRUCTURE, joined, make_blocks
    from calibration.compensation.trial import trial
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

    fitted = joined([blocks_of(path) for path in request.records])
    test = None if request.test is None else blocks_of(request.test)
    found = trial(fitted, test, asked, outside, progress)
    names = ", ".join(path.name for path in request.records)
    doubts = fitted.doubts if test is None else fitted.doubts + test.doubts
    summary = summarise(found, names, None if request.test is None else request.test.name, doubts)
    return CompensationResult(
        summary,
        {
            "compensation.toml": lambda path: path.write_text(to_toml(found.chosen), encoding="utf-8"),
            "compensation.h": lambda path: path.write_text(to_c_header(found.chosen, outside), encoding="utf-8"),
            "summary.json": write_json(summary),
            "report.html": lambda path: render(summary, found.judged, found.tested, path),
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


def summarise(found: "Trial", record: str, test: str | None, doubts: Sequence[str]) -> dict[str, Any]:
    """The answer as JSON-ready values. doubts: what to know of the records first."""
    from calibration.compensation.measures import bias_factor, summary

    chosen = found.chosen
    factor = bias_factor(chosen.unit)
    held_out = summary(found.judged[0].held_out, chosen.unit)
    return {
        "warnings": [*doubts, *_worse(held_out)],
        "hold_out": found.hold_out,
        "another_cycle_tested": not found.untested,
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
            for j in found.judged
        },
        "floors": {
            "present_inputs": _floor(found.floors.present, factor),
            "history_of_inputs": _floor(found.floors.history, factor),
        },
        "residual": [cause._asdict() for cause in found.residual],
        "inner_validation": [
            {"method": c.family, "shape": c.shape, "score": c.held_out if isfinite(c.held_out) else None}
            for c in sorted(found.choice.tried, key=lambda c: c.held_out)
        ],
    }


def _worse(held_out: Mapping[str, Any]) -> list[str]:
    """What the compensation makes worse on the blocks held out."""
    names = {"scale_factor_ppm_per_c": "scale factor over temperature", "bias_per_c": "bias over temperature"}
    worse = [
        f"the {name} is {times(1 / held_out[key]['factor'])} times as much with the compensation"
        for key, name in names.items()
        if held_out[key] is not None and held_out[key]["factor"] < 1
    ]
    return [f"{', and '.join(worse)}: don't use it"] if worse else []


def _floor(found: "Floor | str", factor: float) -> dict[str, Any]:
    if isinstance(found, str):
        return {"missing": found}
    interval = (found.low, found.high)
    return {
        "bias_per_c": factor * found.per_c,
        "bias_per_c_interval": [factor * found.per_c * end for end in interval],
        "bias_rms": factor * found.rms,
        "bias_rms_interval": [factor * found.rms * end for end in interval],
        "cycles": found.cycles,
    }


def times(factor: float) -> str:
    """A factor: three digits, and no power of ten above a thousand."""
    return f"{factor:.0f}" if factor >= 100 else f"{factor:.3g}"


HEADINGS: Final = ("method", "before", "after", "factor", "noise allows", "history", "present", "score")
FLOORS: Final = ("history_of_inputs", "present_inputs")


def rows(summary: Mapping[str, Any], quantity: str) -> list[tuple[str, ...]]:
    """Of each method on the held-out blocks: the columns of HEADINGS for a quantity of ``titles``."""
    lines = []
    for name, found in summary["methods"].items():
        change = found["held_out"][quantity]
        if change is not None:
            numbers = (significant(change[key], digits) for key, digits in (("before", 4), ("after", 3)))
            noise = change["before"] / change["noise"] if change["noise"] else None
            allowed = [_allowed(summary["floors"][floor], quantity, change["before"]) for floor in FLOORS]
            allows = MISSING if noise is None else times(noise)
            lines.append((name, *numbers, times(change["factor"]), allows, *allowed, significant(found["score"])))
    return lines


def _allowed(floor: Mapping[str, Any], quantity: str, before: float) -> str:
    """The factor down to a floor."""
    return times(before / floor[quantity]) if quantity in floor else MISSING


def titles(summary: Mapping[str, Any]) -> dict[str, str]:
    """Headings of the tables by quantity."""
    unit = "°/h" if summary["unit"] == "rad/s" else summary["unit"]
    return {
        "scale_factor_ppm_per_c": "Scale factor [ppm/°C]",
        "bias_per_c": f"Bias [{unit}/°C]",
        "bias_rms": f"Bias, rms [{unit}]",
    }


def results(summary: Mapping[str, Any]) -> Any:
    """The summary as tables for rich."""
    from rich.console import Group

    parts: list[Any] = [escape(summary["hold_out"])]
    parts += [f"[yellow]warning: {escape(text)}[/]" for text in summary["warnings"]]
    parts.append(escape(f"{summary['method']}: {summary['note']}"))
    for quantity, title in titles(summary).items():
        lines = rows(summary, quantity)
        if lines:
            table = Table(title=escape(title), title_justify="left")
            for heading in HEADINGS:
                table.add_column(heading, justify="left" if heading == "method" else "right")
            for line in lines:
                table.add_row(*line)
            parts.append(table)
    parts += [escape(line) for line in notes(summary)]
    clamped = summary["methods"][summary["method"]]["held_out"]["clamped_blocks"]
    if clamped:
        parts.append(f"{clamped} blocks lie beyond the fitted range and are clamped to it")
    return Group(*parts)


def _told(floor: Mapping[str, Any], unit: str) -> str:
    """A floor with its 95 % interval, or why there is none."""
    if "missing" in floor:
        return str(floor["missing"])
    parts = []
    for key, of in (("bias_per_c", f"{unit}/°C"), ("bias_rms", f"{unit} rms")):
        low, high = floor[key + "_interval"]
        parts.append(f"{significant(floor[key])} ({significant(low)} to {significant(high)}) {of}")
    return f"{', '.join(parts)}, from {floor['cycles']} cycles"


def _score(found: float | None) -> str:
    return "can't be fitted without each part:" if found is None else significant(found)


def notes(summary: Mapping[str, Any]) -> list[str]:
    """Sentences under the tables: floors, what is left, what was tried."""
    lines = []
    floors = summary["floors"]
    unit = "°/h" if summary["unit"] == "rad/s" else summary["unit"]
    for key, what in (("history_of_inputs", "the history of the inputs"), ("present_inputs", "the present inputs")):
        lines.append(f"What no function of {what} can remove: {_told(floors[key], unit)}.")
    if summary["residual"]:
        shares = "; ".join(f"{cause['name']} ({100 * cause['share']:.0f} %)" for cause in summary["residual"])
        lines.append(f"What is left: {shares}.")
    tried = summary["inner_validation"]
    lines.append(f"Chosen by inner validation on the fitting cycles alone, best of {len(tried)}; next best:")
    lines += [f"  {_score(t['score'])}  {t['method']}: {t['shape']}" for t in tried[1:4]]
    return lines
