"""Warm-up: what the output still does after it is there, at a steady ambient temperature."""

from math import hypot

import numpy as np

from calibration.datasheet.figure import Figure, Outcome, mean
from calibration.datasheet.procedure import RATE, Procedure
from cosim.rate.bench import Bench
from cosim.rate.metrics import PER_HOUR

FIRST = 0.02
LAST = 0.25
"""Shares of the long record at rest that are its begin and its end."""
PIECES = 50
SURE = 4.0


def measure(bench: Bench) -> Outcome:
    """Of the long records at rest: begin less end, and when the mean over turn-ons is the end's within its errors."""
    pieces = np.array([[block.mean() for block in np.array_split(one.rate, PIECES)] for one in bench.rest])
    begin, end = pieces[:, : int(FIRST * PIECES)], pieces[:, int((1 - LAST) * PIECES) :]
    # What neighbouring pieces differ by is noise; a trend is not in it.
    scatter = float(np.sqrt(np.mean(np.diff(pieces, axis=1) ** 2) / 2))
    noise = scatter / len(pieces) ** 0.5
    known = PER_HOUR * scatter * hypot(begin.shape[1] ** -0.5, end.shape[1] ** -0.5)
    drift, error = mean(PER_HOUR * (begin.mean(axis=1) - end.mean(axis=1)), known)
    course = pieces.mean(axis=0) - end.mean()
    outside = np.flatnonzero(np.abs(course) > SURE * hypot(noise, noise / end.shape[1] ** 0.5))
    duration = bench.rest[0].interval * len(bench.rest[0].rate)
    step = duration / PIECES
    last = int(outside[-1]) + 1 if len(outside) else 0
    settled = last < PIECES
    return Outcome(
        [
            Figure(
                "warm_up_drift",
                "drift after turn-on",
                drift,
                "°/h",
                error,
                len(pieces),
                0.0,
                "no drift where nothing in the device warms up",
                note=f"first {FIRST * duration:.4g} s less last {LAST * duration:.4g} s of {duration:.4g} s",
            ),
            Figure(
                "warm_up_time",
                "warm-up time",
                last * step if settled else None,
                "s",
                step,
                len(pieces),
                note=f"from when on means over {step:.3g} s stay within 4 standard errors of the end"
                if settled
                else f"still drifts at the end, after {duration:.4g} s",
            ),
        ]
    )


PROCEDURE = Procedure("Warm-up time", "12.6", RATE, measure)
