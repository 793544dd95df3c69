"""The dataset.toml of a data set."""

from typing import get_args

from discrepancy.data.dataset import FORMAT
from discrepancy.data.record import Hold, Role, Senses
from gyrotwin.schemas.device import settable
from gyrotwin.schemas.record import NUMBER, TEXT, Json, Schema, array, table


def _build() -> Json:
    nominal, _ = settable()
    run = table(
        {
            "file": TEXT | {"description": "a table of t, u_x, u_y, v_x, v_y in this folder"},
            "sample_rate": NUMBER | {"description": "[Hz]", "exclusiveMinimum": 0},
            "role": {"enum": list(get_args(Role))},
            "hold": {"enum": list(get_args(Hold)), "description": "the force between its samples"},
            "senses": {"enum": list(get_args(Senses)), "description": "what v shows"},
        },
        ("file", "sample_rate"),
    )
    believed = nominal | {"description": "what the laboratory believes of the device, SI"}
    return table({"format": {"const": FORMAT}, "nominal": believed, "run": array(run, 1)}, ("format", "run"))


SCHEMA = Schema("dataset", "Data set: measured runs, and what is believed of the device", _build)
