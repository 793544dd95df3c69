"""`gyrotwin split --track`: the split through time, as a table with intervals and a page."""

from pathlib import Path
from typing import Any, Final

import numpy as np
import polars as pl

from calibration.mode_split import Question, Track, VoltageRecord, follow_split
from calibration.mode_split.checks import unchecked
from calibration.mode_split.estimate import NORMAL_95
from gyro_model.errors import InputError
from gyro_model.progress import Progress
from gyrotwin.figures import Figure, Panel, line
from gyrotwin.report import as_json, template, write_whole
from gyrotwin.results import SplitResult, Writer, write_json
from gyrotwin.terminal_table import Table

SHOWN: Final = 5
"""Rows of the track in the terminal."""


def follow(
    record: VoltageRecord, question: Question, block: float, name: str, progress: Progress = lambda done, total: None
) -> SplitResult:
    """Follows the split by blocks of ``block`` [s]; ``progress`` is told of each.

    Raises InputError where ``question`` asks for a resolution.
    """
    if question.resolution is not None:
        raise InputError("--resolution with --track: every point of a track has its interval; leave it out")
    found = follow_split(record, question, block, progress)
    table = frame(found)
    summary = summarise(found, table, record, name, question.q is not None)
    summary["warnings"] = [*unchecked(question.mass, question.sense_gain), *found.doubts]
    files: dict[str, Writer] = {
        "summary.json": write_json(summary),
        "track.csv": table.write_csv,
        "report.html": lambda path: _render(summary, table, path),
    }
    return SplitResult(summary, files, _results(summary, table), table)


def frame(track: Track) -> pl.DataFrame:
    """Columns t: middle of the block [s]; split with its 95 % interval, low and high: of the track; block, block_low,
    block_high: of the block alone, null where nothing was found [Hz]."""
    rows = []
    for step in track.steps:
        reach = NORMAL_95 * step.deviation
        alone = (None, None, None) if step.block is None else _alone(step.block.split, step.block.deviation)
        rows.append((step.t, step.split, step.split - reach, step.split + reach, *alone))
    names = ("t", "split", "low", "high", "block", "block_low", "block_high")
    return pl.DataFrame(rows, schema=dict.fromkeys(names, pl.Float64), orient="row")


def _alone(split: float, deviation: float) -> tuple[float, float, float]:
    return split, split - NORMAL_95 * deviation, split + NORMAL_95 * deviation


def summarise(track: Track, table: pl.DataFrame, record: VoltageRecord, name: str, q_given: bool) -> dict[str, Any]:
    """The track as JSON-ready values: s, Hz, intervals 95 %."""
    ends = {key: dict(zip(("value", "low", "high"), table.row(at)[1:4], strict=True)) for key, at in _ENDS}
    return {
        "record": {"file": name, "duration_s": record.duration},
        "block_s": track.block,
        "blocks": track.blocks,
        "blocks_without_a_hump": track.blocks - table["block"].count(),
        "q": {"value": track.q, "given": q_given},
        "wander_hz_per_s_per_root_s": track.wander,
        **ends,
        "lowest": float(np.min(table["split"].to_numpy())),
        "highest": float(np.max(table["split"].to_numpy())),
    }


_ENDS: Final = (("first", 0), ("last", -1))


def _results(summary: dict[str, Any], table: pl.DataFrame) -> Table:
    shown = Table(
        title=f"Split through time: {summary['record']['file']}", title_justify="left", caption_justify="left"
    )
    for heading in ("t [s]", "split f_y - f_x [Hz]", "95 % interval"):
        shown.add_column(heading, justify="right")
    for at in np.unique(np.linspace(0, len(table) - 1, SHOWN).astype(int)):
        t, split, low, high = table.row(int(at))[:4]
        shown.add_row(f"{t:g}", f"{split:.4f}", f"{low:.4f} .. {high:.4f}")
    q, given = summary["q"]["value"], "given" if summary["q"]["given"] else "found"
    shown.caption = (
        f"{summary['blocks']} blocks of {summary['block_s']:g} s, {summary['blocks_without_a_hump']} without a hump; "
        f"Q = {q:.4g} ({given})"
    )
    return shown


def _render(summary: dict[str, Any], table: pl.DataFrame, out: Path) -> None:
    t = table["t"].to_numpy()

    def over_time(name: str, role: str, column: str) -> Any:
        return line(name, role, t, table[column].cast(pl.Float64).fill_null(np.nan).to_numpy())

    lines = [
        over_time("block alone", "measured", "block"),
        over_time("track", "estimate", "split"),
        over_time("95 %", "limit", "low"),
        over_time("95 %", "limit", "high"),
    ]
    figure = Figure(
        "track",
        "Split through time",
        "",
        "Each block gives a split by maximum likelihood; a Kalman filter joins them, forward in time. Dashed: 95 % "
        "interval of the track.",
        [("measured", "block alone"), ("estimate", "track"), ("limit", "95 %")],
        [Panel("t [s]", "split f_y − f_x [Hz]", lines, wide=True)],
    )
    page = template("split_track.html.j2").render(
        summary=summary,
        figures=[figure],
        data=as_json({figure.id: figure.data()}),
    )
    write_whole(page, out)
