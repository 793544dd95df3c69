"""The JSON Schema of one file format, made from the code that reads or writes it."""

from collections.abc import Callable, Iterable, Mapping
from math import isfinite
from typing import Any, Final, NamedTuple

from cosim.setting import Setting
from gyro_model.quantities import Quantity

Json = dict[str, Any]

NUMBER: Final[Json] = {"type": "number"}
TEXT: Final[Json] = {"type": "string"}
NUMBER_OR_NULL: Final[Json] = {"type": ["number", "null"]}


class Schema(NamedTuple):
    """name: of the format, and of its file NAME.schema.json; title: one line; build: gives what follows from the code,
    without the name of the dialect."""

    name: str
    title: str
    build: Callable[[], Json]


def table(properties: Mapping[str, Any], required: Iterable[str] = (), description: str = "") -> Json:
    """A table that has no keys but these."""
    found: Json = {"type": "object", "properties": dict(properties), "additionalProperties": False}
    needed = list(required)
    return found | ({"required": needed} if needed else {}) | ({"description": description} if description else {})


def mapping(values: Json, description: str = "") -> Json:
    """A table with keys of one kind."""
    return {"type": "object", "additionalProperties": values} | ({"description": description} if description else {})


def array(items: Json, least: int = 0) -> Json:
    """A list."""
    return {"type": "array", "items": items, "minItems": least}


def quantity(found: Quantity) -> Json:
    """The value of a quantity, with its unit and bounds."""
    bounds = {"minimum": found.low, "maximum": found.high}
    kind = "integer" if found.integer else "number"
    return {"type": kind, "description": f"{found.description} [{found.unit}]"} | {
        key: value for key, value in bounds.items() if isfinite(value)
    }


def setting(found: Setting) -> Json:
    """The value of a setting, with its unit and bounds."""
    unit = {"description": f"[{found.unit}]"} if found.unit else {}
    bounds = {"minimum": 0.0 if found.zero else found.low, "maximum": found.high}
    return NUMBER | unit | {key: value for key, value in bounds.items() if isfinite(value)}


def interval(found: Quantity) -> Json:
    """A 95 % interval of a quantity."""
    about = f"95 % interval [low, high] of: {found.description} [{found.unit}]"
    return {"type": "array", "items": NUMBER, "minItems": 2, "maxItems": 2, "description": about}


def in_units(units: Mapping[str, str], description: str) -> Json:
    """A table of numbers, each in its unit."""
    return table({name: NUMBER | {"description": f"[{unit}]"} for name, unit in units.items()}, (), description)
