"""Allan analysis of the angle at rest, with the five terms of IEEE Std 952, annex C."""

import numpy as np

from calibration.analysis.allan import rate_allan
from calibration.datasheet.allan_figures import curve, terms
from calibration.datasheet.figure import Outcome
from calibration.datasheet.procedure import WHOLE_ANGLE, Procedure
from cosim.angle_bench import ROWS, AngleBench


def measure(bench: AngleBench) -> Outcome:
    """Of all records at rest, each from its first valid angle on."""
    if bench.refusal:
        return Outcome(reason=bench.refusal)
    errors = [one.angle - one.true for one in bench.rest]
    rows = min(map(len, errors))
    found = rate_allan(np.stack([np.diff(error[-rows:]) * ROWS for error in errors]), 1 / ROWS)
    return Outcome(terms(found, len(errors)), [curve(found)])


PROCEDURE = Procedure("Drift rate: random part", "12.11", WHOLE_ANGLE, measure)
