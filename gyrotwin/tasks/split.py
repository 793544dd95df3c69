"""`gyrotwin split`: the frequency split of the two modes from the thermal noise in a record of normal operation."""

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import numpy as np
import typer
from rich.console import Console

from gyro_model.progress import Progress
from gyrotwin.progress import shown_progress
from gyrotwin.terminal_table import Table

if TYPE_CHECKING:
    from calibration.mode_split import Analysis, Correlation
    from gyrotwin.results import SplitResult

console = Console()


class Request(NamedTuple):
    """A search as asked for; None where it is found or does not apply. Hz, s."""

    record: Path
    q: float | None = None
    drive_frequency: float | None = None
    sample_rate: float | None = None
    columns: tuple[str, ...] = ()
    carrier: float | None = None
    span: float | None = None
    guard: float = 0.0
    clean_line: bool = False
    resolution: float | None = None
    track: float | None = None
    unfold: bool = False
    mass: float | None = None
    sense_gain: float | None = None
    temperature: float = 298.15


def split(
    record: Annotated[Path, typer.Argument(help="Table of one voltage: .csv, .csv.gz or .parquet.")],
    q: Annotated[
        float | None, typer.Option("--q", help="Quality factor of the sense mode; found where not given.")
    ] = None,
    drive_frequency: Annotated[
        float | None, typer.Option(help="Drive frequency, Hz; the strongest line where not given.")
    ] = None,
    sample_rate: Annotated[float | None, typer.Option(help="Samples a second, where no column is the time.")] = None,
    column: Annotated[
        list[str] | None, typer.Option(help="Column of the voltage; with --carrier twice, I and Q.")
    ] = None,
    carrier: Annotated[
        float | None, typer.Option(help="The columns are I and Q around this frequency, Hz: v = I cos - Q sin.")
    ] = None,
    span: Annotated[
        float | None, typer.Option(help="Search this far either side of the drive, Hz; default a third of it.")
    ] = None,
    guard: Annotated[
        float, typer.Option(help="Leave out this much either side of the drive line, Hz: the rate's bandwidth.")
    ] = 0.0,
    clean_line: Annotated[
        bool, typer.Option("--clean-line", help="The drive line has no phase noise: finds a hump right under it.")
    ] = False,
    resolution: Annotated[
        float | None, typer.Option(help="Refuse an answer with a 95 % interval wider than plus or minus this, Hz.")
    ] = None,
    track: Annotated[
        float | None, typer.Option(metavar="SECONDS", help="Follow the split through time, by blocks of this length.")
    ] = None,
    unfold: Annotated[
        bool, typer.Option("--unfold", help="Sampled below twice the drive frequency, which is given: unfold it.")
    ] = False,
    mass: Annotated[
        float | None, typer.Option(help="kg; with --sense-gain the hump's power is held against kT.")
    ] = None,
    sense_gain: Annotated[float | None, typer.Option(help="V/m of the sense pickoff.")] = None,
    temperature: Annotated[float, typer.Option(help="Of the structure, K.")] = 298.15,
    out: Annotated[
        Path | None, typer.Option(help="Folder for summary.json and report.html, and track.csv of a track.")
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Write even into a folder that holds other files.")] = False,
) -> None:
    """Find the frequency split of the two modes in a record of normal operation, from thermal noise."""
    from gyrotwin.output import check_writable

    folder = out or Path("results") / ("split" if track is None else "track")
    check_writable(folder, force=force)
    request = Request(
        record, q, drive_frequency, sample_rate, tuple(column or ()), carrier, span, guard, clean_line, resolution,
        track, unfold, mass, sense_gain, temperature,
    )  # fmt: skip
    if track is None:
        found = find(request)
    else:
        with shown_progress(console, f"split of {record.name}, by blocks") as progress:
            found = find(request, progress)
    found.save(folder, force=force)
    console.print(found.shown)
    for text in found.summary["warnings"]:
        console.print(f"warning: {text}", style="yellow", soft_wrap=True, highlight=False, markup=False)
    console.print(f"report: {folder / 'report.html'}", soft_wrap=True, highlight=False)


def find(request: Request, progress: Progress = lambda done, total: None) -> "SplitResult":
    """The split, or its track, that ``request`` asks for; ``progress`` is told the blocks of a track.

    Raises InputError, with a remedy, for whatever is wrong.
    """
    from calibration.mode_split import Question, find_split
    from calibration.mode_split.checks import thermal_ratio, unchecked
    from gyrotwin.results import SplitResult, Writer, write_json
    from gyrotwin.split_record import read_record
    from gyrotwin.split_report import render_split
    from gyrotwin.split_track import follow

    question = Question(
        request.q, request.drive_frequency, request.span, request.guard, request.resolution, request.clean_line,
        request.unfold, request.mass, request.sense_gain, request.temperature,
    )  # fmt: skip
    voltage = read_record(request.record, request.columns, request.sample_rate, request.carrier)
    if request.track is not None:
        return follow(voltage, question, request.track, request.record.name, progress)
    analysis = find_split(voltage, question)
    summary = summarise(analysis, question.q, request.record.name)
    if question.mass is not None and question.sense_gain is not None:
        level = thermal_ratio(analysis.split.model, question.mass, question.sense_gain, question.temperature)
        summary["power_over_thermal"] = level
    summary["warnings"] = [*unchecked(question.mass, question.sense_gain), *analysis.doubts]
    files: dict[str, Writer] = {
        "summary.json": write_json(summary),
        "report.html": partial(render_split, summary, analysis),
    }
    return SplitResult(summary, files, results(summary))


def summarise(analysis: "Analysis", q_given: float | None, name: str) -> dict[str, Any]:
    """The answer as JSON-ready values: Hz, V²/Hz one-sided, intervals 95 %."""
    from calibration.mode_split import correlations

    found = analysis.split
    low, high = found.interval
    printed, cut = correlations(analysis)
    return {
        "record": {"file": name, "duration_s": found.duration, "band_hz": analysis.part.band},
        "f_x": found.f_x,
        "f_y": {"value": found.f_y, "low": low, "high": high},
        "split": {"value": found.split, "low": low - found.f_x, "high": high - found.f_x},
        "q": {"value": found.q, "low": found.q_interval[0], "high": found.q_interval[1], "given": q_given is not None},
        "hump_over_floor_db": float(10 * np.log10(found.hump_over_floor)),
        "deviation": found.deviation,
        "bound": found.bound,
        "information_kept": found.g,
        "chance": found.chance,
        "cross_correlation": {
            "preset": cut[0].preset,
            "as_printed": _with_interval(*printed, analysis.part.band),
            "line_removed": _with_interval(*cut, analysis.part.band),
        },
    }


def results(summary: dict[str, Any]) -> Table:
    """The summary as a table for rich."""
    table = Table(title=f"Split from noise: {summary['record']['file']}", title_justify="left")
    for heading in ("", "value", "95 % interval"):
        table.add_column(heading, justify="left" if not heading else "right")
    table.add_row("drive line f_x", f"{summary['f_x']:.4f} Hz", "")
    for key, text in (("f_y", "sense resonance f_y"), ("split", "split f_y - f_x")):
        value = summary[key]
        low, high = value["low"], value["high"]
        table.add_row(
            text, f"{value['value']:.4f} Hz", f"{low:.4f} .. {high:.4f}", style="bold" if key == "split" else ""
        )
    q = summary["q"]
    table.add_row("Q", f"{q['value']:.4g}", "given" if q["given"] else f"{q['low']:.4g} .. {q['high']:.4g}")
    table.add_row("hump over the floor", f"{summary['hump_over_floor_db']:.1f} dB", "")
    if (level := summary.get("power_over_thermal")) is not None:
        table.add_row("hump's power over kT's", f"{level:.3g}", "")
    table.add_row("standard deviation", f"{summary['deviation']:.3g} Hz", "")
    table.add_row("Cramér–Rao bound", f"{summary['bound']:.3g} Hz", "")
    for key, text in (("as_printed", "cross-correlation, as printed"), ("line_removed", "the same, line removed")):
        value = summary["cross_correlation"][key]
        if value is None:
            table.add_row(text, "no second peak", "")
        else:
            table.add_row(text, f"{value['value']:.4f} Hz", f"{value['low']:.4f} .. {value['high']:.4f}")
    return table


def _with_interval(found: "Correlation", half: float, band: float) -> dict[str, float] | None:
    """f_y of a correlation, or None where it has no second peak, or the line's flank shifts it by half the band."""
    if found.f_y is None or not half < 0.5 * band:
        return None
    return {"value": found.f_y, "low": found.f_y - half, "high": found.f_y + half}
