"""`gyrotwin device`."""

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from gyro_model.device import design_device, write_device
from gyro_model.errors import InputError

device_app = typer.Typer(no_args_is_help=True, help="Device files.")
console = Console()


@device_app.callback()
def group() -> None:
    """Device files."""


@device_app.command()
def new(
    frequency: Annotated[float, typer.Option(help="Frequency of the lower mode, Hz.")],
    split: Annotated[float, typer.Option(help="The other mode lies above it by this, Hz.")],
    q: Annotated[float, typer.Option("--q", help="Quality factor of both modes.")],
    axis_angle: Annotated[float, typer.Option(help="From x to the axis of the lower mode, degrees.")],
    mass: Annotated[float, typer.Option(help="Proof mass, kg.")],
    name: Annotated[str, typer.Option(help="Name of the device.")] = "my_device",
    out: Annotated[Path | None, typer.Option(help="File to write; default NAME.toml.")] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace an existing file.")] = False,
) -> None:
    """Write a device file from what a designer knows."""
    path = out or Path(f"{name}.toml")
    if path.exists() and not force:
        raise InputError(f"device file {path}: exists; name another with --out or replace it with --force")
    device = design_device(name, frequency=frequency, split=split, q=q, axis_angle=axis_angle, mass=mass)
    note = (
        f"From frequency {frequency:g} Hz, split {split:g} Hz, Q {q:g}, "
        f"axis angle {axis_angle:g} deg, mass {mass:g} kg.\n"
        "Sensor gains and noise are the FMU's start values until set here."
    )
    write_device(device, path, note)
    console.print(f"wrote {path}", soft_wrap=True, highlight=False)
