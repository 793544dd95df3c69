"""`gyrotwin compare`."""

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from gyrotwin.terminal_table import Table

console = Console()


def compare(
    candidates: Annotated[list[str], typer.Argument(metavar="A B ...", help="Devices, or folders of finished runs.")],
    scenario: Annotated[str, typer.Option(help="What devices go through.")] = "constant",
    seeds: Annotated[int, typer.Option(help="Runs of a device: their scatter is the noise of the differences.")] = 3,
    duration: Annotated[float | None, typer.Option(help="Seconds of a run; default: the scenario's.")] = None,
    out: Annotated[Path, typer.Option(help="Folder for summary.json, report.html.")] = Path("results/compare"),
    force: Annotated[bool, typer.Option("--force", help="Write even into a folder that holds other files.")] = False,
) -> None:
    """Put devices, or finished runs, side by side."""
    from gyrotwin import comparison
    from gyrotwin.output import check_writable
    from gyrotwin.progress import shown_progress

    check_writable(out, force=force)
    with shown_progress(console, "compare") as progress:
        found = comparison.compare(*candidates, scenario=scenario, seeds=seeds, duration=duration, progress=progress)
    found.save(out, force=force)
    table = Table(box=None, header_style="bold")
    for heading in ("", *found.names, *(f"{name} less {found.names[0]}" for name in found.names[1:])):
        table.add_column(heading, justify="right" if heading else "left")
    for row in found.rows:
        numbers = [*row.numbers, *(row.difference(k) for k in range(1, len(found.names)))]
        table.add_row(
            row.name if row.unit == "1" else f"{row.name} [dim]{row.unit}[/]", *map(comparison.shown, numbers)
        )
    console.print(table)
    console.print(f"report: {out / 'report.html'}", soft_wrap=True, highlight=False)
