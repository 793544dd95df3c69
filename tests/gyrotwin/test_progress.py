"""Progress where nobody sees a bar."""

from io import StringIO

import pytest
from rich.console import Console

from gyrotwin import progress


def test_a_log_gets_a_line_now_and_then(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = [100.0]
    monkeypatch.setattr(progress, "monotonic", lambda: clock[0])
    log = StringIO()
    with progress.shown_progress(Console(file=log, width=80), "rate mode, 60 s") as tell:
        for second in range(61):
            clock[0] = 100.0 + second
            tell(float(second), 60.0)
    lines = log.getvalue().splitlines()
    assert lines[:3] == [
        "rate mode, 60 s ...",
        "rate mode, 60 s: 17% done, 50 s left",
        "rate mode, 60 s: 33% done, 40 s left",
    ]
    # At 60 s all is done.
    assert len(lines) == 6
