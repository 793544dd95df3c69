"""The report of a split: measured and theoretical spectrum, their cross-correlation, the fit and its likelihood."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from calibration.mode_split import Analysis, Correlation, Split, correlations, theoretical_spectrum
from calibration.mode_split.correlation import measured_spectrum
from calibration.mode_split.whittle import QUANTILE_95, profile
from gyrotwin.figures import POINTS, Figure, Line, Panel, envelope, line
from gyrotwin.report import as_json, template, write_whole

Floats = NDArray[np.float64]

OFFSET: Final = "f − f_x [Hz]"
WIDE: Final = 60.0
"""Half-widths of the hump either side of the line that the figure of the spectra shows at least."""
ZOOM: Final = 12.0
"""Half-widths of the hump either side that the figure of the fit shows."""


def render_split(summary: Mapping[str, Any], analysis: Analysis, out: Path) -> None:
    """Write the report to `out`, complete or not at all. summary: content of summary.json."""
    shown = [_spectra(analysis), _fit(analysis), _correlation(analysis)]
    page = template("split.html.j2").render(
        summary=summary,
        figures=shown,
        data=as_json({figure.id: figure.data() for figure in shown}),
    )
    write_whole(page, out)


def _spectra(analysis: Analysis) -> Figure:
    split, spectrum = analysis.split, analysis.spectrum
    f, m = measured_spectrum(analysis.part)
    shown = _shown(analysis)
    f, m = (values[np.abs(f - split.f_x) <= shown] for values in (f, m))
    grid = np.sort(
        np.concatenate([np.linspace(f[0], f[-1], POINTS), split.f_y + np.linspace(-ZOOM, ZOOM, 400) * _half(analysis)])
    )
    theory = theoretical_spectrum(grid, split.f_x, split.q)
    theory *= 0.5 * split.model.hump / theory.max()
    model = 0.5 * split.model.density(grid)
    panel = Panel(
        OFFSET,
        "two-sided density [V²/Hz]",
        [
            _line(split, "M, measured", "measured", *_averaged(f, m)),
            _line(split, "N at f_x", "error", grid, theory),
            _line(split, "M, model", "estimate", grid, model),
        ],
        y_log=True,
        y_range=[float(np.log10(model.min() / 3)), float(np.log10(3 * m.max()))],
        wide=True,
    )
    return Figure(
        "spectra",
        "Measured and theoretical spectrum",
        "patent CN 111272193, M and N",
        "Means over neighbouring bins of the periodogram. The line at the drive frequency is Coriolis force and "
        "quadrature; the hump is the thermal motion of the sense mode. N is the theoretical hump for this "
        "Q, preset at the drive frequency and "
        f"drawn at the height of the one found. Masked around the line: ±{spectrum.guard:.3g} Hz.",
        [("measured", "M, measured"), ("estimate", "M, model"), ("error", "N at the preset frequency")],
        [panel],
    )


def _fit(analysis: Analysis) -> Figure:
    split = analysis.split
    near = analysis.spectrum.band(split.f_y - ZOOM * _half(analysis), split.f_y + ZOOM * _half(analysis))
    f, power = near.f[near.valid], near.power[near.valid]
    grid = np.linspace(f[0], f[-1], 400)
    density = split.model.density(grid)
    edges = np.array([0.0, 1.3 * density.max()])
    bounds = [_line(split, "95 %", "limit", np.full(2, edge), edges) for edge in split.interval]
    low, high = split.interval
    offsets = np.linspace(1.4 * low - 0.4 * high, 1.4 * high - 0.4 * low, 31)
    fallen = profile(split.found.likelihood, split.found.fit, offsets)
    return Figure(
        "fit",
        "The hump and how well its place is known",
        "",
        "First: one-sided density near the hump, means over neighbouring bins, with the fitted model; dashed: the ends "
        "of the 95 % interval of f_y. Second: fall of the log-likelihood, maximised over all else, as f_y moves off "
        f"its best value; the interval ends where it has fallen by {QUANTILE_95:.2f}.",
        [("measured", "M, measured"), ("estimate", "model, likelihood"), ("limit", "95 %")],
        [
            Panel(
                OFFSET,
                "density [V²/Hz]",
                [
                    _line(split, "M, measured", "measured", *_averaged(f, power, 96)),
                    _line(split, "model", "estimate", grid, density),
                    *bounds,
                ],
            ),
            Panel(
                "split f_y − f_x [Hz]",
                "fall of ln L",
                [
                    _line(split, "ln L", "estimate", offsets, fallen),
                    _line(split, "95 %", "limit", offsets[[0, -1]], np.full(2, QUANTILE_95)),
                ],
            ),
        ],
    )


def _correlation(analysis: Analysis) -> Figure:
    split = analysis.split
    (printed, _), (cut, _) = correlations(analysis)
    panels = []
    for title, found in (("as printed", printed), ("line removed", cut)):
        inside = np.abs(found.lag) <= _shown(analysis)
        r = found.r[inside] / found.r[inside].max()
        lines = [line("R", "estimate", *envelope(found.lag[inside], r))]
        low = float(np.quantile(r, 0.02))
        lines += [
            line(name, role, np.full(2, at), np.array([low, 1.0])) for name, role, at in _marks(found, split.split)
        ]
        panels.append(Panel("lag λ [Hz]", "R / largest", lines, title=title, y_log=True))
    return Figure(
        "correlation",
        "Cross-correlation of N and M",
        "patent CN 111272193, R(λ)",
        "R over the lag of N, preset at f_x: the line gives the peak at zero, the hump the one at the split. First: as "
        "in the patent, the line in M. Second: the lines in M replaced by what lies around them. Orange: the hump's "
        "peak as read from R; dashed: the split by maximum likelihood.",
        [("estimate", "R"), ("error", "peak of the hump in R"), ("limit", "split, maximum likelihood")],
        panels,
    )


def _line(split: Split, name: str, role: str, f: Floats, y: Floats) -> Line:
    """A line over the distance from the drive line: six digits of that are finer than of f."""
    return line(name, role, f - split.f_x, y)


def _marks(found: Correlation, split: float) -> list[tuple[str, str, float]]:
    marks = [("split", "limit", split)]
    return marks if found.hump_lag is None else [("peak", "error", found.hump_lag), *marks]


def _shown(analysis: Analysis) -> float:
    """How far either side of the drive line the wide figures reach [Hz]."""
    return min(analysis.part.band, max(4 * abs(analysis.split.split), WIDE * _half(analysis)))


def _half(analysis: Analysis) -> float:
    """Half-width of the hump, at least so many bins that means over them fill a figure [Hz]."""
    return max(analysis.split.model.half_width, 4 * analysis.spectrum.bin)


def _averaged(f: Floats, power: Floats, points: int = POINTS) -> tuple[Floats, Floats]:
    """Means over equal counts of neighbours, at most ``points``; a line keeps its peak in its own mean."""
    size = max(len(f) // points, 1)
    starts = np.arange(0, len(f), size)
    count = np.diff([*starts, len(f)])
    return np.add.reduceat(f, starts) / count, np.add.reduceat(power, starts) / count
