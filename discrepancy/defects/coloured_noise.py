"""The noise of a channel is not white: it went through a filter or comes from one, and each sample says something of
the next.

An autoregression, as ``discrepancy/fit/colour.py`` finds it: G. E. P. Box, G. M. Jenkins, G. C. Reinsel, Time Series
Analysis, 2008, section 3.2.
"""

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np
from scipy.linalg import toeplitz

from discrepancy.criteria import Criteria
from discrepancy.data.record import Floats, Record
from discrepancy.fit.colour import SCATTER, gain, response
from discrepancy.fit.defect import Disturbance, Level
from discrepancy.fit.fitted import Fitted
from discrepancy.fit.whitening import misfit_under
from gyro_model.quantities import size

ALONE: Final = 0.5
"""Share of the frequencies at which the noise is seen alone, as a rule: the device moves at the others."""
STEP: Final = 1e-4
"""Of a number, for a difference quotient: rounding leaves 1e-11 of it."""

RMS = size("coloured_noise", "V", "rms of the coloured noise a sample", low=0.0)


def find(at: Fitted, records: Sequence[Record], criteria: Criteria) -> Mapping[str, Level] | None:
    """The rms of the noise whose colour the fit's likelihood knows."""
    setting = at.whiten.setting
    if not setting.colour:
        return None
    period, valid = 1 / records[0].sample_rate, [r.valid for r in records]
    white = misfit_under(at.parameters, period, setting, at.residuals, valid)[1]
    rms = float(np.sqrt(white * gain(setting.colour)))
    width = float(np.exp(1.96 * _spread(np.array(setting.colour), at.count)))
    return {"coloured_noise": Level(rms, rms / width, rms * width)}


def _spread(numbers: Floats, count: int) -> float:
    """Standard deviation of the logarithm of the rms: of a mean square, and of what the numbers say of it (the
    covariance of an autoregression's numbers: Box, Jenkins, Reinsel, section 7.2)."""
    turns = np.linspace(0, np.pi, 4097)
    density = 1 / np.abs(response(numbers.tolist(), turns)) ** 2
    independent = count * float(np.mean(density) ** 2 / np.mean(density**2))
    correlation = [float(np.mean(density * np.cos(k * turns))) for k in range(len(numbers))]
    steps = np.log(
        [[gain((numbers + side * step).tolist()) for side in (-1, 1)] for step in STEP * np.eye(len(numbers))]
    )
    slope = (steps[:, 1] - steps[:, 0]) / (2 * STEP)
    of_numbers = float(slope @ np.linalg.solve(toeplitz(correlation), slope)) / (ALONE * count / SCATTER)
    return float(np.sqrt(0.5 / independent + 0.25 * of_numbers))


DEFECT = Disturbance(
    id="coloured_noise",
    parameters=(RMS,),
    signature="noise whose density rises or falls where the device does not move",
    source="G. E. P. Box, G. M. Jenkins, G. C. Reinsel, Time Series Analysis, 2008, section 3.2",
    find=find,
)
