"""What a run with its bias tuned shows: a table in the terminal and one self-contained page."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from gyrotwin.figures import Figure, Panel, envelope, line
from gyrotwin.numbers import MISSING, significant
from gyrotwin.report import as_json, template, write_whole
from gyrotwin.terminal_table import Table


def rows(summary: Mapping[str, Any]) -> list[tuple[str, str, str]]:
    """Quantity, value, unit."""
    split, block, bias = summary["split"], summary["block"], summary["bias_v"]
    found = [
        (f"|split| below {split['within_hz']:g} Hz from", significant(split["matched_at"], 3), "s"),
        (f"split after {split['since']:.3g} s, rms", significant(1e3 * split["rms_hz"], 3), "mHz"),
        ("largest", significant(1e3 * split["largest_hz"], 3), "mHz"),
        ("bias, first and last", f"{bias['first']:.4f}, {bias['last']:.4f}", "V"),
        ("bias, range", f"{bias['min']:.4f} .. {bias['max']:.4f}", "V"),
        (f"blocks of {block['measurement_s']:.3g} s, {block['settling_s']:.2g} s between", f"{block['count']}", "1"),
        ("of them without an answer", f"{block['missed']}", "1"),
        ("error of a block over its deviation, rms", significant(block["error_over_deviation"], 3), "1"),
    ]
    if block["error_over_bound"] is not None:
        found.append(("over its Cramér–Rao bound", significant(block["error_over_bound"], 3), "1"))
    if summary["dither"] is not None:
        found.append(("dither, either side of the drive", significant(summary["dither"]["frequency_hz"], 4), "Hz"))
    walk = summary["rate_noise"]["angle_random_walk_deg_rth"]
    if walk is not None:
        limit = significant(summary["rate_noise"]["limit_deg_rth"], 3)
        error = significant(summary["rate_noise"]["angle_random_walk_error_deg_rth"], 2)
        what = "angle random walk, and limit of the design"
        found.append((what, f"{significant(walk, 3)} ± {error}, {limit}", "°/√h"))
    return found


def results(summary: Mapping[str, Any]) -> Table:
    """The summary as a table for rich."""
    title = f"{summary['method']} mode matching, {summary['device']}, {summary['temperature_course']}"
    table = Table(title=title, title_justify="left", caption_justify="left")
    table.add_column("quantity")
    table.add_column("value", justify="right")
    table.add_column("unit")
    for row in rows(summary):
        table.add_row(*row)
    if summary["split"]["matched_at"] is None:
        table.caption = f"not matched within {summary['split']['within_hz']:g} Hz at the end"
    return table


def render(summary: Mapping[str, Any], trace: pl.DataFrame, blocks: pl.DataFrame, out: Path) -> None:
    """Writes the page of one run to ``out``; trace, blocks: columns as ``MatchResult`` has them."""
    figures = [_split_figure(summary, trace, blocks), _bias_figure(trace), _rate_figure(trace)]
    page = template("match.html.j2").render(
        summary=summary,
        rows=rows(summary),
        missing=MISSING,
        figures=figures,
        data=as_json({figure.id: figure.data() for figure in figures}),
    )
    write_whole(page, out)


def _over_time(trace: pl.DataFrame, column: str, role: str, factor: float = 1.0) -> Any:
    return line(column, role, *envelope(trace["t"].to_numpy(), factor * trace[column].to_numpy()))


def _split_figure(summary: Mapping[str, Any], trace: pl.DataFrame, blocks: pl.DataFrame) -> Figure:
    since = summary["split"]["since"]
    held = trace.filter(pl.col("t") > since)
    t, own = blocks["t"].to_numpy(), blocks["split"].fill_null(np.nan).to_numpy()
    after = t > since
    return Figure(
        "split",
        "Frequency split",
        "",
        "True split of the modes, f_y − f_x with the drive held, and what each block measured of it. Below: from the "
        "time on at which the bias is set.",
        [("truth", "true split"), ("measured", "measured by the block")],
        [
            Panel(
                "t [s]",
                "split [Hz]",
                [line("block", "measured", t, own), _over_time(trace, "split_true", "truth")],
                wide=True,
            ),
            Panel(
                "t [s]",
                "split [mHz]",
                [line("block", "measured", t[after], 1e3 * own[after]), _over_time(held, "split_true", "truth", 1e3)],
                wide=True,
            ),
        ],
    )


def _bias_figure(trace: pl.DataFrame) -> Figure:
    return Figure(
        "bias",
        "Bias voltage and drive",
        "",
        "The bias softens both axes, the drive more, since it swings; the phase-locked loop follows.",
        [("estimate", "bias, drive frequency")],
        [
            Panel("t [s]", "bias [V]", [_over_time(trace, "v_bias", "estimate")]),
            Panel("t [s]", "drive frequency [Hz]", [_over_time(trace, "drive_frequency", "estimate")]),
        ],
    )


def _rate_figure(trace: pl.DataFrame) -> Figure:
    factor = 180 / np.pi
    return Figure(
        "rate",
        "Rate of turn",
        "",
        "Output of the gyroscope while its bias is tuned, and the rate of the package.",
        [("truth", "truth"), ("estimate", "output")],
        [
            Panel(
                "t [s]",
                "rate [°/s]",
                [_over_time(trace, "rate_true", "truth", factor), _over_time(trace, "rate", "estimate", factor)],
                wide=True,
            )
        ],
    )
