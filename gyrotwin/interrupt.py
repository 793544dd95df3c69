"""Ctrl-C as an exception of the program's own."""


class Interrupted(BaseException):
    """Ctrl-C. Not a KeyboardInterrupt, which typer would answer with words and an exit code of its own.

    ``left``: what the user finds on disk.
    """

    left = "nothing written"


def interrupt(number: int, frame: object) -> None:
    """The handler of SIGINT."""
    raise Interrupted
