"""The second voltage channel is sampled later than the first: a multiplexed converter, or another filter.

v_y,k = v_y(t_k - δ). A delay common to both channels is one of the force, to which no sample gives another name.
"""

from collections.abc import Mapping

import numpy as np

from discrepancy.data.record import Floats
from discrepancy.fit.between import between
from discrepancy.fit.defect import Distortion, Timing
from gyro_model.quantities import size

DELAY = size("channel_delay", "s", "delay of the y channel after the x channel", low=-1e-4, high=1e-4)


def voltage(v: Floats, timing: Timing, p: Mapping[str, float]) -> Floats:
    """The voltage with its y channel late."""
    if v.shape[1] < 2:
        return v
    k = np.arange(len(v), dtype=np.float64)
    late = v.copy()
    late[:, 1] = between(v[:, 1], k - p["channel_delay"] / timing.period)
    return late


DEFECT = Distortion(
    id="channel_delay",
    parameters=(DELAY,),
    signature="a phase between the two channels in proportion to frequency",
    source="R. Pintelon, J. Schoukens, System Identification: A Frequency Domain Approach, 2012, section 2.5",
    voltage=voltage,
    axes=2,
)
