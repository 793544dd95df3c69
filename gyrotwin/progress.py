"""A progress bar with the time left; in a log, a line now and then."""

from collections.abc import Iterator
from contextlib import contextmanager
from time import monotonic
from typing import Final

import rich.progress
from rich.console import Console
from rich.progress import BarColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from gyro_model.progress import Progress
from gyrotwin.notice import shown

LINE_EVERY: Final = 10.0
"""Time between the lines in a log [s]: nobody takes a command for dead that long, and an hour is 360 of them."""


@contextmanager
def shown_progress(console: Console, title: str) -> Iterator[Progress]:
    """Shows a bar while the block runs; gives what to call with the time reached and the duration [s]."""
    shown()
    if not console.is_terminal:
        console.print(f"{title} ...", highlight=False, markup=False)
        yield _told(console, title)
        return
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
    )
    with rich.progress.Progress(*columns, console=console, transient=True) as bar:
        task = bar.add_task(title, total=None)
        yield lambda reached, duration: bar.update(task, completed=reached, total=duration)


def _told(console: Console, title: str) -> Progress:
    """Prints share done and time left, at most a line in LINE_EVERY."""
    begun = last = monotonic()

    def tell(reached: float, duration: float) -> None:
        nonlocal last
        now = monotonic()
        if now - last < LINE_EVERY or not 0.0 < reached < duration:
            return
        last = now
        left = (now - begun) * (duration / reached - 1.0)
        console.print(f"{title}: {reached / duration:.0%} done, {left:.0f} s left", highlight=False, markup=False)

    return tell
