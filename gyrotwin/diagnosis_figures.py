"""The figures of a diagnosis as plain data: gaps, maps, scores, spectra; ready for JSON."""

import base64
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy.signal import welch

from discrepancy.data.dataset import Dataset
from discrepancy.data.linear_fit import mode_frequencies
from discrepancy.data.record import Record
from discrepancy.name.score import Step
from discrepancy.tell.answer import Diagnosis
from gyrotwin.diagnosis_console import stage_label
from gyrotwin.figures import Figure, Line, Panel, line

Floats = NDArray[np.float64]

MAP_TIMES, MAP_BANDS = 120, 140
"""Cells of a time-frequency map: about one for three pixels of half the page."""
FEWEST_BANDS: Final = 4
"""Of these, below which a map shows nothing."""
SPECTRUM_POINTS: Final = 500
BACKBONE_POINTS: Final = 60
RESOLUTION: Final = 80
"""Bins up to the highest frequency of interest, the fourth multiple of the highest mode."""
STANDS_OUT_DB: Final = 6.0
"""Further rows are shown as far as their median stands out of the noise by this."""
LEAST_DB, MOST_DB = 30.0, 80.0
"""dB over the noise that the colours of a map span: by at least 30, single bins of noise, up to 10 dB, stay pale."""
EFFECT_COLOURS: Final = ("effect-0", "effect-1", "effect-2", "effect-3")


@dataclass(frozen=True)
class Heat(Panel):
    """A map over ``columns`` and ``rows``: z[row][column] (None: empty), or ``levels``, one byte a cell in base64, row
    by row, that divide ``z_range`` [low, high]; text of each cell or none."""

    columns: list[Any] = field(default_factory=list)
    rows: list[Any] = field(default_factory=list)
    z: list[list[float | None]] = field(default_factory=list)
    levels: str = ""
    z_title: str = ""
    z_range: list[float] = field(default_factory=list)
    text: list[list[str]] = field(default_factory=list)
    colours: str = "gap"
    height: int = 0


@dataclass(frozen=True)
class Bars(Panel):
    """Bars over ``names`` (None: no bar), a dot for each run: dots {run: values}; ``floor``: a dashed level or None."""

    names: list[str] = field(default_factory=list)
    values: list[float | None] = field(default_factory=list)
    texts: list[str] = field(default_factory=list)
    dots: dict[str, list[float | None]] = field(default_factory=dict)
    floor: float | None = None
    height: int = 340


def misfit_figure(found: Diagnosis, floor: float | None) -> Figure:
    """The misfit on held-out runs at every stage, beside the noise floor."""
    whole = [_finite(stage.misfit[""]) for stage in found.stages]
    # A bar that is not there bears no text.
    names = [stage_label(stage.name) + ("<br>left all bounds" if value is None else "")
             for stage, value in zip(found.stages, whole, strict=True)]  # fmt: skip
    runs = [run for run in found.stages[0].misfit if run]
    dots = {run: [_finite(stage.misfit[run]) for stage in found.stages] for run in runs} if len(runs) > 1 else {}
    texts = ["" if value is None else f"{value:.3g}" for value in whole]
    drawn = [value for value in whole if value is not None] or [1.0]
    lowest, highest = min(*drawn, floor or drawn[0]), max(drawn)
    panel = Bars(
        "", "misfit [1]", [], y_log=True, wide=True, names=names, values=whole, texts=texts, dots=dots, floor=floor,
        y_range=[float(np.log10(lowest / 4)), float(np.log10(highest * 2))],
    )  # fmt: skip
    key = [("before", "not named yet"), ("after", "effects in")]
    key += [("run", "each run")] if dots else []
    key += [("limit", "noise floor")] if floor else []
    said = "" if floor else " The sample rate leaves no band that holds noise alone, so no floor is drawn."
    return Figure(
        "misfit",
        "How the gap closes",
        "held-out runs",
        "rms(v − v_sim)/rms(v) on runs that no fit and no choice has seen, from the nominal values over the refit of "
        "mass, stiffness and damping to each effect." + said,
        key,
        [panel],
    )


