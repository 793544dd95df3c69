"""The pattern goes round, by a constant rate or electronically: bias over its angle."""

from math import degrees, hypot

import numpy as np

from calibration.analysis.spin import ROUND, spin
from calibration.characteristics.kind import SETTLING, Course, Kind, longest_valid
from calibration.datasheet.figure import Curve, Figure, Outcome
from cosim.angle_record import AngleRecord


def outcome(one: AngleRecord, note: str) -> Outcome:
    """Of a record through which the rate is constant."""
    found = spin(one.t, one.angle - one.true, one.pattern)
    mean = Figure(
        "bias_mean",
        "bias, mean over the pattern's angle",
        degrees(found.mean),
        "°/s",
        degrees(found.mean_error),
        note=f"{note}; {found.rounds:.3g} rounds of 180°",
    )
    harmonics = [
        Figure(
            f"bias_harmonic_{one.order}",
            f"bias over the pattern's angle, harmonic {one.order}",
            degrees(one.amplitude),
            "°/s",
            degrees(hypot(one.cosine_error, one.sine_error)),
            note=f"{note}; largest at {degrees(one.angle):.3g}° from x",
        )
        for one in found.harmonics
    ]
    curve = Curve(
        "spin",
        "Bias over the pattern's angle",
        {
            "pattern [°]": np.degrees(found.pattern),
            "bias [°/s]": np.degrees(found.rate_error),
            "bias error [°/s]": np.degrees(found.spread),
        },
    )
    return Outcome([mean, *harmonics], [curve])


def measure(record: AngleRecord, course: Course) -> Outcome:
    """Of the longest part that is valid throughout."""
    assert course.main is not None
    one = longest_valid(record, course.main, SETTLING)
    return outcome(one, f"rate {course.main.rate:.3g} rad/s")


def is_spin(course: Course) -> bool:
    """Whether the pattern is turned once round while the rate stands still, for most of the run."""
    return course.main is not None and course.main.turned >= ROUND


KIND = Kind("Spin: bias over the pattern's angle", is_spin, measure)
