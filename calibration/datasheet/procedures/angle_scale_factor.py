"""Scale factor of the angle: nonlinearity, asymmetry, threshold, from plateaus of the rate."""

from math import degrees

import numpy as np

from calibration.analysis.staircase import PPM, plateaus, staircase
from calibration.datasheet.figure import Curve, Figure, Outcome
from calibration.datasheet.procedure import WHOLE_ANGLE, Procedure
from cosim.angle_bench import AngleBench, stairs

SETTLING = 0.1
"""After a step of the rate the loop is followed by this time [s]: fifty of its slowest."""


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
    found = staircase(plateaus(one.t, one.angle, one.rate, SETTLING))
    figures = [
        Figure(
            "scale_factor",
            "scale factor",
            1 + found.scale_factor_ppm / PPM,
            "1",
            found.scale_factor_error_ppm / PPM,
            len(found.plateaus.rate),
            1.0,
            "the angle itself is measured, with the angular gain that the loop knows",
        ),
        Figure(
            "scale_factor_nonlinearity",
            "nonlinearity",
            found.nonlinearity_ppm,
            "ppm of full scale",
            float(found.plateaus.error.mean()) / bench.full_scale * PPM,
            len(found.plateaus.rate),
            0.0,
            "none",
            "at least",
            "largest departure from the line; noise adds to it",
        ),
        Figure(
            "scale_factor_asymmetry",
            "asymmetry",
            found.asymmetry_ppm,
            "ppm",
            found.asymmetry_error_ppm,
            len(found.plateaus.rate),
            0.0,
            "none",
        ),
        Figure("full_scale", "largest rate tried", degrees(bench.full_scale), "°/s"),
    ]
    curve = Curve(
        "scale_factor",
        "Departure from the scale factor's line",
        {"rate [°/s]": np.degrees(found.plateaus.rate), "residual [ppm of full scale]": found.residual_ppm},
    )
    return Outcome(figures, [curve])


PROCEDURE = Procedure("Scale factor", "12.9", WHOLE_ANGLE, measure, 4)
