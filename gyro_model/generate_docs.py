"""Writes the tables of variables and effects that docs/reference/fmu.md holds between its markers."""

from collections.abc import Iterable
from pathlib import Path

from gyro_model.envelope import envelope_model
from gyro_model.form import Form
from gyro_model.model import Model
from gyro_model.quantities import Quantity
from gyro_model.sensor import SensorModel

BEGIN, END = "<!-- variables: written by build_fmu.py --update -->", "<!-- end of variables -->"
SENSOR_BEGIN, SENSOR_END = "<!-- sensor: written by build_fmu.py --update -->", "<!-- end of sensor -->"
ENVELOPE_BEGIN, ENVELOPE_END = "<!-- envelope: written by build_fmu.py --update -->", "<!-- end of envelope -->"


def variables(model: Model) -> str:
    """Markdown tables of inputs, outputs, parameters, and effects with their own parameters."""
    groups = {"Inputs": "input", "Outputs": "output", "Parameters": "parameter"}
    parts = []
    for heading, role in groups.items():
        rows = [q for q in model.quantities if q.role == role]
        parts.append(_table((heading, "unit", "start", "what"), (_row(q) for q in rows)))
    effects = (
        (f"`{e.id}`", e.stage, ", ".join(map(_parameter, e.parameters)), e.doc.strip().splitlines()[0].rstrip("."))
        for e in model.effects
        if not e.nominal
    )
    parts.append(_table(("Effect", "stage", "parameters [unit] = neutral, (shape or start)", "what"), effects))
    return "\n".join(parts)


def all_variables(form: Form) -> str:
    """Markdown table of all variables of ``form``."""
    rows = (
        (f"`{q.name}`", q.role, q.unit, "" if q.role == "output" else f"{q.start:g}", q.description)
        for q in form.quantities
    )
    return _table(("name", "is", "unit", "start", "what"), rows)


def own_variables(form: Model, model: Model) -> str:
    """Markdown table of what ``form``, of the same device, has and ``model`` has not."""
    rows = (
        (f"`{q.name}`", q.role, q.unit, "" if q.role == "output" else f"{q.start:g}", q.description)
        for q in form.quantities
        if q.name not in model.by_name or q.start != model.by_name[q.name].start
    )
    return _table(("name", "is", "unit", "start", "what"), rows)


def insert(text: str, model: Model) -> str:
    """``text`` with the tables between its markers written anew. Raises ValueError where it has no markers."""
    text = _between(text, BEGIN, variables(model), END)
    text = _between(text, ENVELOPE_BEGIN, own_variables(envelope_model(model), model), ENVELOPE_END)
    return _between(text, SENSOR_BEGIN, all_variables(SensorModel()), SENSOR_END)


def _between(text: str, begin: str, written: str, end: str) -> str:
    before, marker, rest = text.partition(begin)
    _, closing, after = rest.partition(end)
    if not (marker and closing):
        raise ValueError(f"no markers {begin!r} ... {end!r}")
    return f"{before}{begin}\n\n{written}\n{end}{after}"


def reference_page(checkout: Path, model: Model) -> dict[Path, str]:
    """The page of the FMUs with its tables, by path; nothing where there are no pages."""
    path = checkout / "docs" / "reference" / "fmu.md"
    return {path: insert(path.read_text(encoding="utf-8"), model)} if path.is_file() else {}


def _row(quantity: Quantity) -> tuple[str, ...]:
    start = "" if quantity.role == "output" else f"{quantity.start:g}"
    return f"`{quantity.name}`", quantity.unit, start, quantity.description


def _parameter(quantity: Quantity) -> str:
    text = f"`{quantity.name}` [{quantity.unit}] = {quantity.start:g}"
    return text if quantity.role == "size" else f"({text})"


def _table(heading: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> str:
    lines = [heading, ("---",) * len(heading), *rows]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)
