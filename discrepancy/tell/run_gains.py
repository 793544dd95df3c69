"""Runs that differ by a gain, as after a range was switched: one model can not have them all."""

from collections.abc import Sequence
from typing import Final

import numpy as np

from discrepancy.data.record import Floats, Record

MOST: Final = 0.5
"""Of what is left, by which gains of the runs must take it to be spoken of."""


def unlike_gains(runs: Sequence[Record], residuals: Sequence[Floats]) -> str | None:
    """What to say where a factor of each run takes most of what a fit leaves; None where it does not.

    runs, residuals: of a fit of two runs or more, voltages and what is left of them (n, axes) [V].
    """
    gains, left, after = [], 0.0, 0.0
    for run, residual in zip(runs, residuals, strict=True):
        told, rest = (run.v - residual)[run.valid], residual[run.valid]
        square = float(np.sum(told**2))
        more = float(np.sum(rest * told)) / square if square > 0 else 0.0
        gains.append(1 + more)
        left += float(np.sum(rest**2))
        after += float(np.sum((rest - more * told) ** 2))
    if len(runs) < 2 or not np.isfinite(left) or left == 0 or after > (1 - MOST) * left:
        return None
    factors = ", ".join(f"{run.name} {gain:.5g}" for run, gain in zip(runs, gains, strict=True))
    return (
        f"the runs differ by a gain, which takes {1 - after / left:.0%} of what is left: {factors} times what the "
        "model says; state each run's gain, or look for what changed between them (a range, a supply, a temperature)"
    )
