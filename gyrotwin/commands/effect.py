"""`gyrotwin effect`."""

from pathlib import Path
from typing import Annotated

import typer

effect_app = typer.Typer(no_args_is_help=True, help="Parts of your own: effects, observers, controllers, scenarios.")


@effect_app.callback()
def group() -> None:
    """Parts of your own: effects, observers, controllers, scenarios."""


@effect_app.command()
def check(
    path: Annotated[Path, typer.Argument(metavar="FILE|DIR", help="Effect, observer, controller or scenario.")],
) -> None:
    """Check that a part fulfils what the packaged ones do; where it does not, say why."""
    from gyrotwin import contract

    for line in contract.check(path):
        print(line)
