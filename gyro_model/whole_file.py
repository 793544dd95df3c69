"""Files that are there complete or not at all."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from secrets import token_hex
from typing import BinaryIO


@contextmanager
def whole_file(path: Path) -> Iterator[BinaryIO]:
    """A file to write, which becomes ``path`` where nothing was raised; an older one is replaced whole, and the folder
    made where there is none. Raises OSError where it can't be written."""
    path.parent.mkdir(parents=True, exist_ok=True)
    # A name that nobody can have laid a link under, and that a folder of results may hold.
    beside = path.parent / f".writing-{token_hex(8)}"
    try:
        with beside.open("xb") as file:
            yield file
        os.replace(beside, path)
    finally:
        beside.unlink(missing_ok=True)
