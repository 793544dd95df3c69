"""What a rate-mode run shows: tables in the terminal and one self-contained page."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import polars as pl
from rich.console import Group, RenderableType
from rich.text import Text

from cosim.rate.allan import FLAT, Allan, NoiseLimits
from cosim.rate.run import RateRun
from cosim.rate.steady_state import in_words
from gyrotwin import rate_figures as figures
from gyrotwin.figures import Figure
from gyrotwin.numbers import MISSING, significant, with_error
from gyrotwin.report import as_json, template, write_whole
from gyrotwin.terminal_table import Table

Noise = tuple[Allan, NoiseLimits]


def results(summary: Mapping[str, Any]) -> RenderableType:
    """The summary as tables for rich."""
    head = Text(f"rate mode, {summary['device']}, {summary['sense']} loop on the {summary['plant']} plant: in lock at ")
    head.append(f"{1e3 * summary['locked_at']:.0f} ms", style="bold")
    table = Table(title="Means over the run", title_justify="left")
    table.add_column("quantity")
    for heading in ("run", "harmonic balance"):
        table.add_column(heading, justify="right")
    table.add_column("unit")
    for row in rows(summary):
        table.add_row(*row)
    table.caption = f"The harmonic balance leaves out: {missing}" if (missing := left_out(summary)) else None
    warnings = [Text(f"warning: {text}", style="yellow") for text in summary["warnings"]]
    parts: list[RenderableType] = [head, *warnings, table]
    if summary["allan"] is not None:
        parts.append(_allan(summary["allan"]))
    if summary.get("split") is not None:
        parts.append(_split(summary["split"]))
    return Group(*parts)


SHOWN = 5
"""Blocks of a split estimate in the terminal."""


def _split(split: Mapping[str, Any]) -> Table:
    table = Table(title="Frequency split, block by block", title_justify="left")
    for heading in ("t [s]", "split f_y - f_x [Hz]", "95 % interval"):
        table.add_column(heading, justify="right")
    for t, value, low, high in split_rows(split):
        table.add_row(t, value, f"{low} .. {high}")
    table.caption = (
        f"{split['blocks']} blocks of {split['block_s']:g} s, {split['blocks_with_a_hump']} with a hump; "
        f"Q of the design: {split['q_of_the_design']:.4g}"
    )
    return table


def split_rows(split: Mapping[str, Any]) -> list[tuple[str, str, str, str]]:
    """Time, split, ends of its interval, of some blocks through the run."""
    steps = split["estimates"]
    count = min(SHOWN, len(steps))
    chosen = [steps[round(i * (len(steps) - 1) / max(count - 1, 1))] for i in range(count)]
    return [(f"{s['t']:g}", f"{s['split_hz']:.4f}", f"{s['low_hz']:.4f}", f"{s['high_hz']:.4f}") for s in chosen]


def rows(summary: Mapping[str, Any]) -> list[tuple[str, str, str, str]]:
    """Quantity, value of the run, settled value by harmonic balance where the temperature stays, unit."""
    span = summary["temperature_deg_c"]["structure"]
    stays = span["max"] - span["min"] < figures.SPAN
    expected = {name: value if stays else None for name, value in summary["harmonic_balance"].items()}
    return [
        (
            "bias",
            with_error(summary["bias_deg_s"], summary["bias_error_deg_s"]),
            significant(expected["bias_deg_s"], 5),
            "°/s",
        ),
        (
            "scale factor",
            with_error(summary["scale_factor"], summary["scale_factor_error"]),
            significant(expected["scale_factor"], 6),
            "1",
        ),
        (
            "quadrature",
            significant(summary["quadrature_deg_s"], 5),
            significant(expected["quadrature_deg_s"], 5),
            "°/s",
        ),
        (
            "drive frequency",
            _hertz(summary["drive_frequency_hz"]["mean"]),
            _hertz(expected["drive_frequency_hz"]),
            "Hz",
        ),
        ("drive amplitude", significant(summary["drive_amplitude_v"]["mean"], 6), "", "V"),
        ("drive force", _nano(summary["drive_force_n"]["mean"]), _nano(expected["drive_force_n"]), "nN"),
    ]


def left_out(summary: Mapping[str, Any]) -> str:
    """The effects that act and have no place in the harmonic balance, each with the reason."""
    return in_words(summary["harmonic_balance"]["left_out"])


def _nano(force: float | None) -> str:
    return significant(None if force is None else 1e9 * force, 5)


def _hertz(frequency: float | None) -> str:
    return MISSING if frequency is None else f"{frequency:.4f}"


def _allan(allan: Mapping[str, Any]) -> Table:
    table = Table(title="Noise at rest", title_justify="left")
    table.add_column("quantity")
    table.add_column("value", justify="right")
    table.add_column("unit")
    for row in noise_rows(allan):
        table.add_row(*row)
    return table


def noise_rows(allan: Mapping[str, Any]) -> list[tuple[str, str, str]]:
    """Quantity, value, unit."""
    error = significant(allan["angle_random_walk_error_deg_rth"], 2)
    walk = f"{significant(allan['angle_random_walk_deg_rth'])} ± {error}"
    flat = allan["bias_instability_deg_h"]
    at_most = significant(allan["lowest_deviation_deg_h"] / FLAT)
    return [
        ("angle random walk", walk, "°/√h"),
        ("thermal limit √(k_B T/(mωQA²))/λ", significant(allan["thermal_limit_deg_rth"]), "°/√h"),
        ("sense electronics", significant(allan["electronics_deg_rth"]), "°/√h"),
        ("both", significant(allan["expected_deg_rth"]), "°/√h"),
        ("bias instability", significant(flat) if flat is not None else f"below {at_most}: still falling", "°/h"),
    ]


def render(summary: Mapping[str, Any], run: RateRun, record: pl.DataFrame, noise: Noise | None, out: Path) -> None:
    """Writes the page of one run to ``out``; summary: contents of summary.json; record: columns of trace.parquet."""
    drawn = _figures(summary, run, record, noise)
    page = template("rate.html.j2").render(
        summary=summary,
        rows=rows(summary),
        split_rows=split_rows(summary["split"]) if summary.get("split") else [],
        noise_rows=noise_rows(summary["allan"]) if noise is not None else [],
        figures=drawn,
        data=as_json({figure.id: figure.data() for figure in drawn}),
    )
    write_whole(page, out)


def _figures(summary: Mapping[str, Any], run: RateRun, record: pl.DataFrame, noise: Noise | None) -> list[Figure]:
    drawn = [figures.rate_figure(record), figures.drive_figure(record), figures.temperature_figure(record)]
    span = summary["temperature_deg_c"]["structure"]
    if span["max"] - span["min"] > figures.SPAN:
        drawn.insert(1, figures.over_temperature_figure(record, run))
    if noise is not None:
        drawn.insert(1, figures.allan_figure(*noise))
    return drawn
