"""Sensitivity of the bias to a steady acceleration of the package along x and y."""

from math import degrees
from typing import Final

from calibration.datasheet.figure import Figure, Outcome, mean
from calibration.datasheet.procedure import RATE, Procedure
from cosim.rate.bench import Bench
from gyro_model.units import STANDARD_GRAVITY

EFFECT: Final = "linear_acceleration"


def measure(bench: Bench) -> Outcome:
    """Half the difference of the bias at +1 g and at -1 g."""
    effect = next((e for e in bench.device.model.effects if e.id == EFFECT), None)
    if effect is None or not bench.device.acts(effect):
        return Outcome(
            reason="the device file says nothing of acceleration: set acceleration_gain_x, acceleration_gain_y"
        )
    figures = []
    for axis in "xy":
        half = []
        for seed in bench.seeds(bench.plan.repeats):
            low, high = (
                bench.record(bench.plan.turn_on_duration, seed=seed, held={f"a_{axis}": sign * STANDARD_GRAVITY}).rate
                for sign in (-1.0, 1.0)
            )
            # The same seed draws the same noise: it drops out of the difference.
            half.append(degrees(float((high - low).mean())) / 2)
        value, error = mean(half)
        figures.append(
            Figure(
                f"acceleration_{axis}",
                f"bias by acceleration along {axis}",
                value,
                "°/s/g",
                error,
                len(half),
                0.0,
                "no bias in a linear device: an acceleration is not at the drive frequency",
            )
        )
    return Outcome(figures)


PROCEDURE = Procedure("Drift rate: acceleration", "12.11", RATE, measure)
