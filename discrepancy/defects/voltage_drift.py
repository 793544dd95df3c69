"""The sensor wanders while a run lasts, another way in each: curves far slower than all that drives the device.

G. E. P. Box, G. M. Jenkins, G. C. Reinsel, Time Series Analysis, 2008, section 4.1: a deterministic trend.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from discrepancy.criteria import Criteria
from discrepancy.data.record import Record
from discrepancy.fit.defect import Disturbance, Level
from discrepancy.fit.fitted import Fitted
from gyro_model.quantities import size

RMS = size("voltage_drift", "V", "rms of the drift about its mean, in the run that drifts most", low=0.0)


def find(at: Fitted, records: Sequence[Record], criteria: Criteria) -> Mapping[str, Level] | None:
    """The rms of what was taken out of the voltage (``data/wander.py``)."""
    drifts = [record.drift for record in records if record.drift]
    if not drifts:
        return None
    rms = max(float(own.taken.std(axis=0).max()) for own in drifts)
    # Of noise the curves take as much as they are numbers.
    width = 1.96 * float(np.sqrt(at.variance * max((own.order + 1) / len(own.taken) for own in drifts)))
    return {"voltage_drift": Level(rms, max(rms - width, 0.0), rms + width)}


DEFECT = Disturbance(
    id="voltage_drift",
    parameters=(RMS,),
    signature="slow curves, another in each run, far below all that drives the device",
    source="G. E. P. Box, G. M. Jenkins, G. C. Reinsel, Time Series Analysis, 2008, section 4.1",
    find=find,
)