def map_figure(data: Dataset, found: Diagnosis, noise: float | None) -> Figure:
    """Time and frequency of the disagreement after the refit and at the end, on the held-out run that the refit misses
    most; ``noise``: rms a sample [V]."""
    before, after = found.stages[min(1, len(found.stages) - 1)], found.stages[-1]
    record = max(data.held_out, key=lambda held: before.misfit[held.name])
    run = record.name
    level = noise or _quiet_level(_left(after.residuals[run], record))
    pairs = [("after the refit", before), ("improved model", after)]
    if before is after:
        pairs = pairs[1:]
    harmonics = 4 * float(mode_frequencies(after.parameters, record.axes)[-1])
    maps = [
        (axis, title, *_map(_left(stage.residuals[run], record)[:, axis], record, level, harmonics))
        for axis in range(record.axes)
        for title, stage in pairs
    ]
    stands_out = [float(f[np.median(z, axis=1) > STANDS_OUT_DB].max(initial=0.0)) for *_, f, z in maps]
    top = max(harmonics, 1.1 * max(stands_out))
    # Of what no spring holds no frequency is of interest before another, where none stands out.
    top = top if np.sum(maps[0][3] <= top) >= FEWEST_BANDS else np.inf
    maps = [(axis, title, t, f[f <= top], z[f <= top]) for axis, title, t, f, z in maps]
    z_range = [0.0, float(np.clip(max(z.max() for *_, z in maps), LEAST_DB, MOST_DB))]
    panels: list[Panel] = []
    for axis, title, t, f, z in maps:
        panels.append(
            Heat(
                "t [s]",
                "f [kHz]" if f[-1] > 2000 else "f [Hz]",
                [],
                f"v_{'xy'[axis]}: {title}",
                columns=_numbers(t),
                rows=_numbers(f / 1000 if f[-1] > 2000 else f),
                levels=_levels(z, z_range),
                z_title="dB",
                z_range=z_range,
            )
        )
    reference = "the noise of the sensor" if noise else "the quietest band (the noise is not known)"
    return Figure(
        "map",
        "Where simulation and measurement disagree",
        run,
        f"Power of the residual over {reference}, in dB, on the held-out run that the refitted model misses most. "
        "An improved model leaves an even, pale map: noise.",
        [],
        panels,
    )


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _left(residual: Floats, record: Record) -> Floats:
    """A residual (n, axes) [V] with all of the voltage where the simulated motion has left all bounds."""
    return np.where(np.isfinite(residual), residual, record.v)


