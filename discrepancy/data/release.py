"""Where a free decay begins: a record may start before the device was let go, while a hand or a drive that nobody
recorded moved it."""

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


PERIODS, BLOCKS = 4, (20, 100)
"""Of a block whose loudness is one of the envelope's points, and how many of these there are, at least and at most."""
STEADY, FEWEST_STEADY = 0.03, 0.08
"""Of the largest loudness, up to which a drive holds it, and share of the run for which it does at least: a device that
was let go loses as much again in the next such while."""
FALLS: Final = 0.2
"""Of the largest loudness that is lost within as long after."""
AT_ONCE, NOT_YET = 0.5, 0.1
"""Times the mean rate of that loss, at which it begins at least, and is in the second half of the while before at most:
a beat goes by smoothly."""


def cut_off(v: Sequence[Floats]) -> int:
    """The first sample of the free motion in the channels ``v`` (n,) of a run without a force, which begins under a
    drive that holds it or makes it louder; 0 where it does not."""
    own = max((np.nan_to_num(channel - np.nanmedian(channel)) for channel in v), key=np.ptp)
    power = np.abs(np.fft.rfft(own * np.hanning(len(own)))) ** 2
    length = max(round(PERIODS * len(own) / max(int(np.argmax(power)), 1)), len(own) // BLOCKS[1], 1)
    number = len(own) // length
    if number < BLOCKS[0]:
        return 0
    weight = np.hanning(length + 2)[1:-1]
    loud = np.sqrt((own[: number * length].reshape(number, length) ** 2) @ weight)
    steady = loud >= (1 - STEADY) * loud.max()
    last = int(np.flatnonzero(steady)[-1])
    held = int(np.argmin(np.append(steady[last::-1], False)))
    after = loud[last : last + held + 1]
    if held < max(FEWEST_STEADY * number, 3) or len(after) < 4 or loud[last] - after.min() < FALLS * loud.max():
        return 0
    logs = np.log(after)
    rate = (logs[1] - logs[-1]) / (len(after) - 2)
    half = held // 2
    before = np.log(loud[last - half] / loud[last]) / half
    at_once = logs[1] - logs[2] > AT_ONCE * rate and before < NOT_YET * rate
    return (last + 2) * length if at_once else 0
