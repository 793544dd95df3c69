"""`gyrotwin export`."""

from pathlib import Path
from typing import Annotated

import typer

from gyrotwin.notice import said_if_slow

export_app = typer.Typer(no_args_is_help=True, help="What was measured, for other programs.")


@export_app.callback()
def group() -> None:
    """What was measured, for other programs."""


@export_app.command()
def sensor(
    datasheet: Annotated[Path, typer.Argument(metavar="DATASHEET.json", help="As `gyrotwin datasheet` wrote it.")],
    formats: Annotated[
        list[str] | None,
        typer.Option("--format", help="fmu, kalibr, gnss_ins_sim, matlab, gazebo or px4; repeatable; default: all."),
    ] = None,
    sample_rate: Annotated[float, typer.Option(help="At which the sensor is read there, Hz.")] = 100.0,
    out: Annotated[Path, typer.Option(help="Folder for the files.")] = Path("results/sensor"),
    force: Annotated[bool, typer.Option("--force", help="Write even into a folder that holds other files.")] = False,
) -> None:
    """Write the sensor of a datasheet as an FMU, and as files of Kalibr, gnss-ins-sim, MATLAB, Gazebo and PX4.

    GyroscopeSensor.fmu, in fmi2/ and fmi3/, takes rate, acceleration, temperature and supply at steps of any length and
    gives the rate, analogue and sampled at the sample rate, with scale factor, nonlinearity, bias over temperature with
    its lag and hysteresis, bandwidth, noise and turn-on as the datasheet has them. They are its parameters.
    """
    from gyrotwin import api

    with said_if_slow("fitting the sensor's bandwidth and temperature curve, at first compiling its FMU"):
        result = api.export_sensor(datasheet, formats=formats or (), sample_rate=sample_rate)
        result.save(out, force=force)
    for name in result.writers():
        print(out / name)
    for text in result.doubts:
        print(f"warning: {text}")
