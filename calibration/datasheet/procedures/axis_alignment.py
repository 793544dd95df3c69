"""Alignment of the input axis: not in this model."""

from calibration.datasheet.figure import Outcome
from calibration.datasheet.procedure import MODES, Procedure


def measure(bench: object) -> Outcome:
    """Says why there is none."""
    del bench
    return Outcome(reason="the model turns about one axis only, z, which is the input axis by definition")


PROCEDURE = Procedure("Input axis alignment", "12.12", MODES, measure, 0.1)
