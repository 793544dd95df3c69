"""Where a free decay begins: a record may start before the device was let go, while a hand that nobody recorded moved
it."""

from collections.abc import Sequence
from typing import Final

import numpy as np

from discrepancy.data.record import Floats

QUIET: Final = 0.05
"""Of the largest motion, up to which the begin of a run is rest: a decay is largest where it begins."""
LEAD, FEWEST = 0.2, 16
"""Share of what lies before the largest motion, and samples at least, that must be at rest."""
HELD: Final = 0.99
"""Of the largest motion, the last sample of which is the begin: a hand holds it there for a while before it lets go."""


def released(v: Sequence[Floats]) -> int:
    """The first sample of the free motion in the channels ``v`` (n,) of a run without a force; 0 where the run does
    not begin at rest."""
    begin = 0
    for channel in v:
        known = np.flatnonzero(np.isfinite(channel))
        own = channel[known]
        if len(own) <= 2 * FEWEST:
            continue
        size = np.abs(own - own[:FEWEST].mean())
        lead = own[: max(int(LEAD * np.argmax(size)), FEWEST)]
        if np.abs(lead - lead.mean()).max() < QUIET * size.max():
            begin = max(begin, int(known[np.flatnonzero(size >= HELD * size.max())[-1]]))
    return begin
