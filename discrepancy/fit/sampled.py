"""Initial states as the samples themselves show them: near the true ones however far from linear the motion is, where a
fit from rest finds another motion."""

from collections.abc import Mapping
from itertools import product
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
SLOW: Final = (0.0, 0.15, 0.8)
"""Of the place, rms, by which it may be off for want of its slow part: of speeds it is off by 0.05, of accelerations by
0.3 (rms, under a force from a tenth of the resonance on)."""
SHARES: Final = (0.0, -0.25, 0.25, -0.5, 0.5, -1.0, 1.0)
"""Of that, to be added."""


def sampled_starts(run: Record, here: int, period: float, parameters: Mapping[str, float]) -> list[dict[str, float]]:
    """Places and speeds of each axis, [m], [m/s], that a sample of a ``run`` may show, the likeliest first, of a motion
    of so many samples a ``period``: one where a sensor sees places, more where the slow part of these is lost. None
    where samples about it are masked."""
    reach = max(int(REACH * period), (DEGREE + 1) // 2)
    around = max(int(AROUND * period), reach) if run.order else reach
    begin, end = max(here - around, 0), min(here + around + 1, len(run.t))
    if not run.valid[begin:end].all():
        return []
    axes = []
    for axis, v in zip("xy", run.v[begin:end].T, strict=False):
        place = v * run.reference**run.order / parameters[f"sense_gain_{axis}"]
        for _ in range(run.order):
            place = detrend(cumulative_trapezoid(place, initial=0.0)) / run.sample_rate
        first = max(here - begin - reach, 0)
        x, slope = _at(place[first : here - begin + reach + 1], here - begin - first)
        slow = SLOW[run.order] * float(np.std(place))
        speed = {f"{axis}_dot_start": slope * run.sample_rate}
        axes.append([{f"{axis}_start": x + share * slow} | speed for share in (SHARES if slow else SHARES[:1])])
    return [{name: value for own in some for name, value in own.items()} for some in product(*axes)]


def _at(samples: Floats, here: int) -> tuple[float, float]:
    """Value of the curve through samples at one of them, and its slope by the sample."""
    far = max(here, len(samples) - 1 - here)
    # Scaled, since powers of what is far are large.
    places, degree = (np.arange(len(samples)) - here) / far, min(DEGREE, len(samples) - 1)
    curve = np.polynomial.Polynomial.fit(places, samples, degree, domain=[-1, 1], window=[-1, 1])
    return float(curve(0.0)), float(curve.deriv()(0.0)) / far
