"""Input rate limits: how far beyond full scale the output keeps to its line."""

from math import degrees

from calibration.analysis.staircase import staircase
from calibration.datasheet.figure import Figure, Outcome
from calibration.datasheet.procedure import RATE, Procedure
from calibration.datasheet.procedures.scale_factor import plateaus_of
from cosim.rate.bench import Bench, steps

MULTIPLES = (1.0, 1.5, 2.0, 3.0, 5.0, 10.0)
"""Rates tried, over full scale."""
DEPARTURE = 0.01
"""The output has left its line where it is off by this much of the rate."""


def measure(bench: Bench) -> Outcome:
    """Plateaus beyond full scale, beside the line through those within."""
    rates = [0.0]
    for multiple in MULTIPLES:
        rates += [multiple * bench.full_scale, -multiple * bench.full_scale]
    stays = bench.stays(bench.plan.plateau)
    one = bench.record(stays * len(rates), rate=steps(rates, stays), output_rate=50.0, wide=2 * MULTIPLES[-1])
    found = plateaus_of(one, bench.settling)
    inside = abs(found.rate) <= bench.full_scale * (1 + 1e-9)
    line = staircase(type(found)(*(values[inside] for values in found)))
    scale, bias = 1 + line.scale_factor_ppm / 1e6, line.bias
    largest = bench.full_scale
    for multiple in MULTIPLES:
        here = abs(abs(found.rate) - multiple * bench.full_scale) < 1e-6 * bench.full_scale
        off = abs(found.measured[here] - scale * found.rate[here] - bias) > DEPARTURE * multiple * bench.full_scale
        if not here.any() or off.any():
            break
        largest = multiple * bench.full_scale
    further = largest >= MULTIPLES[-1] * bench.full_scale * (1 - 1e-9)
    return Outcome(
        [
            Figure("full_scale", "full scale", degrees(bench.full_scale), "°/s", note="as the device file says"),
            Figure(
                "input_limit",
                "largest rate on the line",
                degrees(largest),
                "°/s",
                None,
                len(found.rate),
                degrees(bench.full_scale),
                "full scale",
                "at least",
                f"within {100 * DEPARTURE:g} % of the rate; "
                + ("no larger one was tried" if further else "the next larger one tried is off"),
            ),
        ]
    )


PROCEDURE = Procedure("Input rate limits", "12.10", RATE, measure)
