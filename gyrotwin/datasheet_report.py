"""What a datasheet shows: a table in the terminal and one self-contained page."""

from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from rich.console import Group, RenderableType
from rich.text import Text

from gyrotwin.curve_figures import draw
from gyrotwin.numbers import MISSING, significant, with_error
from gyrotwin.report import render_page
from gyrotwin.terminal_table import Table

if TYPE_CHECKING:
    from calibration.datasheet.figure import Figure
    from gyrotwin.datasheet_result import DatasheetResult

SIGNS: Final = {"equals": "", "at least": "≥ ", "at most": "≤ "}
MODES: Final = {
    "rate-open": "rate mode, open sense loop",
    "rate-closed": "rate mode, closed sense loop",
    "whole-angle": "whole-angle mode",
}


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
                f"  {figure.name}",
                with_error(figure.value, figure.error),
                figure.unit,
                expected_of(figure),
                verdict_of(figure),
                style=style,
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
        "value": with_error(figure.value, figure.error),
        "unit": figure.unit,
        "tests": figure.tests,
        "expected": expected_of(figure),
        "verdict": verdict_of(figure),
        "rule": figure.rule,
        "note": figure.note,
        "off": figure.holds is False,
    }
