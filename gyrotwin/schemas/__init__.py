"""JSON Schemas of the file formats, for editors that complete and check while one types, and for other programs.

One file a format, found by a scan, each with ``SCHEMA = Schema(...)``. What stands in a schema comes from the tables by
which the program itself reads the file. A file that a schema accepts may still be refused: a schema knows no
physics.
"""

import importlib
import pkgutil
from functools import cache

from gyro_model.errors import InputError, nearest
from gyrotwin.schemas.record import Json, Schema

DIALECT = "https://json-schema.org/draft/2020-12/schema"


@cache
def schemas() -> dict[str, Schema]:
    """All schemas by name."""
    modules = (importlib.import_module(f"{__name__}.{found.name}") for found in pkgutil.iter_modules(__path__))
    found = [module.SCHEMA for module in modules if hasattr(module, "SCHEMA")]
    return {schema.name: schema for schema in sorted(found)}


def schema(name: str) -> Json:
    """The JSON Schema of a file format.

    Parameters
    ----------
    name : str
        device, design, scenario, dataset, plan, criteria, limits, summary, report or fleet.

    Returns
    -------
    dict
        The schema, JSON-ready.

    Raises
    ------
    InputError
        If there is no such format.

    Examples
    --------
    >>> import gyrotwin as gt
    >>> gt.schema("device")["properties"]["parameters"]["properties"]["kxx"]["description"]
    'stiffness along x [N/m]'

    """
    known = schemas()
    if name not in known:
        raise InputError(f"format {name!r} is unknown{nearest(name, known)}; there are {', '.join(known)}")
    found = known[name]
    return {"$schema": DIALECT, "title": found.title, **found.build()}
