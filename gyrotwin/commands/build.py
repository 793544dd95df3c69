"""`gyrotwin build`."""

from typing import Annotated

import typer

from gyro_model.platforms import NAMES
from gyrotwin.notice import said_if_slow


def build(
    force: Annotated[bool, typer.Option("--force", help="Build even where the FMUs are up to date.")] = False,
    platforms: Annotated[
        str, typer.Option(help="Libraries for other platforms too, by zig: all, or some of " + ", ".join(NAMES) + ".")
    ] = "",
) -> None:
    """Build the FMUs Gyroscope and GyroscopeEnvelope, FMI 2.0 and FMI 3.0, and print where they are."""
    from gyrotwin import api

    with said_if_slow(f"compiling four FMUs{', a minute or two at first' if platforms else ', some 10 s'}"):
        paths = api.build(force=force, platforms=platforms)
    for path in paths:
        print(path)
