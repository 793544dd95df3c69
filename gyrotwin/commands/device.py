"""`gyrotwin device`."""

from pathlib import Path
from typing import Annotated

import typer

from gyro_model.device import Device, write_device
from gyro_model.errors import InputError

device_app = typer.Typer(no_args_is_help=True, help="Device files.")


@device_app.callback()
def group() -> None:
    """Device files."""


@device_app.command()
def new(
    frequency: Annotated[float, typer.Option(help="Frequency of the lower mode, Hz.")],
    split: Annotated[float, typer.Option(help="The other mode lies above it by this, Hz.")],
    q: Annotated[float, typer.Option("--q", help="Quality factor of the lower mode.")],
    mass: Annotated[float, typer.Option(help="Proof mass, kg.")],
    axis_angle: Annotated[float | None, typer.Option(help="From x to the axis of the lower mode, degrees.")] = None,
    q_upper: Annotated[float | None, typer.Option(help="Quality factor of the upper mode.")] = None,
    gain: Annotated[float | None, typer.Option(help="Of both pickoffs, V/m.")] = None,
    noise: Annotated[float | None, typer.Option(help="White noise of both pickoffs, V rms a sample.")] = None,
    gap: Annotated[float | None, typer.Option(help="Of the sensing capacitors, m: makes the pickoff curved.")] = None,
    name: Annotated[str, typer.Option(help="Name of the device.")] = "my_device",
    out: Annotated[Path | None, typer.Option(help="File to write; default NAME.toml.")] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace an existing file.")] = False,
) -> None:
    """Write a device file from what a designer knows; says what it assumes of the rest."""
    if out is None and Path(name).name != name:
        raise InputError(f"--name {name}: is a path; name the device here and its file with --out")
    path = out or Path(f"{name}.toml")
    if path.exists() and not force:
        raise InputError(f"device file {path}: exists; name another with --out or replace it with --force")
    device = Device.from_designer(
        frequency=frequency, split=split, q=q, mass=mass, axis_angle=axis_angle or 0.0, q_upper=q_upper, gain=gain,
        noise=noise, gap=gap, name=name,
    )  # fmt: skip
    default = device.all_parameters["sense_gain_x"]
    assumed = [
        text
        for given, text in (
            (axis_angle, "axis angle 0 deg: the lower mode along x (--axis-angle)"),
            (q_upper, f"Q {q:g} of the upper mode, as of the lower (--q-upper)"),
            (gain, f"pickoff gain {default:g} V/m (--gain)"),
            (noise, "no noise of the pickoff (--noise)"),
            (gap, "a pickoff linear in the displacement (--gap)"),
        )
        if given is None
    ]
    given = f"From frequency {frequency:g} Hz, split {split:g} Hz, Q {q:g}, mass {mass:g} kg."
    write_device(device, path, "\n".join([given, *(f"Assumed: {text}." for text in assumed)]))
    print(f"wrote {path}")
    for text in assumed:
        print(f"assumed: {text}")
