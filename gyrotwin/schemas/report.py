"""The report.json of a diagnosis."""

from typing import get_args

from discrepancy.fit.defect import defects
from discrepancy.tell.answer import Verdict
from gyrotwin.schemas.criteria import thresholds
from gyrotwin.schemas.record import NUMBER, NUMBER_OR_NULL, TEXT, Json, Schema, array, mapping, table


def _build() -> Json:
    value = table(
        {"value": NUMBER_OR_NULL, "low": NUMBER_OR_NULL, "high": NUMBER_OR_NULL, "unit": TEXT},
        ("value", "low", "high", "unit"),
    )
    finding = table(
        {
            "id": TEXT,
            "either": array(TEXT) | {"description": "others that the data can't tell from it"},
            "probability": NUMBER | {"minimum": 0, "maximum": 1, "description": "of a name"},
            "parameters": mapping({"$ref": "#/$defs/value"}),
            "force_x": TEXT,
            "force_y": TEXT,
            "next_experiment": TEXT | {"description": "what would tell it from the others"},
        },
        ("id", "either", "parameters"),
    )
    findings = array({"$ref": "#/$defs/finding"})
    known = ", ".join(defect.id for defect in defects())
    levels = ("nominal", "refit", "final", "noise_floor")
    required = (
        *("verdict", "doubts", "left", "record", "effects", "immaterial", "noise", "misfit", "located", "detectable"),
        "criteria",
    )
    return {"$defs": {"value": value, "finding": finding}} | table(
        {
            "verdict": {"enum": list(get_args(Verdict))},
            "doubts": array(TEXT),
            "left": NUMBER_OR_NULL | {"description": "share of the residual's power that is left, noise taken off"},
            "record": findings | {"description": f"defects of the measurement: {known}"},
            "effects": findings | {"description": "missing effects, largest first"},
            "immaterial": findings
            | {"description": "what showed and is no name: not worth a parameter, or taken out again"},
            "noise": mapping({"$ref": "#/$defs/value"}),
            "misfit": {
                "type": "object",
                "description": "rms of the residual on held-out runs [V]",
                "properties": dict.fromkeys(levels, NUMBER_OR_NULL),
                "required": list(levels),
            },
            "located": array({"type": "object"}),
            "detectable": mapping(mapping(NUMBER_OR_NULL)),
            "criteria": thresholds(),
        },
        required,
    )


SCHEMA = Schema("report", "report.json: what a model lacks to explain a data set", _build)
