"""Plateaus of the rate: scale factor, nonlinearity, asymmetry, threshold (terms as in IEEE Std 528)."""

from math import degrees

import numpy as np
from scipy.stats import norm

from calibration.analysis.staircase import PPM, RESPONSE, plateaus, staircase
from calibration.characteristics.kind import SETTLING, Course, Kind
from calibration.datasheet.figure import Curve, Figure, Outcome
from cosim.angle_record import AngleRecord

RATES = 3
"""A line and what it leaves need so many rates."""


def largest_of(count: int) -> float:
    """Median of the largest of ``count`` magnitudes of normal noise, over its standard deviation."""
    return float(norm.ppf((1 + 0.5 ** (1 / count)) / 2))


def outcome(one: AngleRecord) -> Outcome:
    """Of the plateaus through which the angle was valid."""
    found = staircase(plateaus(one.t, np.where(one.valid, one.angle, np.nan), one.rate, SETTLING))
    count, full_scale = len(found.plateaus.rate), float(np.abs(found.plateaus.rate).max())
    noise = float(found.plateaus.error.mean()) / full_scale * PPM
    threshold = found.threshold
    figures = [
        Figure(
            "scale_factor",
            "scale factor",
            1 + found.scale_factor_ppm / PPM,
            "1",
            found.scale_factor_error_ppm / PPM,
            count,
            1.0,
            "the angle itself is measured, with the angular gain that the loop knows",
        ),
        Figure("scale_factor_error", "its error", found.scale_factor_ppm, "ppm", found.scale_factor_error_ppm, count),
        Figure(
            "scale_factor_bias", "rate at which the line is zero", degrees(found.bias), "°/s", degrees(found.bias_error)
        ),
        Figure(
            "scale_factor_nonlinearity",
            "nonlinearity",
            found.nonlinearity_ppm,
            "ppm of full scale",
            noise,
            count,
            noise * largest_of(count),
            "the noise of the plateaus alone: the median of the largest of as many",
            "at most",
            "largest departure from the line",
        ),
        Figure(
            "scale_factor_asymmetry",
            "asymmetry",
            found.asymmetry_ppm,
            "ppm",
            found.asymmetry_error_ppm,
            count,
            0.0,
            "none",
        ),
        Figure(
            "threshold",
            "threshold",
            None if threshold is None else degrees(threshold),
            "°/s",
            None,
            count,
            note=f"smallest rate of the plateaus from which on all show at least {100 * RESPONSE:g} % of it"
            if threshold is not None
            else "the largest rate is not seen",
        ),
    ]
    curve = Curve(
        "scale_factor",
        "Departure from the scale factor's line",
        {"rate [°/s]": np.degrees(found.plateaus.rate), "residual [ppm of full scale]": found.residual_ppm},
    )
    return Outcome(figures, [curve])


def measure(record: AngleRecord, course: Course) -> Outcome:
    """Of all plateaus; a note says how many were not valid throughout."""
    found = outcome(record)
    left_out = len(course.stretches) - found.figures[0].tests
    if not left_out:
        return found
    note = f"{left_out} of {len(course.stretches)} plateaus left out: the angle was not valid throughout"
    first = found.figures[0]._replace(note=note)
    return found._replace(figures=[first, *found.figures[1:]])


def is_staircase(course: Course) -> bool:
    """Whether the rate stands still for most of the run, at three values or more."""
    still = sum(one.duration for one in course.stretches)
    return len({one.rate for one in course.stretches}) >= RATES and still >= course.duration / 2


KIND = Kind("Staircase: scale factor, linearity, threshold", is_staircase, measure)
