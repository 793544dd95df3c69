"""Input rate limits: how far beyond full scale the output keeps to its line."""

from math import degrees

from calibration.analysis.staircase import Plateaus, staircase
from calibration.datasheet.figure import Figure, Outcome
from calibration.datasheet.procedure import RATE, Procedure
from calibration.datasheet.procedures.scale_factor import plateaus_of
from cosim.rate.bench import Bench, steps
from gyro_model.errors import InputError

MULTIPLES = (1.0, 1.5, 2.0, 3.0, 5.0, 10.0)
"""Rates tried, over full scale."""
DEAD = 0.05
"""An output with less of its nominal scale factor follows no rate: a line through it is the noise's."""
DEPARTURE = 0.01
"""The output has left its line where it is off by this much of the rate."""


def measure(bench: Bench) -> Outcome:
    """Plateaus beyond full scale, beside the line through those within. Raises InputError where the drive loses its
    lock within full scale."""
    found, locked = _plateaus(bench)
    inside = abs(found.rate) <= bench.full_scale * (1 + 1e-9)
    line = staircase(type(found)(*(values[inside] for values in found)))
    scale, bias = 1 + line.scale_factor_ppm / 1e6, line.bias
    largest, end = None, "no larger one was tried"
    if abs(scale) < DEAD:
        locked, end = (), f"the output has {scale:.3g} of its nominal scale factor: it follows no rate"
    elif len(locked) < len(MULTIPLES):
        end = "at the next larger one tried the drive loses its lock"
    for multiple in locked:
        here = abs(abs(found.rate) - multiple * bench.full_scale) < 1e-6 * bench.full_scale
        off = abs(found.measured[here] - scale * found.rate[here] - bias) > DEPARTURE * multiple * bench.full_scale
        if not here.any() or off.any():
            end = "the next larger one tried is off" if largest else "full scale itself is off"
            break
        largest = multiple * bench.full_scale
    return Outcome(
        [
            Figure("full_scale", "full scale", degrees(bench.full_scale), "°/s", note="as the device file says"),
            Figure(
                "input_limit",
                "largest rate on the line",
                None if largest is None else degrees(largest),
                "°/s",
                None,
                len(found.rate),
                degrees(bench.full_scale),
                "full scale",
                "at least",
                f"within {100 * DEPARTURE:g} % of the rate; {end}",
            ),
        ]
    )


def _plateaus(bench: Bench) -> tuple[Plateaus, tuple[float, ...]]:
    """The plateaus, and the multiples of full scale among them: as many as the drive keeps its lock through."""
    stays, lost = bench.stays(bench.plan.plateau), InputError("")
    for count in range(len(MULTIPLES), 0, -1):
        tried = MULTIPLES[:count]
        rates = [0.0, *(sign * multiple * bench.full_scale for multiple in tried for sign in (1.0, -1.0))]
        course = steps(rates, stays)
        try:
            one = bench.record(stays * len(rates), rate=course, output_rate=50.0, wide=2 * MULTIPLES[-1])
        except InputError as error:
            lost = error
        else:
            return plateaus_of(one, bench.settling), tried
    raise lost


PROCEDURE = Procedure("Input rate limits", "12.10", RATE, measure)
