"""`gyrotwin schema`."""

import json
from typing import Annotated

import typer


def schema(
    name: Annotated[
        str, typer.Argument(help="device, design, scenario, dataset, plan, criteria, limits, summary, report or fleet.")
    ],
) -> None:
    """Print the JSON Schema of a file format, by which an editor completes and checks what one types."""
    from gyrotwin import schemas

    print(json.dumps(schemas.schema(name), indent=2, allow_nan=False))
