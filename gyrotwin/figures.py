"""The figures of the report as plain data: panels of lines, ready for JSON.

A figure redraws one of patent TW 201137310, or shows what the patent leaves out. The page's script turns a
panel into a Plotly plot; colours and dashes follow the role of a line.
"""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any, Final

import numpy as np
import polars as pl
from numpy.typing import NDArray

from cosim.angle import UNIT_NAMES
from cosim.angle_filters import Filter
from cosim.layout import PARAMETER_NAMES
from cosim.metrics import SETTLING, WITHIN, Bounds

Floats = NDArray[np.float64]

POINTS: Final = 1200
"""Points of a line at most: about two for each pixel of a wide panel."""
BINS: Final = 200
"""Windows in which the rms error is compared with the bound."""

STATE_LABELS: Final = {"x": "x [µm]", "x_dot": "x' [mm/s]", "y": "y [µm]", "y_dot": "y' [mm/s]"}
STATE_SCALES: Final = {"x": 1e6, "x_dot": 1e3, "y": 1e6, "y_dot": 1e3}
START_SHOWN: Final = 2e-3
"""How much of the start the figure of the states shows [s]: six periods at 3 kHz."""
SWING_HZ: Final = 10.0
"""The frequency of the rate in both embodiments."""

PARAMETER_UNITS: Final = {"k": ("N/m", 1.0), "d": ("µN·s/m", 1e6), "m": ("µg", 1e9)}
"""Unit on the axis and its number in one SI unit, by first letter of the parameter."""


@dataclass(frozen=True)
class Line:
    """A line: x, y lists of numbers (None: gap); role: how it is drawn; text: a word for each point, or none."""

    name: str
    role: str
    x: Sequence[float | None]
    y: Sequence[float | None]
    text: Sequence[str] = ()


@dataclass(frozen=True)
class Panel:
    """One pair of axes. y_range: [low, high] or None; band: shaded interval of x; x_names: what stands at x = 0, 1, ...
    in the place of numbers."""

    x_title: str
    y_title: str
    lines: list[Line]
    title: str = ""
    x_log: bool = False
    y_log: bool = False
    y_range: list[float] | None = None
    band: list[float] | None = None
    wide: bool = False
    x_names: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class Figure:
    """Panels under one heading; key: (role, label) of the lines; caption: what to see."""

    id: str
    heading: str
    source: str
    caption: str
    key: list[tuple[str, str]]
    panels: list[Panel]

    def data(self) -> list[dict[str, Any]]:
        """Return the panels as JSON-ready values."""
        return [asdict(panel) for panel in self.panels]


def states_figure(start: pl.DataFrame) -> Figure:
    """Redraw figure 4: the four states and their estimates at the start of the run.

    start: t and est_x .. est_y_dot, and true_x .. true_y_dot where they are known.
    """
    shown = start.filter(pl.col("t") <= START_SHOWN)
    t = 1e3 * shown["t"].to_numpy()
    panels = []
    for name, label in STATE_LABELS.items():
        lines = []
        for kind, role in (("true", "truth"), ("est", "estimate")):
            if f"{kind}_{name}" in shown.columns:
                values = STATE_SCALES[name] * shown[f"{kind}_{name}"].to_numpy()
                lines.append(line(kind, role, t, values))
        panels.append(Panel("t [ms]", label, lines))
    return Figure(
        "states",
        "The states converge at once",
        "fig. 4",
        "Position and velocity along both axes over the first two milliseconds: the estimate meets "
        "the truth within the first periods, long before the parameters are known.",
        [("truth", "truth"), ("estimate", "estimate")],
        panels,
    )


