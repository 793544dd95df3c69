"""What the drive loop holds and finds at rest, and the quadrature that the sense axis feels."""

from math import degrees, sqrt

from calibration.datasheet.figure import Figure, Outcome, balanced, mean
from calibration.datasheet.procedure import RATE, Procedure
from cosim.rate.bench import Bench


def measure(bench: Bench) -> Outcome:
    """Means over the turn-ons, beside the harmonic balance."""
    expected, records = bench.expected(), bench.turn_ons
    rule = "harmonic balance of the settled device"
    rows = (
        (
            "drive_frequency",
            "drive frequency",
            "Hz",
            [one.frequency.mean() for one in records],
            expected.drive_frequency,
        ),
        ("drive_force", "drive force", "nN", [1e9 * one.force.mean() for one in records], 1e9 * expected.drive_force),
        (
            "quadrature",
            "quadrature",
            "°/s",
            [degrees(one.quadrature.mean()) for one in records],
            degrees(expected.quadrature),
        ),
    )
    figures = []
    # The phase of the demodulator tells rate from quadrature: noise is the same in both.
    known = {"quadrature": degrees(bench.angle_random_walk) / sqrt(bench.plan.turn_on_duration)}
    for name, title, unit, values, true in rows:
        value, error = mean(values, known.get(name, 0.0))
        figures.append(Figure(name, title, value, unit, error, len(values), true, rule))
    voltage = bench.typical.nominal.calibration.drive.voltage
    value, error = mean([one.amplitude.mean() for one in records])
    figures.append(
        Figure(
            "drive_amplitude",
            "drive amplitude at the pickoff",
            value,
            "V",
            error,
            len(records),
            voltage,
            "what the amplitude loop is set to",
        )
    )
    return Outcome(balanced(figures, bench.left_out, [rule]))


PROCEDURE = Procedure("Drive and quadrature", "12.2", RATE, measure, 2)
