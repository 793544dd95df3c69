"""The report: one self-contained HTML page that works without a network."""

import json
from collections.abc import Mapping, Sequence
from importlib import resources
from pathlib import Path
from typing import Any, Final

import jinja2
import polars as pl
from markupsafe import Markup

from calibration.datasheet.figure import Curve
from cosim.angle_filters import Filter
from cosim.metrics import Bounds
from gyro_model.whole_file import whole_file
from gyrotwin import figures, numbers
from gyrotwin.angle_remarks import angle_remarks
from gyrotwin.curve_figures import draw

SI_UNITS: Final = {"k": "N/m", "d": "N·s/m", "m": "kg"}
"""By first letter of the parameter."""
LONGEST: Final = 40_000
"""Rows of a trace that the figures of convergence look at: more would only cost memory."""
UNIT_OF_FILTER: Final = {"band-pass": "A", "low-pass": "B"}


def render(
    summary: Mapping[str, Any],
    trace: pl.DataFrame,
    bounds: Bounds | None,
    filters: Sequence[Filter],
    out: Path,
    start: pl.DataFrame | None = None,
) -> None:
    """Write the report of one run to `out`, complete or not at all.

    summary: content of summary.json; trace: columns of trace.parquet; filters: those of the angle
    units, and others of the same bands to compare them with; start: the first milliseconds at the
    full sample rate, with true_x .. true_y_dot, est_x .. est_y_dot beside columns of the trace
    (default: the trace).
    """
    shown = run_figures(summary, trace, bounds, filters, trace if start is None else start)
    page = template("report.html.j2").render(
        summary=summary,
        remarks=angle_remarks(summary),
        figures=shown,
        data=as_json({figure.id: figure.data() for figure in shown}),
        units={name: SI_UNITS[name[0]] for name in summary["parameters"]},
        lags={UNIT_OF_FILTER[f.name]: f.swing_lag() for f in filters if f.shape == "lag_free"},
    )
    write_whole(page, out)


def render_page(name: str, out: Path, shown: Sequence[figures.Figure], **values: Any) -> None:
    """Writes the page of the template ``name`` with the figures ``shown``, complete or not at all."""
    page = template(name).render(
        figures=shown,
        data=as_json({figure.id: figure.data() for figure in shown}),
        **values,
    )
    write_whole(page, out)


def write_whole(page: str, out: Path) -> None:
    """Writes `page` to `out`, complete or not at all."""
    with whole_file(out) as file:
        file.write(page.encode())


def run_figures(
    summary: Mapping[str, Any],
    trace: pl.DataFrame,
    bounds: Bounds | None,
    filters: Sequence[Filter],
    start: pl.DataFrame,
) -> list[figures.Figure]:
    """The figures of a run; arguments as in ``render``."""
    # Most of the convergence happens before the second row of the trace.
    common = [name for name in trace.columns if name in start.columns]
    rest = trace[common].gather_every(max(len(trace) // LONGEST, 1))
    whole = pl.concat([start[common], rest.filter(pl.col("t") > start["t"][-1])])
    scenario = summary["scenario"]
    references = {name: unit["reference_deg"] for name, unit in summary["angle_units"].items()}
    shown = [
        figures.angle_figure(trace, summary["angle"]["unit"], references[summary["angle"]["unit"]], scenario),
        figures.units_figure(trace, references),
        figures.states_figure(start),
        figures.parameters_figure(whole, scenario),
        figures.relative_error_figure(whole, scenario),
    ]
    if bounds is not None:
        shown.append(figures.bound_figure(trace, bounds, scenario))
    shown.append(figures.filter_figure(filters))
    return drawings(summary) + shown


def drawings(summary: Mapping[str, Any]) -> list[figures.Figure]:
    """The curves of what the run shows by its kind."""
    curves = [Curve(**curve) for found in summary["characteristics"].values() for curve in found["curves"]]
    return [drawing for curve in curves if (drawing := draw(curve)) is not None]


def template(name: str) -> jinja2.Template:
    """A page in the folder templates, with the filters of ``numbers``."""
    folder = resources.files("gyrotwin") / "templates"
    environment = jinja2.Environment(
        loader=jinja2.FunctionLoader(lambda name: (folder / name).read_text(encoding="utf-8")),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    script = (resources.files("gyrotwin") / "assets" / "plotly-basic.min.js").read_text(encoding="utf-8")
    environment.globals["plotly"] = Markup(script)
    for filter_name in (
        "significant",
        "relative",
        "milliseconds",
        "microseconds",
        "degrees",
        "uncertain",
        "hertz",
        "unit",
        "in_unit",
        "with_error",
    ):
        environment.filters[filter_name] = getattr(numbers, filter_name)
    return environment.get_template(name)


def as_json(data: object) -> Markup:
    """Return strict JSON that can't end the script element it stands in."""
    return Markup(json.dumps(data, allow_nan=False, separators=(",", ":")).replace("</", "<\\/"))
