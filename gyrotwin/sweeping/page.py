"""The page of a sweep: yield, distributions of the outputs, what matters, all points at once, the worst ones."""

from pathlib import Path
from typing import Any, Final

import numpy as np
import polars as pl

from gyrotwin.figures import Figure, Line, Panel
from gyrotwin.report import render_page
from gyrotwin.sweeping.result import SweepResult

BINS: Final = 40
SHOWN: Final = 150
"""Lines of the parallel coordinates at most; more are a grey area."""
WORST: Final = 8


def render(result: SweepResult, out: Path) -> None:
    """Writes the page, complete or not at all."""
    figures = [*_distributions(result), *_parallel(result)]
    worst = result.worst(WORST)
    render_page(
        "sweep.html.j2",
        out,
        figures,
        summary=result.summary,
        limits=result.plan.limits,
        columns=worst.columns,
        worst=[[_text(value) for value in row] for row in worst.rows()],
    )


def _text(value: Any) -> str:
    return "–" if value is None else f"{value:.4g}" if isinstance(value, float) else str(value)


def _distributions(result: SweepResult) -> list[Figure]:
    panels = []
    for name in result.outputs:
        values = result.rows[name].drop_nulls().cast(pl.Float64).to_numpy()
        if len(values) < 2 or np.ptp(values) == 0:
            continue
        counts, edges = np.histogram(values, min(BINS, max(len(values) // 4, 5)))
        # Steps: each edge twice.
        x, y = np.repeat(edges, 2), np.concatenate([[0], np.repeat(counts, 2), [0]]).astype(float)
        lines = [Line("points", "estimate", x.tolist(), y.tolist())]
        for end in result.plan.limits.get(name, ()):
            if edges[0] <= end <= edges[-1]:
                lines.append(Line("limit", "limit", [float(end)] * 2, [0.0, float(counts.max())]))
        panels.append(Panel(name, "points", lines))
    if not panels:
        return []
    text = "How the outputs are spread over all points." + (
        " Dashed: limits of the plan." if result.plan.limits else ""
    )
    key = [("estimate", "points"), *([("limit", "limit")] if result.plan.limits else [])]
    return [Figure("distributions", "Distributions", "", text, key, panels)]


def _parallel(result: SweepResult) -> list[Figure]:
    """Each point as a line over its parameters and outputs, each scaled to its own range."""
    names = [n for n in (*result.plan.parameters, *result.outputs) if result.rows[n].dtype.is_numeric()]
    good = result.within().to_numpy()
    table = result.rows.select(pl.col(names).cast(pl.Float64)).to_numpy()
    full = np.isfinite(table).all(axis=1)
    if len(names) < 2 or full.sum() < 2:
        return []
    low, high = table[full].min(axis=0), table[full].max(axis=0)
    scaled = np.where(high > low, (table - low) / np.where(high > low, high - low, 1), 0.5)
    lines = []
    for role, chosen in (("estimate", full & good), ("error", full & ~good)):
        rows = np.flatnonzero(chosen)
        rows = rows[np.unique(np.linspace(0, len(rows) - 1, SHOWN).astype(int))] if len(rows) else rows
        x: list[float | None] = []
        y: list[float | None] = []
        for row in rows:
            x += [*map(float, range(len(names))), None]
            y += [*scaled[row].tolist(), None]
        if x:
            lines.append(Line("within the limits" if role == "estimate" else "beyond", role, x, y))
    text = "One line a point, from the least (0) to the largest value (1) of each."
    ends = [f"{name}<br>{a:.4g} to {b:.4g}" for name, a, b in zip(names, low, high, strict=True)]
    key = [("estimate", "within the limits" if result.plan.limits else "point")]
    key += [("error", "beyond a limit")] if (~good).any() else []
    return [Figure("parallel", "All points", "", text, key,
                   [Panel("", "share of its range", lines, wide=True, x_names=ends)])]  # fmt: skip
