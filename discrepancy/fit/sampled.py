"""Initial states as the samples themselves show them: near the true ones however far from linear the motion is, where a
fit from rest finds another motion."""

from collections.abc import Mapping
from typing import Final

import numpy as np
from scipy.integrate import cumulative_trapezoid
from scipy.signal import detrend

from discrepancy.data.record import Floats, Record

DEGREE: Final = 5
"""Of the polynomial through the samples about an instant."""
REACH: Final = 1 / 6
"""Of a period, to either side of it: of a sine the slope is right to 2e-4, of one of twice that frequency to 1 %."""
AROUND: Final = 3.0
"""Periods to either side, over which speeds and accelerations are integrated, a straight line taken out."""


def sampled_start(run: Record, here: int, period: float, parameters: Mapping[str, float]) -> dict[str, float] | None:
    """Place and speed of each axis, [m], [m/s], at a sample of a ``run``, of a motion of so many samples a ``period``;
    None where samples about it are masked. Of speeds and accelerations the slow part of the place is lost."""
    reach = max(int(REACH * period), (DEGREE + 1) // 2)
    around = max(int(AROUND * period), reach) if run.order else reach
    begin, end = max(here - around, 0), min(here + around + 1, len(run.t))
    if not run.valid[begin:end].all():
        return None
    found: dict[str, float] = {}
    for axis, v in zip("xy", run.v[begin:end].T, strict=False):
        place = v * run.reference**run.order / parameters[f"sense_gain_{axis}"]
        for _ in range(run.order):
            place = detrend(cumulative_trapezoid(place, initial=0.0)) / run.sample_rate
        first = max(here - begin - reach, 0)
        x, slope = _at(place[first : here - begin + reach + 1], here - begin - first)
        found |= {f"{axis}_start": x, f"{axis}_dot_start": slope * run.sample_rate}
    return found


def _at(samples: Floats, here: int) -> tuple[float, float]:
    """Value of the curve through samples at one of them, and its slope by the sample."""
    far = max(here, len(samples) - 1 - here)
    # Scaled, since powers of what is far are large.
    places = (np.arange(len(samples)) - here) / far
    degree = min(DEGREE, len(samples) - 1)
    curve = np.polynomial.Polynomial.fit(places, samples, degree, domain=[-1, 1], window=[-1, 1])
    return float(curve(0.0)), float(curve.deriv()(0.0)) / far
