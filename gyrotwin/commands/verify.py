"""`gyrotwin verify`."""

from pathlib import Path
from typing import Annotated

import typer

from gyrotwin.notice import said_if_slow


def verify(
    fmu: Annotated[Path, typer.Argument(help="An FMU, of this or any other tool, that brings reference traces.")],
) -> None:
    """Replay the reference traces that an FMU brings and print how far its outputs are off; exit code 1: too far."""
    from gyro_model.platforms import own_platform, platform_of, platforms_of
    from gyrotwin import api

    with said_if_slow("replaying reference traces"):
        residuals = api.verify(fmu)
    for r in residuals:
        verdict = "ok" if r.met else "OFF"
        print(f"{r.experiment:32} {r.output:12} {r.found:9.2e}  allowed {r.allowed.relative:8.1e}  {verdict}")
    ours = platform_of(own_platform())
    others = sorted(platforms_of(fmu) - {ours.fmi2, ours.fmi3})
    print(f"Played: the library for {ours.fmi3}" + (f"; not those for {', '.join(others)}." if others else "."))
    reasons = dict.fromkeys(r.allowed.reason for r in residuals)
    print("Relative to the largest value of each reference. What is allowed:", *reasons, sep="\n  ")
    if not all(r.met for r in residuals):
        raise typer.Exit(1)
