"""`gyrotwin build`."""

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from gyro_model.platforms import NAMES
from gyrotwin.notice import said_if_slow
from gyrotwin.progress import shown_progress


def build(
    force: Annotated[bool, typer.Option("--force", help="Build even where the FMUs are up to date.")] = False,
    platforms: Annotated[
        str,
        typer.Option(
            help=f"Libraries for other platforms too, by zig: all, or some of {', '.join(NAMES)}. wasm32-wasip2 is a "
            "WebAssembly component in the FMUs for FMI 3.0, wasm32 a module beside them."
        ),
    ] = "",
    ssp: Annotated[
        Path | None, typer.Option(help="Also a system structure package (SSP) with the parameters of each device.")
    ] = None,
) -> None:
    """Build the FMUs Gyroscope, GyroscopeEnvelope, GyroscopeSensor and GyroscopeClocked, and print where they are."""
    from gyrotwin import api

    if platforms:
        console = Console()
        console.print(
            "compiling for each platform, at first up to two minutes each for zig's own libraries", highlight=False
        )
        with shown_progress(console, "build") as progress:
            paths = api.build(force=force, platforms=platforms, progress=progress)
    else:
        with said_if_slow("compiling seven FMUs, some 10 s"):
            paths = api.build(force=force)
    for path in paths:
        print(path)
    if ssp is not None:
        from gyro_model.ssp import build_ssp

        # The first two are Gyroscope for FMI 2.0 and 3.0; more tools that read SSP know the former.
        print(build_ssp(paths[0], ssp))
