"""What a command says while it works on something that shows nothing by itself."""

import logging
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

PATIENCE: Final = 0.6
"""Silence a user bears without wondering [s]: well below the second within which each command must say something."""


@contextmanager
def said_if_slow(what: str) -> Iterator[None]:
    """Prints ``what`` on stderr if the block takes longer than PATIENCE."""
    timer = threading.Timer(PATIENCE, lambda: print(f"gyrotwin: {what} ...", file=sys.stderr, flush=True))
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()


class _Stderr(logging.Handler):
    """Writes each message as a line on stderr, wherever that leads at the time."""

    def emit(self, record: logging.LogRecord) -> None:
        print(f"gyrotwin: {record.getMessage()}", file=sys.stderr, flush=True)


def show_messages() -> None:
    """Shows what the package logs, from INFO on, as lines on stderr."""
    logger = logging.getLogger("gyrotwin")
    if not any(isinstance(handler, _Stderr) for handler in logger.handlers):
        logger.addHandler(_Stderr())
    logger.setLevel(logging.INFO)
