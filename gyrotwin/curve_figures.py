"""Curves of a datasheet, and of a run by its kind, as figures of a page."""

from typing import Final

import numpy as np

from calibration.datasheet.figure import Curve
from gyrotwin.figures import Figure, Panel, line

LOGARITHMIC: Final = {"allan": (True, True), "noise_spectrum": (True, True), "transfer": (True, False)}
"""Axes of a curve, x and y, that are logarithmic."""


def draw(curve: Curve) -> Figure | None:
    """A curve as panels: columns of one unit share one; the first column is x; errors are not drawn."""
    names = list(curve.columns)
    x_name, x = names[0], np.asarray(curve.columns[names[0]], float)
    units: dict[str, list[str]] = {}
    for name in names[1:]:
        if " error " not in f" {name} ":
            units.setdefault(name[name.rindex("[") :], []).append(name)
    x_log, y_log = LOGARITHMIC.get(curve.id, (False, False))
    panels = []
    for unit, columns in units.items():
        lines = []
        for name in columns:
            text = name[: name.rindex("[")].strip()
            role = (
                "truth" if text.startswith(("expected", "fit")) else "limit" if text in ("low", "high") else "estimate"
            )
            lines.append(line(text, role, x, np.asarray(curve.columns[name], float)))
        panels.append(Panel(x_name, f"{lines[0].name} {unit}", lines, x_log=x_log, y_log=y_log, wide=len(units) == 1))
    if not panels:
        return None
    key = [("estimate", "measured")]
    key += (
        [("truth", "fitted" if curve.id == "allan" else "expected")]
        if any(one.role == "truth" for panel in panels for one in panel.lines)
        else []
    )
    key += [("limit", "95 % interval")] if curve.id == "allan" else []
    return Figure(curve.id, curve.name, "", "", key, panels)
