"""Allan analysis of the output at rest: the five terms of IEEE Std 952, annex C, with intervals."""

import numpy as np
from scipy.signal import welch

from calibration.analysis.allan import rate_allan
from calibration.datasheet.allan_figures import curve, terms
from calibration.datasheet.figure import Curve, Outcome
from calibration.datasheet.procedure import RATE, Procedure
from cosim.rate.allan import noise_limits
from cosim.rate.bench import Bench
from cosim.rate.metrics import PER_ROOT_HOUR

ROWS = 10
"""Rows in a period of the output filter's bandwidth, at least."""
LINES = 20
"""Lines of the spectrum up to that bandwidth."""
SPECTRUM = 2400.0
"""Periods of the bandwidth in its record: 240 stretches, which know a density to 7 %."""


def measure(bench: Bench) -> Outcome:
    """Of all long records at rest."""
    records, run = bench.rest, bench.typical
    found = rate_allan(np.stack([one.rate for one in records]), records[0].interval, run.white_from)
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
    one = bench.record(SPECTRUM / bandwidth + bench.settling, output_rate=1 / row)
    rate = one.rate[int(bench.settling / row) :]
    frequency, density = welch(rate - rate.mean(), 1 / row, nperseg=min(LINES * ROWS, len(rate)))
    columns = {"frequency [Hz]": frequency[1:], "density [°/s/√Hz]": np.degrees(np.sqrt(density[1:] / 2))}
    return Curve("noise_spectrum", "Spectral density of the noise at rest", columns)


PROCEDURE = Procedure("Drift rate: random part", "12.11", RATE, measure, 20)
