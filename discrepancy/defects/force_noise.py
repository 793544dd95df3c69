"""The force was measured, and its channel has noise: the device answers to what acted, the model to what was recorded.

u_k = u(t_k) + n_k: errors in the input (T. Söderström, Errors-in-variables methods in system identification, Automatica
43, 2007). White n_k of rms σ shakes the model with the one-sided density 2 σ²/f_s, as a thermal force of density
4 k_B T d would shake the mass. Where the force does nothing its record shows the same noise: so it is told from a force
that is not in the record.
"""

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np
from scipy.signal import welch

from discrepancy.criteria import Criteria
from discrepancy.data.record import Record
from discrepancy.fit.defect import Disturbance, Level
from discrepancy.fit.fitted import Fitted
from discrepancy.fit.noise import BOLTZMANN, is_white, thermal
from gyro_model.quantities import size

WINDOWS: Final = 16
"""Of a run, for the spectrum of its force."""
QUIET: Final = 0.2
"""Share of the frequencies at which the drive does nothing, at the least: the floor is what is reached by so many. The
scatter of 31 half-overlapping windows puts that 15 % below the mean density, 8 % in rms."""
ALIKE: Final = 1.5
"""Ratio of the two rms up to which they are one: the first is known to the filter's settings, to some ten per cent."""

RMS = size("force_noise", "N", "rms of the noise in the recorded force a sample", low=0.0)


def find(at: Fitted, records: Sequence[Record], criteria: Criteria) -> Mapping[str, Level] | None:
    """The noise of the force's record, where it is what shakes the model too strongly for a thermal force."""
    level, floor = thermal(at, records), _floor(records)
    if level is None or level.low <= criteria.thermal or floor == 0:
        return None
    p, first = at.parameters, records[0]
    kelvin = float(np.mean([np.mean(r.conditions.get("temperature", p.get("t_ref", 298.15))) for r in records]))
    damping = float(np.mean([p[f"d{axis}{axis}"] for axis in "xy"[: first.axes]]))
    unit = float(np.sqrt(2 * BOLTZMANN * kelvin * damping * first.sample_rate))
    rms = unit * level.value
    if rms > ALIKE * floor or (rms < floor / ALIKE and not _may_be(at, records, criteria, rms)):
        return None
    return {"force_noise": Level(unit * level.value, unit * level.low, unit * level.high)}


def _may_be(at: Fitted, records: Sequence[Record], criteria: Criteria, rms: float) -> bool:
    """Whether a noise of ``rms`` [N] that is below all that the force's record shows may be in it."""
    force = float(np.sqrt(np.mean(np.concatenate([r.u.ravel() for r in records]) ** 2)))
    return rms <= criteria.faint_force * force and is_white(at, records, criteria)


def _floor(records: Sequence[Record]) -> float:
    """Rms a sample [N] of a white noise as dense as the forces of all runs are where they are quiet."""
    squares = []
    for record in records:
        density = welch(record.u, record.sample_rate, nperseg=len(record.t) // WINDOWS, axis=0)[1]
        squares.append(float(np.mean(np.quantile(density, QUIET, axis=0))) * record.sample_rate / 2)
    return float(np.sqrt(np.mean(squares)))


DEFECT = Disturbance(
    id="force_noise",
    parameters=(RMS,),
    signature="a motion that nothing drives, as strong as the floor of the recorded force would make it",
    source="T. Söderström, Automatica 43, 2007",
    find=find,
    instead=("thermal_force",),
)
