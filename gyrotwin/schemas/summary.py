"""The summary.json of a run of the closed loop."""

from calibration.datasheet.figure import EXPECTATIONS
from cosim.angle import UNIT_NAMES
from cosim.layout import PARAMETER_NAMES
from cosim.metrics import ANGLE_NAMES
from gyrotwin.schemas.record import NUMBER_OR_NULL, TEXT, Json, Schema, array, mapping, table

_PARAMETER = ("true", "estimate", "relative_error", "within_1_percent_at", "over_bound")
_PREDICTED = ("drift_sigma_deg_per_s", "drift_sigma_now_deg_per_s", "angle_sigma_deg", "drift_bound_deg_per_s")


def _numbers(names: tuple[str, ...]) -> Json:
    return table(dict.fromkeys(names, NUMBER_OR_NULL), names)


def _characteristic() -> Json:
    """Figures by id and curves, or why there are none."""
    figure = {
        **{"id": TEXT, "name": TEXT, "value": NUMBER_OR_NULL, "unit": TEXT},
        "error": NUMBER_OR_NULL | {"description": "standard error"},
        "tests": {"type": "integer", "description": "values or records behind it"},
        "expected": NUMBER_OR_NULL,
        **{"rule": TEXT, "how": {"enum": list(EXPECTATIONS)}, "note": TEXT},
        "holds": {"type": ["boolean", "null"]},
    }
    curve = {"id": TEXT, "name": TEXT, "columns": mapping(array(NUMBER_OR_NULL))}
    found = {
        "title": TEXT,
        "not_done": TEXT | {"description": "why not; empty where it was"},
        "figures": mapping(table(figure, figure)),
        "curves": array(table(curve, curve)),
    }
    return table(found, found)


def _build() -> Json:
    withdrawn = table({"t": NUMBER_OR_NULL, "reason": TEXT}, ("t", "reason"))
    valid = {
        "share": NUMBER_OR_NULL | {"description": "of the run in which the angle was valid"},
        "withdrawn": array(withdrawn),
        "now": {"type": "boolean"},
        "reason": TEXT,
        "stopped": TEXT,
    }
    angle = _numbers(ANGLE_NAMES)
    chosen = table({"unit": {"enum": list(UNIT_NAMES)}} | angle["properties"], ("unit", *ANGLE_NAMES))
    return table(
        {
            "scenario": TEXT,
            "seed": {"type": "integer"},
            "converged_at": NUMBER_OR_NULL | {"description": "[s]"},
            "valid": table(valid, valid),
            "predicted": _numbers(_PREDICTED),
            "effects": mapping(_numbers(("true", "estimate"))),
            "parameters": table(dict.fromkeys(PARAMETER_NAMES, _numbers(_PARAMETER)), PARAMETER_NAMES),
            "omega": _numbers(("rms_error",)),
            "angle": chosen,
            "angle_units": table(dict.fromkeys(UNIT_NAMES, angle), UNIT_NAMES),
            "characteristics": mapping(_characteristic(), "by kind of run: rest, spin, staircase"),
            "real_time_factor": NUMBER_OR_NULL,
            "run": mapping({"type": ["string", "number", "boolean", "null"]}),
        },
        ("scenario", "seed", "converged_at", "valid", "predicted", "parameters", "angle", "angle_units"),
    )


SCHEMA = Schema("summary", "summary.json: what came of a run of the closed loop", _build)
