"""The page of a fleet: shares of effects, populations, gradients, devices that do not belong."""

from pathlib import Path
from typing import Any, Final

import numpy as np

from discrepancy.tell.fleet import Spread
from gyrotwin.figures import Figure, Line, Panel
from gyrotwin.fleet_result import FleetResult
from gyrotwin.numbers import significant, unit
from gyrotwin.report import render_page

MOST: Final = 12
"""Parameters that are drawn: those of effects first, then those with outliers."""


def render(result: FleetResult, out: Path) -> None:
    """Writes the page, complete or not at all."""
    found = result.fleet
    render_page(
        "fleet.html.j2",
        out,
        _figures(result),
        title=result.name,
        fleet=found,
        parameters=[_described(name, own) for name, own in found.spreads.items()],
        failed=[row for row in found.rows if row.error],
        beside=(out.parent / "devices").is_dir() or out.parent.name.startswith(".writing-"),
    )


def _described(name: str, own: Spread) -> dict[str, Any]:
    p = own.found
    return {
        "name": name,
        "unit": own.unit,
        "effect": own.effect,
        "mean": f"{significant(p.mean.value, 5)} ± {significant(p.mean.high - p.mean.value, 2)}",
        "spread": significant(p.spread.value),
        "range": f"{significant(p.spread.low)} to {significant(p.spread.high)}",
        "slopes": [f"{significant(s.value)} ± {significant(s.high - s.value, 2)}" for s in p.slopes],
    }


def _figures(result: FleetResult) -> list[Figure]:
    spreads = result.fleet.spreads
    order = sorted(spreads, key=lambda n: (not spreads[n].effect, not spreads[n].found.outliers))
    return [_drawn(result, name) for name in order[:MOST]]


def _drawn(result: FleetResult, name: str) -> Figure:
    """A parameter over the devices in the order of their values, and over each column."""
    own = result.fleet.spreads[name]
    p, order = own.found, np.argsort([e.value for e in own.estimates], kind="stable")
    place = np.empty(len(order))
    place[order] = np.arange(1, len(order) + 1)
    panels = [Panel("device, by value", f"{name} [{unit(own.unit)}]", _lines(own, place.tolist()), wide=True)]
    for k, (heading, values) in enumerate(result.fleet.columns.items()):
        x = [values[device] for device in own.devices]
        ends = [min(x), max(x)]
        middle = float(np.mean(x))
        trend = [p.mean.value + p.slopes[k].value * (end - middle) for end in ends]
        lines = [*_lines(own, x), Line("slope", "reference", [*ends], [*trend])]
        panels.append(Panel(heading, f"{name} [{unit(own.unit)}]", lines))
    text = f"{name}" + (f", of {own.effect}" if own.effect else "")
    more = "; dashed: the slope along each column, the others at their mean" if result.fleet.columns else ""
    key = [("dot", "device"), ("bad", "does not belong"), ("measured", "95 % interval")]
    key += [("reference", "slope")] if result.fleet.columns else []
    caption = f"Each device alone with its 95 % interval{more}. An effect that a device does not name stands " \
        "where a linear fit finds it."  # fmt: skip
    return Figure(f"spread-{_plain(name)}", text, "", caption, key, panels)


def _plain(name: str) -> str:
    return "".join(letter if letter.isalnum() else "-" for letter in name)


def _lines(own: Spread, x: list[float]) -> list[Line]:
    reach = [1.959963984540054 * e.deviation for e in own.estimates]
    values = [e.value for e in own.estimates]
    bars_x: list[float | None] = [v for at in x for v in (at, at, None)]
    bars_y: list[float | None] = [v for y, r in zip(values, reach, strict=True) for v in (y - r, y + r, None)]
    lines = [Line("95 %", "measured", bars_x, bars_y)]
    bad = set(own.found.outliers)
    for role, chosen in (("dot", [i for i in range(len(x)) if i not in bad]), ("bad", sorted(bad))):
        if chosen:
            names = [own.devices[i] for i in chosen]
            lines.append(Line(role, role, [x[i] for i in chosen], [values[i] for i in chosen], names))
    return lines
