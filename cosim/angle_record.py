"""The record of the angle of a run in whole-angle mode."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cosim.layout import PARAMETER_NAMES
from cosim.recorder import Result
from cosim.run import Run

Floats = NDArray[np.float64]


class AngleRecord(NamedTuple):
    """A record from the first valid angle on: t [s]; angle and true angle [rad], unwrapped; true rate [rad/s]; pattern:
    where the pattern stands against x, by what the loop knows [rad], unwrapped; valid: whether the angle was; shapes
    (n,). valid_at: from power on [s], None where the angle never was valid; reason: why not; estimates: of the seven
    parameters at the end."""

    t: Floats
    angle: Floats
    true: Floats
    rate: Floats
    pattern: Floats
    valid: NDArray[np.bool_]
    valid_at: float | None
    reason: str
    estimates: dict[str, float]

    def between(self, begin: float, end: float) -> "AngleRecord":
        """The rows from ``begin`` on and before ``end`` [s]."""
        rows = slice(*np.searchsorted(self.t, [begin, end]).tolist())
        columns = {name: getattr(self, name)[rows] for name in ("t", "angle", "true", "rate", "pattern", "valid")}
        return self._replace(**columns)


def angle_record(run: Run, result: Result) -> AngleRecord:
    """Of a run that is done, by its angle unit, in the rows of its trace that are in memory."""
    trace = result.trace
    valid = trace["converged"].to_numpy() & np.isfinite(trace["angle"].to_numpy())
    first = int(np.argmax(valid)) if valid.any() else len(valid)
    t, angle, true, rate, turned = (
        trace[name].to_numpy()[first:] for name in ("t", "angle", "angle_true", "omega_true", "turned")
    )
    # The pattern stays behind as the package turns; the angle is the pattern's over the gain that the loop knows.
    zero = result.units[run.scenario.angle_unit].zero
    pattern = zero + turned - run.design.all_values["angular_gain"] * angle
    estimates = {name: float(trace[f"est_{name}"][-1]) for name in PARAMETER_NAMES}
    valid_at = result.converged_at if valid.any() else None
    return AngleRecord(t, angle, true, rate, pattern, valid[first:], valid_at, result.validity.reason, estimates)