def parameters_figure(trace: pl.DataFrame, scenario: str) -> Figure:
    """Redraw figure 5 (or 8): the eight parameters and their estimates."""
    varying = scenario == "varying"
    t = trace["t"].to_numpy()
    panels = []
    for name in PARAMETER_NAMES:
        unit, scale = PARAMETER_UNITS[name[0]]
        true, estimate = (scale * trace[f"{kind}_{name}"].to_numpy() for kind in ("true", "est"))
        panels.append(_convergence_panel(t, true, estimate, f"{name} [{unit}]", not varying))
    omega_true, omega = trace["omega_true"].to_numpy(), trace["est_omega_z"].to_numpy()
    panels.append(_convergence_panel(t, omega_true, omega, "Ωz [rad/s]", False))
    return Figure(
        "parameters",
        "The eight parameters converge",
        _source(scenario, "fig. 5", "fig. 8"),
        "Stiffness, damping, mass and rate of turn. What the design does not give begins 10 to 50 % off. "
        + ("After the damping doubles at 0.45 s the estimates find it again. " if varying else "")
        + "The patent shows convergence within 0.3 s."
        + ("" if varying else " Time is logarithmic but for the rate."),
        [("truth", "truth"), ("estimate", "estimate")],
        panels,
    )


def relative_error_figure(trace: pl.DataFrame, scenario: str) -> Figure:
    """Relative errors of the seven parameters on a logarithmic scale."""
    log = scenario != "varying"
    t = trace["t"].to_numpy()
    lines = [line(name, name, *rms_in_bins(t, relative_error(trace, name), log)) for name in PARAMETER_NAMES]
    lines.append(line("1 %", "limit", t[[min(1, len(t) - 1), -1]], np.full(2, WITHIN)))
    panel = Panel("t [s]", "relative error (rms)", lines, x_log=log, y_log=True, wide=True)
    return Figure(
        "relative-error",
        "Relative error of the parameters",
        "not in the patent",
        "The same estimates on a logarithmic scale, as rms over short windows. Dashed: the 1 % "
        "that counts as converged.",
        [(name, name) for name in PARAMETER_NAMES] + [("limit", "1 %")],
        [panel],
    )


def bound_figure(trace: pl.DataFrame, bounds: Bounds, scenario: str) -> Figure:
    """Errors over the Cramer-Rao bound."""
    log = scenario != "varying"
    t = trace["t"].to_numpy()
    lines = []
    for index, name in enumerate(PARAMETER_NAMES):
        middle, error = rms_in_bins(t, relative_error(trace, name), log)
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = error / bounds.relative_at(middle)[:, index]
        lines.append(line(name, name, middle, ratio))
    lines.append(line("bound", "limit", t[[min(1, len(t) - 1), -1]], np.ones(2)))
    panel = Panel("t [s]", "rms error / bound", lines, x_log=log, y_log=True, wide=True)
    return Figure(
        "bound",
        "Distance from what can be known",
        "not in the patent",
        "Error of each parameter, rms over short windows, over its posterior Cramér–Rao bound at "
        "that time, where the bound is computed. Over many seeds no observer stays below 1 on "
        "average; a single run scatters.",
        [(name, name) for name in PARAMETER_NAMES] + [("limit", "bound")],
        [panel],
    )


def angle_figure(trace: pl.DataFrame, unit: str, reference_deg: float | None, scenario: str) -> Figure:
    """Redraw figure 7 (or 10): the angle of the chosen unit against the truth."""
    t = trace["t"].to_numpy()
    true, angle = np.rad2deg(trace["angle_true"].to_numpy()), np.rad2deg(trace["angle"].to_numpy())
    quality = trace["angle_quality"].to_numpy()
    return Figure(
        "angle",
        "The angle follows the truth",
        _source(scenario, "fig. 7", "fig. 10"),
        f"Angle of unit {unit}, read off the vibration pattern and never integrated. It is valid "
        "from convergence on, where it is set to zero. Quality is 1 for a straight line and 0 for "
        "a circle, which has no angle.",
        [("truth", "truth"), ("estimate", f"unit {unit}")],
        [
            Panel(
                "t [s]",
                "angle [°]",
                [
                    line("truth", "truth", *envelope(t, true)),
                    line(f"unit {unit}", "estimate", *envelope(t, angle)),
                ],
                wide=True,
            ),
            Panel(
                "t [s]",
                "error [°]",
                [line("error", "error", *envelope(t, angle_error(trace, unit, reference_deg)))],
            ),
            Panel(
                "t [s]",
                "quality [1]",
                [line("quality", "estimate", *envelope(t, quality))],
                y_range=[-0.02, 1.05],
            ),
        ],
    )


