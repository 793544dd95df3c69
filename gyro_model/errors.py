"""The one exception for input that a user can mend, and the hint that names the nearest valid name."""

import re
from collections.abc import Iterable
from difflib import get_close_matches


class InputError(ValueError):
    """Input that can't be used.

    The message is one line that names what is wrong, the value and the remedy; the command line
    prints it alone and ends with exit code 2.
    """


def nearest(name: str, valid: Iterable[str]) -> str:
    """``"; did you mean 'kxx'?"`` with the valid name nearest to ``name`` but for its case, or ``""`` if none is."""
    names = {own.lower(): own for own in reversed(list(valid))}
    matches = get_close_matches(name.lower(), names, n=1)
    return f"; did you mean {names[matches[0]]!r}?" if matches else ""


def one_line(error: BaseException) -> str:
    """Kind and message of what a user's own file has raised, on one line and without the colours of a terminal."""
    text = re.sub(r"\x1b\[[0-9;]*m", "", str(error))
    return f"{type(error).__name__}: {' '.join(text.split())}"
