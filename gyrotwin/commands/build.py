"""`gyrotwin build`."""

from typing import Annotated

import typer

from gyrotwin.notice import said_if_slow


def build(
    force: Annotated[bool, typer.Option("--force", help="Build even where the FMUs are up to date.")] = False,
) -> None:
    """Build the FMUs Gyroscope and GyroscopeEnvelope, FMI 2.0 and FMI 3.0, and print where they are."""
    from gyrotwin import api

    with said_if_slow("compiling four FMUs, some 10 s"):
        paths = api.build(force=force)
    for path in paths:
        print(path)