def units_figure(trace: pl.DataFrame, reference_deg: Mapping[str, float | None]) -> Figure:
    """Angle errors of the three units, each less its mean after convergence, `reference_deg` by its name."""
    t = trace["t"].to_numpy()
    lines = []
    for name in UNIT_NAMES:
        error = angle_error(trace, name, reference_deg[name])
        lines.append(line(f"unit {name}", f"unit-{name}", *envelope(t, error)))
    return Figure(
        "units",
        "Three ways to read the angle",
        "not in the patent",
        "Angle error of unit A (band-pass, then angle), unit B (angle, then low-pass) and unit C "
        "(the response to the two tones subtracted, no filter), from the same run. At an edge of "
        "the rate a filter without lag still errs for a moment; "
        f"{1e3 * SETTLING:.0f} ms later that is over.",
        [("unit-A", "unit A"), ("unit-B", "unit B"), ("unit-C", "unit C")],
        [Panel("t [s]", "angle error [°]", lines, wide=True)],
    )


def filter_figure(filters: Sequence[Filter]) -> Figure:
    """Redraw figures 6 and 9: magnitude and phase of the filters."""
    used = [f for f in filters if f.shape == "lag_free"]
    panels = []
    for name in ("band-pass", "low-pass"):
        group = [f for f in filters if f.name == name]
        panels += _response_panels(name, group)
    caption = (
        "Shaded: the pass band. The phase of the filters in use is level where the angle is "
        "carried, at the oscillation frequency (A) and at zero (B): no lag for a steady rate. The "
        "price is up to 3 dB inside the band, which makes a swing of the angle too large: "
    )
    gains = (f"{100 * (abs(f.swing(SWING_HZ)) - 1):.1f} % ({f.name})" for f in used)
    caption += f"at {SWING_HZ:g} Hz by {' and '.join(gains)}."
    key = [("estimate", "in use")]
    others = [f for f in filters if f.shape == "butterworth"]
    if others:
        delays = (f"{1e3 * f.group_delay:.2f} ms ({f.name})" for f in others)
        caption += f" Dashed: Butterworth of the same band, which delays {' or '.join(delays)}."
        key.append(("reference", "Butterworth"))
    heading = "Filters of units A and B"
    return Figure("filters", heading, "figs. 6 and 9", caption, key, panels)


def _source(scenario: str, first: str, second: str) -> str:
    """Figure of TW 201137310 that shows the same: of the first embodiment or of the second."""
    drawn = {"constant": first, "varying": second}
    return drawn.get(scenario, f"as {first} of patent TW 201137310, for another motion")


def angle_error(trace: pl.DataFrame, unit: str, reference_deg: float | None) -> Floats:
    """Return the angle error of a unit [deg], less `reference_deg`, its mean just after convergence, shape (n,)."""
    error: Floats = np.rad2deg((trace[f"angle_{unit}"] - trace["angle_true"]).to_numpy())
    return error - (reference_deg or 0.0)


def relative_error(trace: pl.DataFrame, name: str) -> Floats:
    """Return estimate/true - 1 of one parameter, shape (n,)."""
    # A cross term may be zero; its relative error is then no number, and no point is drawn.
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio: Floats = trace[f"est_{name}"].to_numpy() / trace[f"true_{name}"].to_numpy()
    return ratio - 1


def line(name: str, role: str, x: Floats, y: Floats) -> Line:
    """Return a line with six significant digits a number and None for what is not finite."""
    return Line(name, role, _plain(x), _plain(y))


