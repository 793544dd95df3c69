"""Allan analysis of the output at rest: the five terms of IEEE Std 952, annex C, with intervals."""

from math import degrees, pi

import numpy as np
from scipy.signal import welch

from calibration.analysis.allan import AngleAllan, Term, columns, rate_allan
from calibration.datasheet.figure import Curve, Figure, Outcome
from calibration.datasheet.procedure import RATE, Procedure
from cosim.rate.allan import FLAT, MEMORIES, noise_limits
from cosim.rate.bench import Bench
from cosim.rate.filters import delay
from cosim.rate.metrics import PER_HOUR, PER_ROOT_HOUR
from cosim.rate.run import RateRun

SEEN = 3.0
"""A term is seen where its square is this many standard errors above zero."""


ROWS = 10
"""Rows in a period of the output filter's bandwidth, at least."""
LINES = 20
"""Lines of the spectrum up to that bandwidth."""
SPECTRUM = 2400.0
"""Periods of the bandwidth in its record: 240 stretches, which know a density to 7 %."""


def measure(bench: Bench) -> Outcome:
    """Of all long records at rest."""
    records, run = bench.rest, bench.typical
    shortest = MEMORIES * delay_of(run)
    found = rate_allan(np.stack([one.rate for one in records]), records[0].interval, shortest)
    walk = noise_limits(run.nominal, bench.reference_temperature, 1 / run.sample_rate).total
    figures = terms(found, len(records))
    rule = "√(thermal² + electronics²): √(k_B T/(mωQA²))/λ, and the noise of the pickoff over its scale factor"
    if bench.other_noises:
        rule += f"; {', '.join(bench.other_noises)} add to it"
    how = "at least" if bench.other_noises else "equals"
    figures[1] = figures[1]._replace(expected=PER_ROOT_HOUR * walk, rule=rule, how=how)
    return Outcome(figures, [curve(found), spectrum(bench)])


def spectrum(bench: Bench) -> Curve:
    """Density of a record at rest, of means over its rows; one-sided frequencies, two-sided density, as N has it."""
    run = bench.typical
    bandwidth = run.settings.output_bandwidth
    row = run.period * max(int(1 / (ROWS * bandwidth * run.period)), 1)
    one = bench.record(SPECTRUM / bandwidth, output_rate=1 / row)
    rate = one.rate[int(bench.settling / row) :]
    frequency, density = welch(rate - rate.mean(), 1 / row, nperseg=min(LINES * ROWS, len(rate)))
    columns = {"frequency [Hz]": frequency[1:], "density [°/s/√Hz]": np.degrees(np.sqrt(density[1:] / 2))}
    return Curve("noise_spectrum", "Spectral density of the noise at rest", columns)


def delay_of(run: RateRun) -> float:
    """How much the output filter, and a closed sense loop, delay slow rates [s]."""
    loop = 1 / (2 * pi * run.settings.sense_bandwidth) if run.closed else 0.0
    return delay(run.settings.output_bandwidth) + loop


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
    lowest = PER_HOUR * float(found.deviation.min()) / FLAT
    seen = found.bias_instability
    figures.append(
        Figure(
            "bias_instability",
            "in-run bias instability",
            lowest if seen is None else PER_HOUR * seen,
            "°/h",
            None,
            records,
            note=f"bottom of the Allan deviation over 0.664, at {found.bias_instability_tau:.3g} s"
            if seen is not None
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


PROCEDURE = Procedure("Drift rate: random part", "12.11", RATE, measure, 20)
