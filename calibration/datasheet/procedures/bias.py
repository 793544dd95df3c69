"""Bias at the reference temperature, and its repeatability from turn-on to turn-on."""

from math import degrees, sqrt

from calibration.datasheet.figure import Figure, Outcome, balanced, mean, spread
from calibration.datasheet.procedure import RATE, Procedure
from cosim.rate.allan import noise_limits
from cosim.rate.bench import Bench
from cosim.rate.metrics import PER_HOUR


def measure(bench: Bench) -> Outcome:
    """Over the turn-ons, each with its seed."""
    biases = [float(one.rate.mean()) for one in bench.turn_ons]
    bias, error = mean(biases)
    deviation, deviation_error = spread(biases)
    run, seconds = bench.typical, bench.plan.turn_on_duration
    walk = noise_limits(run.nominal, bench.reference_temperature, 1 / run.sample_rate).total
    bound = PER_HOUR * walk / sqrt(seconds)
    rule = "harmonic balance of the settled device"
    return Outcome(
        balanced(
            [
                Figure(
                    "bias",
                    "bias",
                    degrees(bias),
                    "°/s",
                    degrees(error or 0.0),
                    len(biases),
                    degrees(bench.expected().bias),
                    rule,
                ),
                Figure(
                    "bias_repeatability",
                    "turn-on repeatability of the bias",
                    PER_HOUR * deviation,
                    "°/h",
                    max(PER_HOUR * deviation_error, bound / sqrt(2 * (len(biases) - 1))),
                    len(biases),
                    bound,
                    "N/√T: angle random walk alone",
                    "at least",
                    f"standard deviation of means over {seconds:g} s",
                ),
            ],
            bench.left_out,
            [rule],
        )
    )


PROCEDURE = Procedure("Drift rate: bias", "12.11", RATE, measure)
