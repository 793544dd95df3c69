"""Tables in the terminal."""

import rich.table
from rich.console import Console, ConsoleOptions, RenderResult


class Table(rich.table.Table):
    """A table whose cells go on in the next line where the terminal is narrow: a number that is cut off is none."""

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        for column in self.columns:
            column.overflow = "fold"
        yield from super().__rich_console__(console, options)
