"""Threshold and resolution: the smallest rate, and the smallest change of a rate, that the output shows (IEEE 528)."""

from math import degrees, sqrt

import numpy as np

from calibration.analysis.staircase import RESPONSE, SURE, staircase
from calibration.datasheet.figure import Figure, Outcome
from calibration.datasheet.procedure import RATE, Procedure
from calibration.datasheet.procedures.scale_factor import plateaus_of
from cosim.rate.allan import noise_limits
from cosim.rate.bench import Bench, steps

AVERAGE = 10.0
"""Time averaged at each rate [s]."""
OCTAVES = 9
BELOW = 2.0**-4
"""Rates tried go up in octaves from this times the bound."""


def measure(bench: Bench) -> Outcome:
    """A staircase of ever larger rates around zero, and around half of full scale."""
    run = bench.typical
    walk = noise_limits(run.nominal, bench.reference_temperature, 1 / run.sample_rate).total
    bound = SURE * walk / sqrt(AVERAGE)
    small = BELOW * bound * 2.0 ** np.arange(OCTAVES)
    figures = []
    for key, title, base in (("threshold", "threshold", 0.0), ("resolution", "resolution", 0.5 * bench.full_scale)):
        found = _smallest(bench, base, small)
        figures.append(
            Figure(
                key,
                title,
                None if found is None else degrees(found),
                "°/s",
                None if found is None else degrees(found) / 2,
                2 * OCTAVES,
                degrees(bound),
                f"2N/√T with T = {AVERAGE:g} s: two standard errors of the mean",
                "at least",
                f"smallest {'rate' if base == 0 else f'change at {degrees(base):.3g} °/s'} seen with at least "
                f"{100 * RESPONSE:g} % of it; rates tried double"
                if found
                else f"none up to {degrees(small[-1]):.3g} °/s is seen",
            )
        )
    return Outcome(figures)


def _smallest(bench: Bench, base: float, small: np.ndarray) -> float | None:
    rates = [base]
    for rate in small.tolist():
        rates += [base + rate, base - rate, base]
    stays = bench.stays(AVERAGE)
    one = bench.record(stays * len(rates), rate=steps(rates, stays), output_rate=20.0)
    found = plateaus_of(one, bench.settling)
    # Around a rate the output's mean there is the zero; the slow part of the noise goes with the neighbours at rest.
    return staircase(found._replace(rate=found.rate - base, measured=found.measured - found.measured[0])).threshold


PROCEDURE = Procedure("Threshold and resolution", "12.9", RATE, measure, 2)
