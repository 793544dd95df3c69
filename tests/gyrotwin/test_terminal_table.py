"""Tables in a narrow terminal."""

import io

from rich.console import Console

from gyrotwin.terminal_table import Table


def test_a_narrow_terminal_cuts_no_number_off() -> None:
    table = Table("name", "value", "interval")
    table.add_row("stiffness of x", "63.955123", "63.9551 to 63.9552")
    shown = io.StringIO()
    Console(file=shown, width=24).print(table)
    text = shown.getvalue()
    assert "…" not in text
    columns = [line.split("│")[1:-1] for line in text.splitlines() if line.startswith("│")]
    cells = ["".join(part.strip() for part in column) for column in zip(*columns, strict=True)]
    assert cells[1] == "63.955123"
