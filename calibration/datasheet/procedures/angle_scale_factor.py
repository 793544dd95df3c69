"""Scale factor of the angle: nonlinearity, asymmetry, threshold, from plateaus of the rate."""

from math import degrees

import numpy as np

from calibration.characteristics.kinds.staircase import outcome
from calibration.datasheet.figure import Figure, Outcome
from calibration.datasheet.procedure import WHOLE_ANGLE, Procedure
from cosim.angle_bench import AngleBench, stairs


def measure(bench: AngleBench) -> Outcome:
    """One staircase."""
    if bench.refusal:
        return Outcome(reason=bench.refusal)
    up = np.linspace(0, bench.full_scale, bench.plan.steps + 1)
    rates = np.concatenate([[0.0], up, up[-2::-1], -up[1:], -up[-2::-1]])
    stays = bench.plan.plateau
    one = bench.record(stays * len(rates), stairs(rates, stays))
    if one.valid_at is None:
        return Outcome(reason=f"no valid angle: {one.reason}")
    found = outcome(one)
    full_scale = Figure("full_scale", "largest rate tried", degrees(bench.full_scale), "°/s")
    return found._replace(figures=[*found.figures, full_scale])


PROCEDURE = Procedure("Scale factor", "12.9", WHOLE_ANGLE, measure, 4)
