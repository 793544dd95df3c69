"""`gyrotwin datasheet`."""

from pathlib import Path
from typing import Annotated, Final

import typer
from rich.console import Console

console = Console()

CHECKPOINT: Final = "datasheet.checkpoint"


def datasheet(
    device: Annotated[str, typer.Argument(help="What is on the bench: packaged device by name, or a device file.")],
    mode: Annotated[str, typer.Option(help="rate-open, rate-closed or whole-angle.")] = "rate-open",
    standard: Annotated[str, typer.Option(help="Whose tests: ieee1431.")] = "ieee1431",
    design: Annotated[
        str | None,
        typer.Option(help="All that loops and calibration know: a device in rate mode, a design in whole-angle mode."),
    ] = None,
    settings: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="NAME=VALUE", help="Set a device parameter, or rate_mode.NAME (SI); repeatable."),
    ] = None,
    seed: Annotated[int, typer.Option(help="Seed of the first turn-on; each next one has the next.")] = 1,
    quick: Annotated[bool, typer.Option("--quick", help="Fewer and shorter records, wider errors.")] = False,
    out: Annotated[
        Path | None, typer.Option(help="Folder for datasheet.json and report.html; default results/datasheet.")
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Write even into a folder that holds other files.")] = False,
) -> None:
    """Measure the datasheet of a device: the tests of IEEE Std 1431, Allan analysis, formulas beside."""
    from gyrotwin import api
    from gyrotwin.datasheet_report import results
    from gyrotwin.output import check_writable
    from gyrotwin.progress import shown_progress
    from gyrotwin.tasks.run import split_texts

    folder = out or Path("results") / "datasheet"
    check_writable(folder, force=force)
    with shown_progress(console, f"datasheet of {device}") as progress:
        result = api.datasheet(
            device,
            mode=mode,
            standard=standard,
            design=design,
            parameters=split_texts(settings or ()),
            seed=seed,
            quick=quick,
            progress=progress,
            checkpoint=folder / CHECKPOINT,
        )
    result.save(folder, force=force)
    (folder / CHECKPOINT).unlink(missing_ok=True)
    console.print(results(result))
    console.print(f"report: {folder / 'report.html'}", soft_wrap=True, highlight=False)
