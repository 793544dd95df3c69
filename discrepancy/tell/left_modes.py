"""Further modes in what a fit leaves: beside friction, or another strong effect, the runs themselves show none."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from discrepancy.data.modes import answering, apart
from discrepancy.data.record import Floats, Record


def left_modes(runs: Sequence[Record], residuals: Sequence[Floats], known: Sequence[float]) -> str | None:
    """What to say where most of what a fit leaves answers to the force as modes do; None where it does not.

    runs, residuals: of a fit, and what is left of their voltages (n, axes) [V]; known: frequencies [Hz] of modes that
    the model has.
    """
    if not all(np.isfinite(residual).all() for residual in residuals):
        return None
    left = [replace(run, v=residual) for run, residual in zip(runs, residuals, strict=True)]
    found = [mode for mode in answering(left) if all(apart(mode.frequency, own) for own in known)]
    if not found:
        return None
    where = ", ".join(f"{mode.frequency:.4g} Hz (Q {mode.quality:.2g})" for mode in found)
    return (
        f"what is left answers to the force as modes that the model does not have: {where}; "
        "limit force and record to the band of the modes you want, or see what the sensor sees beside the mass"
    )
