"""Modes in whole-angle mode: what the observer finds while it runs."""

from math import hypot

from calibration.datasheet.figure import Figure, Outcome, mean
from calibration.datasheet.procedure import WHOLE_ANGLE, Procedure
from cosim.angle_bench import AngleBench
from cosim.rate.free_decay import linear_modes


def measure(bench: AngleBench) -> Outcome:
    """From the estimates at the end of the records at rest."""
    if bench.refusal:
        return Outcome(reason=bench.refusal)
    p = bench.device.all_parameters
    true, found = _of(p, p), [_of(p, one.estimates) for one in bench.rest]
    names = (
        ("mode_frequency_lower", "frequency of the lower mode", "Hz"),
        ("mode_split", "split of the modes", "Hz"),
        ("damping_asymmetry", "asymmetry of the damping over its mean", "1"),
    )
    figures = []
    for (key, title, unit), values, expected in zip(names, zip(*found, strict=True), true, strict=True):
        value, error = mean(values)
        figures.append(Figure(key, title, value, unit, error, len(values), expected, "eigenvalues of m s² + D s + K"))
    return Outcome(figures)


def _of(p: dict[str, float], estimates: dict[str, float]) -> tuple[float, float, float]:
    own = {**p, **estimates}
    low, high = linear_modes(own)
    return (
        low.frequency,
        high.frequency - low.frequency,
        hypot(own["dxx"] - own["dyy"], 2 * own["dxy"]) / (own["dxx"] + own["dyy"]),
    )


PROCEDURE = Procedure("Modes as estimated", "12.2", WHOLE_ANGLE, measure)
