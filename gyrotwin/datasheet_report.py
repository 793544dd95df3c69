"""What a datasheet shows: a table in the terminal and one self-contained page."""

from math import floor, isfinite, log10
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from gyrotwin.figures import Figure as Drawing
from gyrotwin.figures import Panel, line
from gyrotwin.numbers import MISSING, significant
from gyrotwin.report import render_page

if TYPE_CHECKING:
    from calibration.datasheet.figure import Curve, Figure
    from gyrotwin.datasheet_result import DatasheetResult

SIGNS: Final = {"equals": "", "at least": "≥ ", "at most": "≤ "}
MODES: Final = {
    "rate-open": "rate mode, open sense loop",
    "rate-closed": "rate mode, closed sense loop",
    "whole-angle": "whole-angle mode",
}


def value_of(figure: "Figure") -> str:
    """Value ± standard error, with so many digits that the error shows two."""
    if figure.value is None:
        return MISSING
    error = figure.error
    if error is None or not (isfinite(error) and error > 0):
        return significant(figure.value, 5)
    digits = 2 + (floor(log10(abs(figure.value))) - floor(log10(error)) if figure.value else 0)
    if digits < 1:
        return f"{significant(figure.value, 2)} ± {error:.2g}"
    shown = f"{figure.value:#.{min(max(digits, 2), 10)}g}".rstrip(".")
    return f"{shown} ± {error:.2g}"


def expected_of(figure: "Figure") -> str:
    """What it should be, with its sign, or a dash."""
    return MISSING if figure.expected is None else SIGNS[figure.how] + significant(figure.expected, 5)


def verdict_of(figure: "Figure") -> str:
    """Whether it is what is expected."""
    return {None: "", True: "✓", False: "off"}[figure.holds]


def results(result: "DatasheetResult") -> RenderableType:
    """The datasheet as a table for rich."""
    head = result.head
    title = f"{head['device']}, {MODES[head['mode']]}; tests after {head['standard']}"
    table = Table(title=title, title_justify="left")
    table.add_column("figure")
    table.add_column("value ± standard error", justify="right")
    table.add_column("unit")
    table.add_column("expected", justify="right")
    table.add_column("")
    skipped = []
    for test in result.tests:
        table.add_section()
        if test.outcome.figures:
            table.add_row(Text(f"{test.procedure.clause} {test.procedure.title}", style="bold"))
        for figure in test.outcome.figures:
            style = "yellow" if figure.holds is False else ""
            table.add_row(
                f"  {figure.name}", value_of(figure), figure.unit, expected_of(figure), verdict_of(figure), style=style
            )
        if test.outcome.reason:
            skipped.append(Text(f"{test.procedure.title}: not done: {test.outcome.reason}"))
    return Group(table, *skipped)


def render(result: "DatasheetResult", out: Path) -> None:
    """Writes the page, complete or not at all."""
    render_page(
        "datasheet.html.j2",
        out,
        [drawing for test in result.tests for curve in test.outcome.curves if (drawing := draw(curve)) is not None],
        head=result.head,
        mode=MODES[result.head["mode"]],
        cards=result.headline(),
        tests=[
            {
                "clause": test.procedure.clause,
                "title": test.procedure.title,
                "reason": test.outcome.reason,
                "rows": [_row(figure) for figure in test.outcome.figures],
            }
            for test in result.tests
        ],
    )


def _row(figure: "Figure") -> dict[str, Any]:
    return {
        "name": figure.name,
        "value": value_of(figure),
        "unit": figure.unit,
        "tests": figure.tests,
        "expected": expected_of(figure),
        "verdict": verdict_of(figure),
        "rule": figure.rule,
        "note": figure.note,
        "off": figure.holds is False,
    }


LOGARITHMIC: Final = {"allan": (True, True), "noise_spectrum": (True, True), "transfer": (True, False)}
"""Axes of a curve, x and y, that are logarithmic."""


def draw(curve: "Curve") -> Drawing | None:
    """A curve as panels: columns of one unit share one; the first column is x; errors are not drawn."""
    names = list(curve.columns)
    x_name, x = names[0], np.asarray(curve.columns[names[0]], float)
    units: dict[str, list[str]] = {}
    for name in names[1:]:
        if " error " not in f" {name} ":
            units.setdefault(name[name.rindex("[") :], []).append(name)
    x_log, y_log = LOGARITHMIC.get(curve.id, (False, False))
    panels = []
    for unit, columns in units.items():
        lines = []
        for name in columns:
            text = name[: name.rindex("[")].strip()
            role = (
                "truth" if text.startswith(("expected", "fit")) else "limit" if text in ("low", "high") else "estimate"
            )
            lines.append(line(text, role, x, np.asarray(curve.columns[name], float)))
        panels.append(Panel(x_name, f"{lines[0].name} {unit}", lines, x_log=x_log, y_log=y_log, wide=len(units) == 1))
    if not panels:
        return None
    key = [("estimate", "measured")]
    key += (
        [("truth", "fitted" if curve.id == "allan" else "expected")]
        if any(one.role == "truth" for panel in panels for one in panel.lines)
        else []
    )
    key += [("limit", "95 % interval")] if curve.id == "allan" else []
    return Drawing(curve.id, curve.name, "", "", key, panels)
