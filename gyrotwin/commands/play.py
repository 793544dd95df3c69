"""`gyrotwin play`."""

import webbrowser
from pathlib import Path
from typing import Annotated

import typer

from gyrotwin.notice import said_if_slow


def play(
    device: Annotated[str, typer.Option(help="What swings: packaged device by name, or a device file.")] = "pendulum",
    effects: Annotated[
        list[Path] | None, typer.Option(metavar="DIR", help="Folder of further effect files; repeatable.")
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder for play.html.")] = Path("results/play"),
    show: Annotated[bool, typer.Option("--open", help="Open the page in the browser.")] = False,
    force: Annotated[bool, typer.Option("--force", help="Write even into a folder that holds other files.")] = False,
) -> None:
    """Write a page that runs the FMU itself: orbit, spectrum, ring-down, a slider for every effect, a game."""
    from gyrotwin import api
    from gyrotwin.output import check_writable
    from gyrotwin.playing.page import FILE

    check_writable(out, force=force)
    with said_if_slow("trying every effect on the native FMU, some 10 s"):
        page = api.play(device, effects=effects or ())
    path = page.save(out, force=force) / FILE
    print(f"{path}: {page.summary['bytes'] / 1e3:.0f} kB; open it in any browser")
    if show:
        webbrowser.open(path.absolute().as_uri())
