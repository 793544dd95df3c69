"""A progress bar with the time left."""

from collections.abc import Iterator
from contextlib import contextmanager

import rich.progress
from rich.console import Console
from rich.progress import BarColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from gyro_model.progress import Progress
from gyrotwin.notice import shown


@contextmanager
def shown_progress(console: Console, title: str) -> Iterator[Progress]:
    """Shows a bar while the block runs; gives what to call with the time reached and the duration [s]."""
    shown()
    if not console.is_terminal:
        console.print(f"{title} ...", highlight=False, markup=False)
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
