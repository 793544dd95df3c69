"""The results of a run as tables in the terminal."""

from collections.abc import Mapping
from typing import Any

from rich.console import Group, RenderableType
from rich.text import Text

from gyrotwin.angle_remarks import angle_remarks
from gyrotwin.numbers import degrees, microseconds, milliseconds, relative, significant, with_error
from gyrotwin.terminal_table import Table


def results(summary: Mapping[str, Any]) -> RenderableType:
    """Return what summary.json holds, as tables for rich."""
    parts: list[RenderableType] = [_headline(summary), _validity(summary), _parameters(summary)]
    if summary["effects"]:
        parts.append(_effects(summary))
    return Group(*parts, _angles(summary), *map(_characteristic, summary["characteristics"].values()))


def _headline(summary: Mapping[str, Any]) -> Text:
    converged = summary["converged_at"]
    state = "never converged: no angle" if converged is None else "converged at "
    text = Text(f"{summary['scenario']}, seed {summary['seed']}: {state}")
    if converged is not None:
        text.append(milliseconds(converged), style="bold")
    text.append(
        f"; rate {significant(summary['omega']['rms_error'])} rad/s rms"
        f"; {significant(summary['real_time_factor'])} × real time"
    )
    return text


def _validity(summary: Mapping[str, Any]) -> Text:
    """Whether the angle can be believed, by what the loop itself knows."""
    valid, predicted = summary["valid"], summary["predicted"]
    text = Text("angle valid at the end" if valid["now"] else "angle not valid at the end")
    text.stylize("bold" if valid["now"] else "bold red")
    if valid["reason"]:
        text.append(f": {valid['reason']}")
    text.append(f"; valid in {100 * valid['share']:.1f} % of the run")
    for entry in valid["withdrawn"]:
        text.append(f"\nwithdrawn at {milliseconds(entry['t'])}: {entry['reason']}")
    text.append(f"\npredicted drift ±{degrees(predicted['drift_sigma_now_deg_per_s'], '°/s')}")
    text.append(f", at the pattern's worst angle ±{degrees(predicted['drift_sigma_deg_per_s'], '°/s')}")
    text.append(f", angle ±{degrees(predicted['angle_sigma_deg'])} (1 σ)")
    for remark in angle_remarks(summary):
        text.append(f"\n{remark}")
    return text


def _effects(summary: Mapping[str, Any]) -> Table:
    table = Table(title="Effects, at the end (SI units)", title_justify="left")
    table.add_column("name")
    for heading in ("true", "estimate"):
        table.add_column(heading, justify="right")
    for name, values in summary["effects"].items():
        table.add_row(name, significant(values["true"], 5), significant(values["estimate"], 5))
    return table


def _parameters(summary: Mapping[str, Any]) -> Table:
    table = Table(title="Parameters at the end (SI units)", title_justify="left")
    table.add_column("name")
    for heading in ("true", "estimate", "error", "within 1 % at", "error/bound"):
        table.add_column(heading, justify="right")
    for name, values in summary["parameters"].items():
        table.add_row(
            name,
            significant(values["true"], 5),
            significant(values["estimate"], 5),
            relative(values["relative_error"]),
            milliseconds(values["within_1_percent_at"]),
            significant(values["over_bound"]),
        )
    return table


def _angles(summary: Mapping[str, Any]) -> Table:
    table = Table(title="Angle, from convergence to the end", title_justify="left")
    table.add_column("unit")
    for heading in ("rms", "largest", "drift", "lag"):
        table.add_column(heading, justify="right")
    for name, values in summary["angle_units"].items():
        chosen = name == summary["angle"]["unit"]
        table.add_row(
            f"{name} (chosen)" if chosen else name,
            degrees(values["rms_deg"]),
            degrees(values["max_deg"]),
            degrees(values["drift_deg_per_s"], "°/s"),
            microseconds(values["lag_s"]),
            style="bold" if chosen else None,
        )
    return table


def _characteristic(found: Mapping[str, Any]) -> RenderableType:
    """What a run of its kind shows, or why not."""
    if found["not_done"]:
        return Text(f"{found['title']}: not done: {found['not_done']}")
    table = Table(title=found["title"], title_justify="left")
    table.add_column("figure")
    table.add_column("value ± standard error", justify="right")
    table.add_column("unit")
    table.add_column("remark")
    for figure in found["figures"].values():
        table.add_row(figure["name"], with_error(figure["value"], figure["error"]), figure["unit"], figure["note"])
    return table
