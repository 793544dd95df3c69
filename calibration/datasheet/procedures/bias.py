"""Bias at the reference temperature, and its repeatability from turn-on to turn-on."""

from math import degrees, sqrt

from calibration.datasheet.figure import Figure, Outcome, balanced, mean, spread
from calibration.datasheet.procedure import RATE, Procedure
from cosim.rate.bench import Bench
from cosim.rate.metrics import PER_HOUR


def measure(bench: Bench) -> Outcome:
    """Over the turn-ons, each with its seed."""
    biases = [float(one.rate.mean()) for one in bench.turn_ons]
    seconds = bench.plan.turn_on_duration
    noise = bench.angle_random_walk / sqrt(seconds)
    bias, error = mean(biases, noise)
    deviation, deviation_error = spread(biases)
    bound = PER_HOUR * noise
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
