"""Bias over the pattern's angle, from a spin (the drift rate test series in whole-angle mode)."""

from math import degrees

import numpy as np

from calibration.characteristics.kinds.spin import outcome
from calibration.datasheet.figure import Figure, Outcome, mean, spread
from calibration.datasheet.procedure import WHOLE_ANGLE, Procedure
from cosim.angle_bench import AngleBench, spinning
from cosim.rate.metrics import PER_HOUR


def measure(bench: AngleBench) -> Outcome:
    """Drift at rest of each record, and its course as the pattern goes round."""
    if bench.refusal:
        return Outcome(reason=bench.refusal)
    drifts = [float(np.polyfit(one.t - one.t[0], one.angle - one.true, 1)[0]) for one in bench.rest]
    bias, error = mean(drifts)
    repeats, repeats_error = spread(drifts)
    plan = bench.plan
    one = bench.record(plan.spin_duration, spinning(plan.spin_rate, plan.spin_duration))
    figures = [
        Figure(
            "bias",
            "drift at rest",
            degrees(bias),
            "°/s",
            degrees(error or 0.0),
            len(drifts),
            0.0,
            "a loop that removes all anisotropy",
        ),
        Figure(
            "bias_repeatability",
            "turn-on repeatability of the drift",
            PER_HOUR * repeats,
            "°/h",
            PER_HOUR * repeats_error,
            len(drifts),
        ),
    ]
    if one.valid_at is None:
        return Outcome(figures, reason=f"spin: no valid angle: {one.reason}")
    found = outcome(one, f"spin at {plan.spin_rate:g} rad/s")
    return Outcome([*figures, *found.figures], found.curves)


PROCEDURE = Procedure("Drift rate: bias", "12.11", WHOLE_ANGLE, measure, 4)
