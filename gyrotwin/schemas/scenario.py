"""Scenario files."""

from cosim.angle import UNIT_NAMES
from cosim.scenarios.files import BETWEEN, COMMON_KEYS, FORMAT, KINDS
from cosim.scenarios.scenario import INPUT_NAMES, QUANTITIES
from gyrotwin.schemas.device import settable
from gyrotwin.schemas.record import NUMBER, TEXT, Json, Schema, array, table

_VALUES: Json = {
    "kind": {"enum": list(KINDS)},
    "unit": TEXT | {"description": "of the values; SI where none is given"},
    "from": NUMBER | {"description": "when the course begins [s]"},
    "until": NUMBER | {"description": "when it ends [s]"},
    "value": NUMBER,
    "times": array(NUMBER, 1) | {"description": "[s]"},
    "values": array(NUMBER, 1),
    "amplitude": NUMBER,
    "frequency": NUMBER | {"description": "[Hz]"},
    "phase": NUMBER | {"description": "[deg]"},
    "file": TEXT | {"description": "a table, beside the scenario file"},
    "column": TEXT,
    "time": TEXT | {"description": "column of the times"},
    "start": NUMBER | {"description": "where the record begins to be used [s]"},
    "between": {"enum": list(BETWEEN)},
}
"""What each key of a course may hold."""


def _course() -> Json:
    kinds = []
    for name, kind in KINDS.items():
        keys = (*COMMON_KEYS, *kind.needed, *kind.optional)
        kinds.append(table({**{key: _VALUES[key] for key in keys}, "kind": {"const": name}}, ("kind", *kind.needed)))
    return {"oneOf": kinds}


def _build() -> Json:
    parameters, _ = settable()
    inputs = {
        name: {
            "description": f"{QUANTITIES[name].description} [{QUANTITIES[name].unit}]",
            "anyOf": [NUMBER, {"$ref": "#/$defs/course"}, array({"$ref": "#/$defs/course"}, 1)],
        }
        for name in INPUT_NAMES
    }
    return {"$defs": {"course": _course()}} | table(
        {
            "format": {"const": FORMAT},
            "name": TEXT,
            "description": TEXT,
            "duration": NUMBER | {"description": "[s]", "exclusiveMinimum": 0},
            "angle_unit": {"enum": list(UNIT_NAMES)},
            "parameters": parameters,
            **inputs,
        },
        ("format", "name", "description", "duration"),
    )


SCHEMA = Schema("scenario", "Scenario file: what happens to a device over time", _build)
