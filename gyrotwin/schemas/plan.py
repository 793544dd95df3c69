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
    return table(
        {
            "format": {"const": FORMAT},
            "task": TEXT | {"description": "run, rate, diagnose, or FILE.py:FUNCTION"},
            "seeds": {"anyOf": [whole, array(whole)], "description": "seeds, or how many"},
            "outputs": array(TEXT),
            "fixed": mapping({}, "options of the task that all points share"),
            "parameters": mapping({"oneOf": points}) | {"minProperties": 1},
            "sampling": table({"method": {"enum": list(METHODS)}, "points": whole, "seed": whole}),
            "correlation": mapping(NUMBER, 'of two parameters "a,b"'),
            "limits": mapping(array(NUMBER, 2) | {"maxItems": 2}, "of outputs, [low, high]"),
        },
        ("task", "parameters"),
    )


SCHEMA = Schema("plan", "Plan of a sweep", _build)
