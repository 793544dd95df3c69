"""Plans of sweeps."""

from gyrotwin.schemas.record import NUMBER, TEXT, Json, Schema, array, mapping, table
from gyrotwin.sweeping.plan import FORMAT, METHODS


def _build() -> Json:
    points: list[Json] = [
        table({"grid": array({}, 1)}, ("grid",), "all combinations"),
        table({"values": array({}, 1)}, ("values",), "lists that go together"),
        {
            "type": "object",
            "properties": {"distribution": TEXT},
            "required": ["distribution"],
            "additionalProperties": NUMBER,
            "description": "a name of scipy.stats with its arguments",
        },
    ]
    whole = {"type": "integer", "minimum": 0}
    pair = array(NUMBER, 2) | {"maxItems": 2}
    # A name with dots is a table within a table.
    named = {
        "parameter": {"oneOf": [*points, mapping({"$ref": "#/$defs/parameter"}) | {"minProperties": 1}]},
        "limit": {"oneOf": [pair, mapping({"$ref": "#/$defs/limit"})]},
    }
    return {"$defs": named} | table(
        {
            "format": {"const": FORMAT},
            "task": TEXT | {"description": "run, rate, diagnose, or FILE.py:FUNCTION"},
            "seeds": {"anyOf": [whole, array(whole)], "description": "seeds, or how many"},
            "outputs": array(TEXT),
            "fixed": mapping({}, "options of the task that all points share"),
            "parameters": mapping({"$ref": "#/$defs/parameter"}) | {"minProperties": 1},
            "sampling": table({"method": {"enum": list(METHODS)}, "points": whole, "seed": whole}),
            "correlation": mapping(NUMBER, 'of two parameters "a,b"'),
            "limits": mapping({"$ref": "#/$defs/limit"}, "of outputs, [low, high]"),
        },
        ("task", "parameters"),
    )


SCHEMA = Schema("plan", "Plan of a sweep", _build)
