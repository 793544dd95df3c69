"""A log-log diagram as SVG text, self-contained."""

import math
from collections.abc import Sequence
from html import escape
from typing import Final, NamedTuple

COLOURS: Final = ("#b2182b", "#ef8a00", "#1b7837", "#2166ac", "#111111")
WIDTH, HEIGHT, LEFT, BOTTOM, TOP, GAP = 430, 380, 70, 60, 70, 20


class Series(NamedTuple):
    """A line with markers: x, y and a label at each point, all positive."""

    name: str
    x: Sequence[float]
    y: Sequence[float]


class Panel(NamedTuple):
    """One pair of axes; ``level``: a horizontal line at the target."""

    title: str
    series: Sequence[Series]
    level: float


class _Scale(NamedTuple):
    low: float
    high: float
    begin: float
    end: float

    def at(self, value: float) -> float:
        share = (math.log10(value) - self.low) / (self.high - self.low)
        return self.begin + share * (self.end - self.begin)

    def decades(self) -> list[int]:
        return list(range(math.ceil(self.low), math.floor(self.high) + 1))


def log_log(title: str, x_label: str, y_label: str, panels: Sequence[Panel]) -> str:
    """SVG of the panels side by side, with the same scales."""
    points = [(x, y) for panel in panels for series in panel.series for x, y in zip(series.x, series.y, strict=True)]
    x_low, x_high = (math.log10(f(x for x, _ in points)) for f in (min, max))
    levels = [y for _, y in points] + [panel.level for panel in panels]
    y_low, y_high = math.floor(math.log10(min(levels))), math.ceil(math.log10(max(levels)))
    width, height = LEFT + len(panels) * (WIDTH + GAP), TOP + HEIGHT + BOTTOM
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" font-family="sans-serif">',
        f'<rect width="{width}" height="{height}" fill="white"/>',
        _text(LEFT, 20, title, size=15),
        _text(LEFT + len(panels) * (WIDTH + GAP) / 2, height - 14, x_label, anchor="middle"),
        f'<g transform="translate(16 {TOP + HEIGHT / 2}) rotate(-90)">{_text(0, 0, y_label, anchor="middle")}</g>',
    ]
    names = list(dict.fromkeys(series.name for panel in panels for series in panel.series))
    for i, name in enumerate(names):
        parts.append(_text(LEFT + 10 + 172 * i, 40, f"● {name}", colour=COLOURS[i % len(COLOURS)]))
    for i, panel in enumerate(panels):
        left = LEFT + i * (WIDTH + GAP)
        across = _Scale(x_low - 0.1, x_high + 0.1, left, left + WIDTH)
        up = _Scale(y_low, y_high, TOP + HEIGHT, TOP)
        parts += _axes(panel, across, up, numbers=i == 0)
        for series in panel.series:
            parts += _line(series, across, up, COLOURS[names.index(series.name) % len(COLOURS)])
    return "\n".join([*parts, "</svg>"]) + "\n"


def _axes(panel: Panel, across: _Scale, up: _Scale, *, numbers: bool) -> list[str]:
    parts = [
        f'<rect x="{across.begin}" y="{up.end}" width="{across.end - across.begin}" height="{up.begin - up.end}" '
        'fill="none" stroke="#444"/>',
        _text(across.begin + 8, up.end - 8, panel.title),
    ]
    for decade in up.decades():
        y = up.at(10.0**decade)
        parts.append(f'<line x1="{across.begin}" x2="{across.end}" y1="{y:.1f}" y2="{y:.1f}" stroke="#e4e4e4"/>')
        if numbers and decade % 2 == 0:
            parts.append(_text(across.begin - 6, y + 4, f"1e{decade}", anchor="end"))
    for decade in across.decades():
        for multiple in (1, 2, 5):
            value = multiple * 10.0**decade
            if across.low < math.log10(value) < across.high:
                x = across.at(value)
                parts.append(f'<line x1="{x:.1f}" x2="{x:.1f}" y1="{up.begin}" y2="{up.end}" stroke="#e4e4e4"/>')
                parts.append(_text(x, up.begin + 16, f"{value:g}", anchor="middle"))
    y = up.at(panel.level)
    parts.append(
        f'<line x1="{across.begin}" x2="{across.end}" y1="{y:.1f}" y2="{y:.1f}" stroke="#888" stroke-dasharray="5 4"/>'
    )
    return parts


def _line(series: Series, across: _Scale, up: _Scale, colour: str) -> list[str]:
    points = [(across.at(x), up.at(y)) for x, y in zip(series.x, series.y, strict=True)]
    path = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
    line = f'<polyline points="{path}" fill="none" stroke="{colour}" stroke-width="1.6"/>'
    return [line, *(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="3.2" fill="{colour}"/>' for x, y in points)]


def _text(x: float, y: float, text: str, *, anchor: str = "start", colour: str = "#222", size: int = 12) -> str:
    return (
        f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" fill="{colour}" font-size="{size}">{escape(text)}</text>'
    )
