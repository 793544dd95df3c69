"""The five terms of an Allan analysis (IEEE Std 952, annex C) and its bottom as figures, and its curve."""

from math import degrees

import numpy as np

from calibration.analysis.allan import AngleAllan, Term, columns
from calibration.datasheet.figure import Curve, Figure
from cosim.rate.metrics import PER_HOUR, PER_ROOT_HOUR

SEEN = 3.0
"""A term is seen where its square is this many standard errors above zero."""


def terms(found: AngleAllan, records: int) -> list[Figure]:
    """The terms as figures, angle random walk second."""
    named = (
        ("quantisation", "quantisation (white angle noise)", found.angle_noise, degrees(1) * 3600, "″"),
        ("angle_random_walk", "angle random walk", found.angle_random_walk, PER_ROOT_HOUR, "°/√h"),
        ("flicker", "flicker term B", found.instability, PER_HOUR, "°/h"),
        ("rate_random_walk", "rate random walk", found.rate_random_walk, PER_HOUR * 60, "°/h/√h"),
        ("rate_ramp", "rate ramp", found.rate_ramp, PER_HOUR * 3600, "°/h²"),
    )
    figures = [
        Figure(name, title, scale * term.value, unit, scale * term.error, records, note=_note(term))
        for name, title, term, scale, unit in named
    ]
    figures.append(
        Figure(
            "bias_instability",
            "in-run bias instability",
            PER_HOUR * found.lowest.value,
            "°/h",
            PER_HOUR * found.lowest.error,
            records,
            note=f"bottom of the Allan deviation over 0.664, at {found.bias_instability_tau:.3g} s"
            if found.bias_instability is not None
            else f"at most: the deviation still falls at {found.tau[-1]:.3g} s",
        )
    )
    return figures


def curve(found: AngleAllan) -> Curve:
    """Deviation, its 95 % interval and the sum of the fitted terms."""
    fitted = (found.angle_noise, found.angle_random_walk, found.instability, found.rate_random_walk, found.rate_ramp)
    squares = np.array([term.value**2 for term in fitted])
    parts = {"deviation": found.deviation, "low": found.low, "high": found.high}
    fit = np.sqrt(columns(found.tau) @ squares)
    return Curve(
        "allan",
        "Allan deviation at rest",
        {"tau [s]": found.tau, **{f"{n} [°/h]": PER_HOUR * v for n, v in parts.items()}, "fit [°/h]": PER_HOUR * fit},
    )


def _note(term: Term) -> str:
    # The square is what is fitted: c² over its error is half of c over its own.
    return "" if term.value > 2 * SEEN * term.error else "not seen: the standard error says what would have been"
