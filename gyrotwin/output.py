"""Folders of results: written whole or not at all."""

import os
import shutil
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path

from gyro_model.errors import InputError


def check_writable(folder: Path) -> None:
    """Raises InputError unless ``folder`` can be made or written, so that a long run does not end in nothing."""
    nearest_folder = next(path for path in (folder.absolute(), *folder.absolute().parents) if path.exists())
    if not (nearest_folder.is_dir() and os.access(nearest_folder, os.W_OK)):
        raise InputError(f"output folder {folder}: can't be written; name another with --out")


def publish(
    folder: Path, writers: Mapping[str, Callable[[Path], object]], sometimes: str = "", *, force: bool = False
) -> None:
    """Lets each writer write its file in a folder beside, then moves all of them into ``folder``: none half-written,
    none alone, and beside them none of the files ``sometimes`` (a pattern) that an earlier call had to write.

    Raises InputError where the folder can't be written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        beside = Path(tempfile.mkdtemp(prefix=".writing-", dir=folder))
    except OSError as error:
        raise InputError(f"output folder {folder}: {error.strerror}; name another with --out") from None
    try:
        for name, write in writers.items():
            (beside / name).parent.mkdir(exist_ok=True)
            write(beside / name)
        for name in writers:
            (folder / name).parent.mkdir(exist_ok=True)
            os.replace(beside / name, folder / name)
        for path in folder.glob(sometimes) if sometimes else ():
            if path.relative_to(folder).as_posix() not in writers:
                path.unlink()
    finally:
        shutil.rmtree(beside, ignore_errors=True)
