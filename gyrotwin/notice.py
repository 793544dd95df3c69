"""What a command says while it works on something that shows nothing by itself."""

import logging
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Final, TextIO

LOGGER: Final = logging.getLogger("gyrotwin")

PATIENCE: Final = 0.6
"""Silence a user bears without wondering [s]: well below the second within which each command must say something."""


@contextmanager
def said_if_slow(what: str) -> Iterator[None]:
    """Says ``what`` if the block takes longer than PATIENCE."""
    timer = threading.Timer(PATIENCE, LOGGER.info, (f"{what} ...",))
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()


def promise(what: str) -> None:
    """Says ``what`` if the program has shown nothing else within PATIENCE: see ``shown``."""
    global _promised
    shown()
    _promised = threading.Timer(PATIENCE, LOGGER.info, (f"{what} ...",))
    _promised.daemon = True
    _promised.start()


def shown() -> None:
    """Takes a promise back: something is shown, or the command is over."""
    if _promised is not None:
        _promised.cancel()


_promised: threading.Timer | None = None


class _Lines(logging.Handler):
    """Writes each message as a line to ``stream``; None: to stdout, wherever that leads at the time."""

    stream: TextIO | None = None

    def emit(self, record: logging.LogRecord) -> None:
        # Where nothing can be written, what the command itself writes will say so.
        with suppress(OSError, ValueError):
            print(f"gyrotwin: {record.getMessage()}", file=self.stream or sys.stdout, flush=True)


_HANDLER: Final = _Lines()


def show_messages(stream: TextIO | None = None) -> None:
    """Shows what the package logs, from INFO on, as lines of ``stream``; None: of stdout, which leaves stderr to what
    is wrong."""
    _HANDLER.stream = stream
    LOGGER.addHandler(_HANDLER)
    LOGGER.setLevel(logging.INFO)


def hide_messages() -> None:
    """Takes ``show_messages`` back."""
    LOGGER.removeHandler(_HANDLER)
    LOGGER.setLevel(logging.NOTSET)
