"""Criteria of a diagnosis."""

from dataclasses import fields

from discrepancy.criteria import BOUNDS, Criteria
from gyrotwin.schemas.record import NUMBER, Json, Schema, table


def thresholds() -> Json:
    """All thresholds with their bounds and defaults."""
    found = {f.name: NUMBER | {"default": f.default} for f in fields(Criteria)}
    for name, (low, high) in BOUNDS.items():
        found[name] |= {"minimum": low, "maximum": high}
    return table(found)


SCHEMA = Schema("criteria", "Criteria: the thresholds of a diagnosis", thresholds)
