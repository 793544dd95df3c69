"""`gyrotwin run`."""

import sys
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

console = Console()


def run(
    scenario: Annotated[
        str, typer.Argument(help="A scenario by name (`gyrotwin list scenarios`) or a file of your own.")
    ],
    device: Annotated[
        str, typer.Option(help="What the plant is: packaged device by name, or a device file.")
    ] = "reference",
    design: Annotated[
        str | None,
        typer.Option(help="All that the loop may know: plain, lab, or a file, such as the device.toml of a diagnosis."),
    ] = None,
    effects: Annotated[
        list[Path] | None, typer.Option(metavar="DIR", help="Folder of further effect files; repeatable.")
    ] = None,
    settings: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="NAME=VALUE",
            help="Set a device parameter, or observer.NAME, controller.NAME, monitor.NAME (SI); repeatable.",
        ),
    ] = None,
    rate_profile: Annotated[
        Path | None, typer.Option(help="CSV file (also .csv.gz) with a measured rate, for `motion`.")
    ] = None,
    rate_column: Annotated[
        str | None, typer.Option(help="Its column with the rate; the first column is time in s.")
    ] = None,
    rate_unit: Annotated[
        str | None, typer.Option(help="Unit of that column, deg/s or rad/s; default: its heading's.")
    ] = None,
    rate_start: Annotated[float, typer.Option(help="Begin this many seconds into the profile.")] = 0.0,
    observer: Annotated[str, typer.Option(help="ekf, lyapunov, or a Python file that defines OBSERVER.")] = "ekf",
    controller: Annotated[str, typer.Option(help="foucault, or a Python file that defines CONTROLLER.")] = "foucault",
    sensing_defects: Annotated[
        bool,
        typer.Option(
            "--sensing-defects",
            help="Offset, drift, gap, mismatches and parasitic in the pickoff; design sensing_defects.",
        ),
    ] = False,
    angle: Annotated[str | None, typer.Option(help="Angle unit A, B or C; default: the scenario's.")] = None,
    sample_rate: Annotated[
        float | None, typer.Option(help="Samples a second; default: those of the device's sample period.")
    ] = None,
    duration: Annotated[float | None, typer.Option(help="Seconds; default: the scenario's.")] = None,
    seed: Annotated[int, typer.Option(help="Seed of the noises and of the first estimates.")] = 1,
    trace_rate: Annotated[
        float | None, typer.Option(help="Rows of the trace a second; default 20000, fewer in long runs.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="Folder for summary.json, trace.parquet, report.html; default results/SCENARIO.")
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Write even into a folder that holds other files.")] = False,
) -> None:
    """Run a scenario in the closed loop and report."""
    from gyrotwin import api
    from gyrotwin.console import results
    from gyrotwin.output import check_writable
    from gyrotwin.progress import shown_progress
    from gyrotwin.tasks.run import NOT_VALID, split_texts

    folder = out or Path("results") / Path(scenario).stem
    check_writable(folder, force=force)
    with shown_progress(console, Path(scenario).stem) as progress:
        result = api.run(
            scenario,
            device=device,
            design=design,
            parameters=split_texts(settings or ()),
            seed=seed,
            duration=duration,
            observer=observer,
            controller=controller,
            angle=angle,
            sample_rate=sample_rate,
            trace_rate=trace_rate,
            rate_profile=rate_profile,
            rate_column=rate_column,
            rate_unit=rate_unit,
            rate_start=rate_start,
            sensing_defects=sensing_defects,
            effects=effects or (),
            progress=progress,
        )
    result.save(folder, force=force)
    console.print(results(result.summary))
    console.print(f"report: {folder / 'report.html'}", soft_wrap=True, highlight=False)
    if not result.valid:
        sys.exit(NOT_VALID)
