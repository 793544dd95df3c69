"""The report of a compensation: bias and scale factor over temperature, before and after."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from calibration.compensation.measures import Curve, bias_factor
from calibration.compensation.record import CIRCUIT, FREQUENCY, STRUCTURE, Blocks
from gyrotwin.figures import Figure, Line, Panel, envelope, line
from gyrotwin.report import as_json, template, write_whole

if TYPE_CHECKING:
    from calibration.compensation.trial import Judged

Floats = NDArray[np.float64]

SHARE: Final = 2.0
"""Noise is drawn at this many standard errors: 95 %."""
PPM: Final = 1e6
MINUTE: Final = 60.0
METHOD_ROLES: Final = ("estimate", "effect-0", "effect-1", "effect-2")
AXES: Final = {STRUCTURE: "structure [°C]", CIRCUIT: "board [°C]", FREQUENCY: "drive frequency [Hz]"}


def render(summary: Mapping[str, Any], judged: Sequence["Judged"], tested: Blocks, out: Path) -> None:
    """Writes the page to ``out``; summary: content of summary.json; tested: the held-out blocks."""
    from gyrotwin.tasks.compensate import HEADINGS, notes, rows, times, titles

    unit = "°/h" if summary["unit"] == "rad/s" else summary["unit"]
    drawn = [
        _before_and_after(judged[0], tested, unit),
        _remains(judged, tested, unit),
        _course(judged[0], tested, unit),
    ]
    page = template("compensate.html.j2").render(
        summary=summary,
        chosen=summary["methods"][summary["method"]],
        headings=HEADINGS,
        times=times,
        notes=notes(dict(summary)),
        tables={title: rows(dict(summary), quantity) for quantity, title in titles(dict(summary)).items()},
        bias_unit=unit,
        figures=drawn,
        data=as_json({figure.id: figure.data() for figure in drawn}),
    )
    write_whole(page, out)


def _axis(blocks: Blocks) -> str:
    return AXES[next(name for name in AXES if name in blocks.inputs)]


def _by_temperature(curve: Curve, values: Floats) -> tuple[Floats, Floats]:
    """In the order of time: up and down of a cycle are two lines."""
    return curve.temperature, values


def _panels(judged: "Judged", tested: Blocks, unit: str) -> list[tuple[str, Curve, float, float]]:
    """Label, curve, factor and what to take off, of bias and scale factor."""
    result = judged.held_out
    panels = [(f"bias [{unit}]", result.bias, bias_factor(tested.unit), 0.0)]
    if result.scale is not None:
        panels.append(("scale factor - 1 [ppm]", result.scale, PPM, 1.0))
    return panels


def _before_and_after(judged: "Judged", tested: Blocks, unit: str) -> Figure:
    panels = []
    for label, curve, factor, off in _panels(judged, tested, unit):
        lines = [
            line(name, name, *_by_temperature(curve, factor * (values - off)))
            for name, values in (("before", curve.before), ("after", curve.after))
        ]
        panels.append(Panel(_axis(tested), label, lines, wide=not judged.held_out.scale))
    return Figure(
        "before-after",
        "Bias over temperature" if judged.held_out.scale is None else "Bias and scale factor over temperature",
        "Liu et al. 2014, fig. 6",
        "Held-out blocks, means over neighbours, before and after compensation. A line that comes back beside itself "
        "is a temperature that the sensor does not tell: up and down of a cycle differ by the lag.",
        [("before", "before"), ("after", f"after: {judged.compensation.method}")],
        panels,
    )


def _remains(judged: Sequence["Judged"], tested: Blocks, unit: str) -> Figure:
    panels = []
    for k, (label, first, factor, off) in enumerate(_panels(judged[0], tested, unit)):
        lines = []
        for role, one in zip(METHOD_ROLES, judged, strict=False):
            curve = _panels(one, tested, unit)[k][1]
            lines.append(line(one.compensation.method, role, *_by_temperature(curve, factor * (curve.after - off))))
        panels.append(Panel(_axis(tested), label, [*lines, *_noise(first, factor)], wide=True))
    return Figure(
        "remains",
        "What remains",
        "beyond Liu et al. 2014",
        "The same after compensation, magnified, for every method fitted. Dashed: two standard errors of the record's "
        "own noise; what lies within them is no longer the compensation's.",
        [
            *((role, one.compensation.method) for role, one in zip(METHOD_ROLES, judged, strict=False)),
            ("limit", "95 % of the noise"),
        ],
        panels,
    )


def _noise(curve: Curve, factor: float) -> list[Line]:
    order = np.argsort(curve.temperature, kind="stable")
    reach = SHARE * factor * float(np.median(curve.noise))
    ends = curve.temperature[order][[0, -1]]
    return [line("noise", "limit", ends, np.full(2, sign * reach)) for sign in (-1.0, 1.0)]


def _course(judged: "Judged", tested: Blocks, unit: str) -> Figure:
    t = tested.t / MINUTE
    panels = []
    roles = {STRUCTURE: "estimate", CIRCUIT: "reference"}
    lines = [line(n, r, *envelope(t, tested.inputs[n])) for n, r in roles.items() if n in tested.inputs]
    if lines:
        panels.append(Panel("t [min]", "sensors [°C]", lines))
    else:
        panels.append(
            Panel("t [min]", "drive frequency [Hz]", [line("f", "estimate", *envelope(t, tested.temperature))])
        )
    for label, curve, factor, off in _panels(judged, tested, unit)[:1]:
        panels.append(Panel("t [min]", f"{label} after", [
            line("after", "error", *envelope(curve.t / MINUTE, factor * (curve.after - off)))
        ]))  # fmt: skip
    return Figure(
        "course",
        "The test in time",
        "beyond Liu et al. 2014",
        "Temperatures that the sensors read over the held-out blocks, and the bias that remains.",
        [("estimate", "structure"), ("reference", "board"), ("error", "bias after")],
        panels,
    )