def envelope(x: Floats, y: Floats, log: bool = False) -> tuple[Floats, Floats]:
    """Return at most POINTS points, with the extremes of `y` kept, shape (n,) both.

    x, y: shape (n,). Fast ripple stays visible as its band, and no peak is lost. log: for a
    logarithmic axis of x; the first point is left out.
    """
    if len(y) <= POINTS:
        return x[log:], y[log:]
    starts = np.array(_bin_starts(len(y), POINTS // 2, log))
    x, y, starts = x[starts[0] :], y[starts[0] :], starts - starts[0]
    lacking, counts = np.isnan(y), np.diff([*starts, len(y)])
    empty = ~np.logical_or.reduceat(np.isfinite(y), starts)
    kept = [starts[empty]]
    for extreme, beyond in ((np.minimum, np.inf), (np.maximum, -np.inf)):
        values = np.where(lacking, beyond, y)
        places = np.flatnonzero(values == np.repeat(extreme.reduceat(values, starts), counts))
        # The first of each bin, all of which have one.
        first = places[np.searchsorted(places, starts)]
        kept.append(first[~empty])
    shown = np.unique(np.concatenate(kept))
    return x[shown], y[shown]


def rms_in_bins(t: Floats, error: Floats, log: bool = False) -> tuple[Floats, Floats]:
    """Return the middle of each of at most BINS windows [s] and the rms of `error` within it.

    log: windows in proportion to the time, without the first point.
    """
    starts = [start for start in _bin_starts(len(t), BINS, log) if start < len(t)]
    if not starts:
        return t[:0], error[:0]
    counts = np.diff([*starts, len(t)])
    power = np.add.reduceat(error**2, starts) / counts
    return np.add.reduceat(t, starts) / counts, np.sqrt(power)


def _bin_starts(count: int, bins: int, log: bool) -> list[int]:
    """First index of each bin, rising."""
    edges = np.geomspace(1, count, bins + 1) if log else np.linspace(0, count, bins + 1)
    return [int(start) for start in np.unique(edges[:-1].astype(int))]


def _plain(values: Floats) -> list[float | None]:
    return [float(f"{v:.6g}") if np.isfinite(v) else None for v in values]


def _convergence_panel(t: Floats, true: Floats, estimate: Floats, label: str, log: bool) -> Panel:
    """Truth and estimate, with room for first estimates that are 50 % off but not for wild ones."""
    size = np.abs(true).max()
    reach = 0.6 * size
    low = min(true.min(), max(estimate.min(), true.min() - reach))
    high = max(true.max(), min(estimate.max(), true.max() + reach))
    # At least 4 % of the value, so that a settled line is not drawn as noise.
    room = max(0.1 * (high - low), 0.02 * size)
    return Panel(
        "t [s]",
        label,
        [
            line("truth", "truth", *envelope(t, true, log)),
            line("estimate", "estimate", *envelope(t, estimate, log)),
        ],
        x_log=log,
        y_range=[float(low - room), float(high + room)],
    )


def _response_panels(name: str, group: Sequence[Filter]) -> list[Panel]:
    if not group:
        return []
    low, high = group[0].band_hz
    lowest, highest = (low / 8, high * 3) if low > 0 else (high / 40, high * 40)
    frequency = np.geomspace(lowest, min(highest, 0.49 * group[0].sample_rate), 400)
    magnitudes, phases = [], []
    for design in group:
        role = "estimate" if design.shape == "lag_free" else "reference"
        magnitude, phase = design.response(frequency)
        label = design.shape.replace("_", " ")
        magnitudes.append(line(label, role, frequency, magnitude))
        phases.append(line(label, role, frequency, phase))
    band = [float(np.log10(max(low, lowest))), float(np.log10(high))]
    unit = "A" if name == "band-pass" else "B"
    title = f"unit {unit}: {name}"
    return [
        Panel("f [Hz]", "magnitude [dB]", magnitudes, title, True, y_range=[-100, 10], band=band),
        Panel("f [Hz]", "phase [°]", phases, title, True, band=band),
    ]
