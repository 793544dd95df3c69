"""What a benchmark of diagnoses reports: how often what is there is named alone with its sizes, misfits and times."""

from collections.abc import Sequence
from typing import Final

import numpy as np

from benchmarks.report import Report, Row, Table, row, spread
from benchmarks.structures import SHARE, Outcome

CLOSE: Final = 0.05
"""Of a size, by which what is found may be off: a judgement."""
VALUES: Final = ("refit", "final", "over noise", "size off", "s", "s of processor")


def report_of(name: str, title: str, outcomes: Sequence[Outcome], kinds: Sequence[str], note: str) -> Report:
    """The share that came out right, over all and of those whose description holds each of ``kinds``, the spread of
    VALUES, and each outcome."""
    rows = []
    for kind in ("", *kinds):
        own = [outcome for outcome in outcomes if kind in outcome.what]
        right = {"share": sum(outcome.right for outcome in own) / max(len(own), 1)}
        what = f"named alone, sizes to {CLOSE:.0%}{', ' if kind else ''}{kind}"
        rows.append(Row(what, "1", right, None if kind else SHARE, at_least=True, note=f"of {len(own)}"))
    spreads = [row(value, "", spread(o.values.get(value, np.inf) for o in outcomes)) for value in VALUES]
    each = [row(o.what, "", o.values, note=o.said) for o in outcomes]
    return Report(name, title, [Table("all", rows), Table("spread", spreads), Table("each", each)], [note])
