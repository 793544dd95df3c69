"""`gyrotwin export`."""

from pathlib import Path
from typing import Annotated

import typer

export_app = typer.Typer(no_args_is_help=True, help="What was measured, for other programs.")


@export_app.callback()
def group() -> None:
    """What was measured, for other programs."""


@export_app.command()
def sensor(
    datasheet: Annotated[Path, typer.Argument(metavar="DATASHEET.json", help="As `gyrotwin datasheet` wrote it.")],
    formats: Annotated[
        list[str] | None,
        typer.Option("--format", help="kalibr, gnss_ins_sim, matlab, gazebo or px4; repeatable; default: all."),
    ] = None,
    sample_rate: Annotated[float, typer.Option(help="At which the sensor is read there, Hz.")] = 100.0,
    out: Annotated[Path, typer.Option(help="Folder for the files.")] = Path("results/sensor"),
    force: Annotated[bool, typer.Option("--force", help="Write even into a folder that holds other files.")] = False,
) -> None:
    """Write the sensor of a datasheet as files of Kalibr, gnss-ins-sim, MATLAB, Gazebo and PX4."""
    from gyrotwin import api

    result = api.export_sensor(datasheet, formats=formats or (), sample_rate=sample_rate)
    result.save(out, force=force)
    for name in result.files:
        print(out / name)
