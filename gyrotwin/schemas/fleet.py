"""The fleet.json of many devices."""

from gyrotwin.schemas.record import NUMBER, NUMBER_OR_NULL, TEXT, Json, Schema, array, mapping, table


def _build() -> Json:
    interval = table(
        dict.fromkeys(("value", "low", "high"), NUMBER), ("value", "low", "high"), "with its 95 % interval"
    )
    diagnosed = {
        "verdict": TEXT,
        "effects": array(TEXT),
        "record": array(TEXT) | {"description": "defects of the measurement"},
        "misfit": NUMBER_OR_NULL | {"description": "rms of the residual on held-out runs [V]"},
        "noise_floor": NUMBER_OR_NULL | {"description": "[V]"},
    }
    failed = table({"error": TEXT}, ("error",), "why it was not diagnosed")
    share = {
        "count": NUMBER | {"description": "devices that name the effect"},
        "of": NUMBER | {"description": "devices that were diagnosed"},
        **{"low": NUMBER, "high": NUMBER},
        "uncertain": NUMBER | {"description": "of them, those that can't tell it from another"},
        "seen": NUMBER | {"description": "devices whose data would have shown it"},
    }
    alone = table({"value": NUMBER, "deviation": NUMBER}, ("value", "deviation"), "by its own data")
    one = {
        "alone": alone,
        "among_others": {"$ref": "#/$defs/interval"},
        "distance": NUMBER_OR_NULL | {"description": "from what the others let expect, in standard deviations"},
    }
    parameter = {
        **{"unit": TEXT, "effect": TEXT},
        "mean": {"$ref": "#/$defs/interval"},
        "spread": {"$ref": "#/$defs/interval"},
        "slopes": mapping({"$ref": "#/$defs/interval"}, "along each column"),
        "outliers": array(TEXT),
        "devices": mapping(table(one, one)),
    }
    entries = {
        "devices": mapping({"oneOf": [table(diagnosed, diagnosed), failed]}),
        "columns": mapping(mapping(NUMBER), "what is known of each device besides, by heading"),
        "effects": mapping(table(share, share)),
        "record": mapping(NUMBER, "defects of the measurement, with the number of devices"),
        "parameters": mapping(table(parameter, parameter)),
        "outliers": mapping(array(TEXT), "devices that do not belong, with the reasons"),
    }
    return {"$defs": {"interval": interval}} | table(entries, entries)


SCHEMA = Schema("fleet", "fleet.json: what many devices lack, together", _build)
