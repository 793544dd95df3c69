"""Limits of a laboratory."""

from dataclasses import fields

from discrepancy.data.record import CONDITIONS
from discrepancy.tell.limits import Limits
from gyrotwin.schemas.record import NUMBER, Json, Schema, table

POSITIVE: Json = NUMBER | {"exclusiveMinimum": 0}
PAIR: Json = {"type": "array", "items": NUMBER, "minItems": 2, "maxItems": 2}


def limits() -> Json:
    """All limits with their units."""
    return table({
        own.name: (PAIR if own.name in CONDITIONS else POSITIVE) | {"description": f"[{own.metadata['unit']}]"}
        for own in fields(Limits)
    })  # fmt: skip


SCHEMA = Schema("limits", "Limits: what a laboratory can do in a further experiment", limits)
