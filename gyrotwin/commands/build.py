"""`gyrotwin build`."""

from pathlib import Path
from typing import Annotated

import typer

from gyro_model.platforms import NAMES
from gyrotwin.notice import said_if_slow


def build(
    force: Annotated[bool, typer.Option("--force", help="Build even where the FMUs are up to date.")] = False,
    platforms: Annotated[
        str, typer.Option(help="Libraries for other platforms too, by zig: all, or some of " + ", ".join(NAMES) + ".")
    ] = "",
    ssp: Annotated[
        Path | None, typer.Option(help="Also a system structure package (SSP) with the parameters of each device.")
    ] = None,
) -> None:
    """Build the FMUs Gyroscope, GyroscopeEnvelope, GyroscopeSensor and GyroscopeClocked, and print where they are."""
    from gyrotwin import api

    time = "some minutes at first, most of them for zig's own libraries" if platforms else "some 10 s"
    with said_if_slow(f"compiling seven FMUs, {time}"):
        paths = api.build(force=force, platforms=platforms)
    for path in paths:
        print(path)
    if ssp is not None:
        from gyro_model.ssp import build_ssp

        # The first two are Gyroscope for FMI 2.0 and 3.0; more tools that read SSP know the former.
        print(build_ssp(paths[0], ssp))
