"""At rest: drift, and the Allan deviation of the angle (IEEE Std 952, annex C)."""

from math import degrees

import numpy as np

from calibration.analysis.allan import angle_allan
from calibration.analysis.staircase import slope_with_error
from calibration.characteristics.kind import SETTLING, Course, Kind, longest_valid
from calibration.datasheet.allan_figures import curve, terms
from calibration.datasheet.figure import Figure, Outcome
from cosim.angle_record import AngleRecord

ROWS = 1000.0
"""Rows a second that the Allan deviation is made of [Hz]: shorter times show the noise of a sample alone."""


def measure(record: AngleRecord, course: Course) -> Outcome:
    """Of the longest part that is valid throughout."""
    assert course.main is not None
    one = longest_valid(record, course.main, SETTLING)
    error = one.angle - one.true
    drift, drift_error = slope_with_error(one.t, error)
    interval = float(np.median(np.diff(one.t)))
    every = max(round(1 / (ROWS * interval)), 1)
    found = angle_allan(error[::every], every * interval)
    figures = [
        Figure(
            "bias", "drift at rest", degrees(drift), "°/s", degrees(drift_error), note=f"over {np.ptp(one.t):.3g} s"
        ),
        *terms(found, 1),
    ]
    return Outcome(figures, [curve(found)])


def is_rest(course: Course) -> bool:
    """Whether the rate is zero for most of the run."""
    return course.main is not None and course.main.rate == 0


KIND = Kind("Rest: drift and Allan deviation", is_rest, measure)
