"""What a reader must know beside the figures of the angle, for the terminal and the report."""

from collections.abc import Mapping
from math import degrees
from typing import Any, Final

from cosim.recorder import UNKNOWN

LOST: Final = 0.999 * degrees(UNKNOWN)
"""Standard deviation of an angle [deg] from which the pattern may stand anywhere, but for rounding."""


def angle_remarks(summary: Mapping[str, Any]) -> list[str]:
    """Sentences about the angle of a run by its summary: that it is lost, and why figures are missing."""
    remarks = []
    if (summary["predicted"]["angle_sigma_deg"] or 0.0) > LOST:
        remarks.append(
            "The angle is lost: while the observer had lost the device, the force may have turned the pattern."
        )
    if summary["converged_at"] is not None and summary["angle"]["rms_deg"] is None:
        why = "from when it was valid first the trace holds fewer than two rows"
        remarks.append(f"The angle has no figures: {why}. Run longer, or give a higher --trace-rate.")
    return remarks
