"""Folders of results: written whole or not at all, by one run at a time, and never over somebody else's files."""

import hashlib
import os
import shutil
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from fnmatch import fnmatch
from pathlib import Path
from typing import IO, Final

import polars as pl

from gyro_model.errors import InputError

OWN: Final = (
    *("summary.json", "trace.parquet", "sense.parquet", "track.csv", "report.html", "report.json", "compensation.*"),
    *("design.toml", "device.toml", "fmi2.fmu", "fmi3.fmu", "effects", "search.checkpoint", "plan.toml", "rows*"),
    *("rate.checkpoint", "datasheet.checkpoint"),
    *("sweep.json", "datasheet.json", "match.json", "sensor_*", "fmi2", "fmi3", "play.html", ".writing-*"),
    *("fleet.json", "devices", "row.json", "next-*.csv"),
)
"""Names that commands write, as patterns; whatever else lies in a folder is the user's."""
SHOWN: Final = 3
"""Foreign files that a refusal names."""

_held: dict[Path, IO[str]] = {}
"""Locks of the folders that this process works on."""


def check_writable(folder: Path, *, force: bool = False) -> None:
    """Raises InputError unless ``folder`` can be made or written, holds no foreign file (with ``force`` it may), and no
    other run works on it; from then on it is this run's, until ``publish`` or the end of the process. So a long run
    does not end in nothing.
    """
    there = next(path for path in (folder.absolute(), *folder.absolute().parents) if path.exists())
    if not (there.is_dir() and os.access(there, os.W_OK)):
        raise InputError(f"output folder {folder}: can't be written; name another with --out")
    foreign = foreign_files(folder)
    if foreign and not force:
        named = ", ".join(foreign[:SHOWN]) + (f" and {len(foreign) - SHOWN} more" if len(foreign) > SHOWN else "")
        raise InputError(
            f"output folder {folder}: holds {named}, which no command writes; name another with --out, or --force"
        )
    _hold(folder)


def foreign_files(folder: Path) -> list[str]:
    """Names in ``folder`` that no command writes."""
    try:
        names = sorted(path.name for path in folder.iterdir()) if folder.is_dir() else []
    except OSError as error:
        raise InputError(f"output folder {folder}: {error.strerror}; name another with --out") from None
    return [name for name in names if not any(fnmatch(name, pattern) for pattern in OWN)]


def _hold(folder: Path) -> None:
    """Takes the lock of ``folder``. It lies outside of it, so that nothing is left there; the system frees it when the
    process ends, however that happens."""
    place = folder.absolute().resolve()
    if place in _held:
        return
    user = os.getuid() if hasattr(os, "getuid") else os.environ.get("USERNAME", "")
    locks = Path(tempfile.gettempdir()) / f"gyrotwin-{user}"
    try:
        locks.mkdir(mode=0o700, exist_ok=True)
        file = (locks / hashlib.sha256(str(place).encode()).hexdigest()[:24]).open("a", encoding="utf-8")
    except OSError:
        return  # without a temporary folder there is nothing to lock by
    if not _lock(file):
        file.close()
        raise InputError(f"output folder {folder}: another run writes to it; wait for it, or name another with --out")
    _held[place] = file


def _lock(file: IO[str]) -> bool:
    """Whether the lock is taken."""
    try:
        if sys.platform == "win32":
            import msvcrt

            msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)
        else:
            import fcntl

            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    return True


def _release(folder: Path) -> None:
    file = _held.pop(folder.absolute().resolve(), None)
    if file is not None:
        file.close()


def publish(
    folder: Path, writers: Mapping[str, Callable[[Path], object]], sometimes: Sequence[str] = (), *, force: bool = False
) -> None:
    """Lets each writer write its file in a folder beside, then moves all of them into ``folder``: none half-written,
    none alone, and beside them none of the files ``sometimes`` (patterns) that an earlier call had to write.

    Raises InputError where the folder can't be written, is full, is in use, or holds foreign files without ``force``.
    """
    check_writable(folder, force=force)
    made = not folder.exists()
    beside = None
    try:
        folder.mkdir(parents=True, exist_ok=True)
        beside = Path(tempfile.mkdtemp(prefix=".writing-", dir=folder))
        for name, write in writers.items():
            (beside / name).parent.mkdir(exist_ok=True)
            write(beside / name)
        for name in writers:
            (folder / name).parent.mkdir(exist_ok=True)
            os.replace(beside / name, folder / name)
        for path in (path for pattern in sometimes for path in folder.glob(pattern)):
            if path.relative_to(folder).as_posix() not in writers:
                path.unlink()
    except (OSError, pl.exceptions.PolarsError) as error:
        said = getattr(error, "strerror", None) or str(error).splitlines()[0]
        raise InputError(f"output folder {folder}: {said}; nothing written; name another with --out") from None
    finally:
        if beside is not None:
            shutil.rmtree(beside, ignore_errors=True)
        if made and folder.is_dir() and not any(folder.iterdir()):
            folder.rmdir()
        _release(folder)