def _map(residual: Floats, record: Record, level: float, top: float) -> tuple[Floats, Floats, Floats]:
    """Times [s], frequencies [Hz] and power over the noise [dB] (bands, times); ``top``: the highest frequency of
    interest [Hz]."""
    n = len(residual)
    size = int(np.clip(RESOLUTION * record.sample_rate / top, 16, n // 8))
    starts = np.unique(np.linspace(0, n - size, min(MAP_TIMES, max(n // (size // 2), 1))).astype(int))
    window = np.hanning(size)
    spectra = np.stack([np.abs(np.fft.rfft(residual[s : s + size] * window)) ** 2 for s in starts], axis=1)
    spectra /= level**2 * np.sum(window**2)
    edges = np.unique(np.linspace(0, len(spectra), min(MAP_BANDS, len(spectra)) + 1).astype(int))
    power = np.add.reduceat(spectra, edges[:-1], axis=0) / np.diff(edges)[:, None]
    f = (edges[:-1] + np.diff(edges) / 2 - 0.5) * record.sample_rate / size
    t = record.t[0] + (starts + size / 2) / record.sample_rate
    return t, f, 10 * np.log10(np.maximum(power, 1e-3))


def _quiet_level(residual: Floats) -> float:
    """Deviation a sample [V] as of white noise with the density of the quietest tenth of the spectrum."""
    window = np.hanning(len(residual))[:, None]
    power = np.abs(np.fft.rfft(residual * window, axis=0)) ** 2 / np.sum(window**2)
    means = [float(np.mean(part)) for part in np.array_split(power, 40)]
    return float(np.sqrt(np.quantile(means, 0.1))) or 1e-300


def score_figure(steps: Sequence[Step]) -> Figure:
    """Share of the residual that each effect takes away, at every step of the search."""
    best: dict[str, float] = {}
    for step in steps:
        for name, score in step.scores.items():
            best[name] = max(best.get(name, 0.0), float(score.share))
    names = sorted(best, key=lambda name: best[name])
    heads = [f"{k}: {step.accepted or 'none'}" for k, step in enumerate(steps, 1)]
    z = [[_share(step, name) for step in steps] for name in names]
    text = [["" if v is None else _percent(100 * 10**v) for v in row] for row in z]
    panel = Heat(
        "step: accepted", "", [], wide=True, columns=heads, rows=names, z=z, z_title="share", z_range=[-6.0, 0.0],
        text=text, colours="score", height=90 + 21 * len(names),
    )  # fmt: skip
    return Figure(
        "scores",
        "Every effect at every step",
        "fitted runs",
        "Share of what the present model leaves of the residual that each effect alone would take away, to first "
        "order, after projection on what is fitted already. At each step the best ones are refitted and one is "
        "accepted; at the last none is significant and worth a parameter. Empty: in the model by then, or without "
        "any trace in these runs.",
        [],
        [panel],
    )


def _percent(value: float) -> str:
    return f"{value:.3g} %" if value >= 10 else f"{value:.2g} %" if value >= 1e-3 else "< 0.001 %"


def _share(step: Step, name: str) -> float | None:
    score = step.scores.get(name)
    if score is None or not score.share > 0:
        return None
    return round(float(np.log10(score.share)), 2)


def spectrum_figure(data: Dataset, found: Diagnosis, noise: float | None) -> Figure:
    """Spectra of a held-out run: measured, what the model leaves before and after, what each effect does."""
    before, after = found.stages[min(1, len(found.stages) - 1)], found.stages[-1]
    record = max(data.held_out, key=lambda held: before.misfit[held.name])
    run = record.name
    panels = []
    for axis in range(record.axes):
        signals = {"measured": ("truth", record.v[:, axis])}
        if before is not after:
            signals["residual after the refit"] = ("before", _left(before.residuals[run], record)[:, axis])
        for role, (name, change) in zip(EFFECT_COLOURS, found.removed.items(), strict=False):
            signals[f"effect of {name}"] = (role, _left(change[run], record)[:, axis])
        signals["residual, improved model"] = ("after", _left(after.residuals[run], record)[:, axis])
        lines = [line(name, role, *_density(v, record.sample_rate)) for name, (role, v) in signals.items()]
        lines = [own for own in lines if own.x]
        if noise:
            f = np.array([lines[0].x[0], lines[0].x[-1]], dtype=float)
            lines.append(line("noise of the sensor", "limit", f, np.full(2, noise * np.sqrt(2 / record.sample_rate))))
        shown_range = _range(signals["residual, improved model"][1], lines, record.sample_rate)
        panels.append(
            Panel(
                "f [Hz]",
                "density [V/√Hz]",
                lines,
                f"v_{'xy'[axis]}",
                True,
                True,
                y_range=shown_range,
                wide=True,
            )
        )
    key = [("truth", "measured"), ("before", "residual after the refit"), ("after", "residual, improved model")]
    key += [(role, name) for role, name in zip(EFFECT_COLOURS, found.removed, strict=False)]
    key += [("limit", "noise of the sensor")] if noise else []
    return Figure(
        "spectra",
        "What each effect does to the spectrum",
        run,
        "One-sided spectra of the same held-out run. The line of an effect is the change of the output of the "
        "improved model when that effect is taken out of it.",
        [entry for entry in key if entry[0] != "before" or before is not after],
        panels,
    )


def backbone_figure(found: Diagnosis) -> Figure | None:
    """Frequency and damping over amplitude, measured and by the models; None where no run shows it."""
    if found.bent is None:
        return None
    names = {"measured": ("measured", "truth"), "refit": ("after the refit", "before"),
             "final": ("improved model", "after")}  # fmt: skip
    shown = {names[key][0]: (names[key][1], own) for key, own in found.bent.curves.items()}
    if len(found.stages) <= 2:
        shown.pop("after the refit", None)
    top = max(float(own.amplitude.max()) for _, own in shown.values())
    unit, scale = ("µm", 1e6) if top < 1e-3 else ("mm", 1e3) if top < 1 else ("m", 1.0)
    base = float(f"{min(float(own.frequency.min()) for _, own in shown.values()):.4g}")
    titles = (f"frequency − {base:g} Hz [Hz]", "quality factor [1]")
    lines: list[list[Line]] = [[], []]
    for name, (role, own) in shown.items():
        for drawn, values in zip(lines, (own.frequency - base, own.quality), strict=True):
            drawn.append(line(name, role, *_binned(scale * own.amplitude, values)))
    where = f"v_{'xy'[found.bent.axis]}"
    panels = [Panel(f"amplitude [{unit}]", title, own, where) for title, own in zip(titles, lines, strict=True)]
    return Figure(
        "backbone",
        "Frequency and damping over amplitude",
        found.bent.run,
        "What stiffness and damping act at each amplitude, window by window, in the measured motion and in that of the "
        "models under the same force. A spring that is not linear bends the frequency, friction and gas the damping.",
        [(role, name) for name, (role, _) in shown.items()],
        list(panels),
    )


def _binned(x: Floats, y: Floats) -> tuple[Floats, Floats]:
    """Medians over ``x``, rising, at most BACKBONE_POINTS."""
    order = np.argsort(x)
    parts = np.array_split(order, min(BACKBONE_POINTS, len(x)))
    return np.array([np.median(x[part]) for part in parts]), np.array([np.median(y[part]) for part in parts])


def _range(residual: Floats, lines: Sequence[Line], rate: float) -> list[float]:
    """Decades from a fiftieth of the final residual's density to above the highest line."""
    low = np.median(_density(residual, rate)[1]) / 50
    high = max(value for own in lines for value in own.y if value is not None)
    return [float(np.log10(max(low, 1e-9 * high))), float(np.log10(2 * high))]


def _density(v: Floats, rate: float) -> tuple[Floats, Floats]:
    """Frequencies [Hz] and amplitude density [V/√Hz], at most SPECTRUM_POINTS of them, evenly on a logarithmic axis;
    averages of power."""
    size = min(len(v), max(len(v) // 4, 256))
    f, power = welch(v, rate, nperseg=size, detrend=False)
    inner = f > 0
    f, power = f[inner], power[inner]
    edges = np.unique(np.geomspace(1, len(f) + 1, SPECTRUM_POINTS).astype(int) - 1)
    mean = np.add.reduceat(power, edges[:-1]) / np.diff(edges)
    middle = np.add.reduceat(f, edges[:-1]) / np.diff(edges)
    return middle, np.sqrt(np.maximum(mean, 1e-40))


def _numbers(values: Floats) -> list[float]:
    return [float(f"{v:.5g}") for v in values]


def _levels(z: Floats, z_range: Sequence[float]) -> str:
    """``z`` (rows, columns) as one byte a cell that divides ``z_range``, in base64."""
    low, high = z_range
    return base64.b64encode(
        np.clip(np.rint((z - low) / (high - low) * 255), 0, 255).astype(np.uint8).tobytes()
    ).decode()
