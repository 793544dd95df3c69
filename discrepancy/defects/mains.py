"""Lines of the mains in the voltage: 50 or 60 Hz and harmonics, of any phase in each run and channel.

Least squares at known frequencies: S. M. Kay, Fundamentals of Statistical Signal Processing: Estimation Theory, 1993,
example 4.2. Where runs have enough periods each line stands out of the bins beside it. In shorter ones lines run into
each other: there all harmonics of one fundamental are fitted to all runs, and held against lines half way between them,
which whatever wanders has as well.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from scipy.stats import chi2
from scipy.stats import f as f_distribution

from discrepancy.criteria import Criteria
from discrepancy.data.algebra import inverse_scaled
from discrepancy.data.record import Floats, Record
from discrepancy.fit.defect import Blemish, Data, Found, Left, Level
from gyro_model.quantities import size

FREQUENCIES: Final = (50.0, 60.0)
TOLERANCE: Final = 0.2
"""Hz by which the mains of a large grid wander."""
HARMONICS: Final = 10
PERIODS, FEWEST = 2.5, 1.6
"""Of the mains in a run, from which lines stand apart; and at least: below, lines are not told from a drift, and those
half way between them, 0.8 bins off, not from them."""
DRIVE: Final = 0.2
"""Share of the force's power on those lines from which they are the experiment's own."""
AROUND: Final = 12
"""Bins to each side that say how strong the residual is beside a line."""

ALONE: Final = 6.0
"""Times the power of the bins on both sides, three to five off, that a line must have: a Hann window leaves nothing
there, while a residual that rises or falls, or is modulated, has as much."""

ASIDE, CLEARLY = 0.15, 25.0
"""How far about a grid's frequency others are tried, short of the other grid's, and what one of them has to take more
to count: five deviations."""

ON_LINES: Final = 0.9
"""Share of what a force has at low frequencies, on lines and half way between them, from which a short run is driven on
them: of a force without lines it is a half."""

FAR: Final = 100.0
"""By which a residual's line must stand further out of the bins around it than the force's does to be none of its: a
wrong model leaves of a smooth force what is smooth, but for a resonance."""
LINE: Final = 1e-6
"""Share of the force's power from which a line of it counts: its answer, by a model that is wrong by 1 %, is then 1e-5
of the voltage."""

AMPLITUDE = size("mains", "V", "amplitude of the strongest line")


def find(left: Left, criteria: Criteria) -> Found | None:
    """The frequency whose harmonics stand out of the residuals most, and its lines."""
    records, residuals = left.records, left.residuals
    periods = min(len(r.t) / r.sample_rate for r in records) * min(FREQUENCIES)
    if periods < FEWEST:
        return None
    best: tuple[float, float, list[int]] = (np.inf, 0.0, [])
    for centre in FREQUENCIES:
        seen = _apart if periods >= PERIODS else _together
        sure = seen(records, residuals, centre, criteria.noise_chance / (2 * HARMONICS))
        if sure:
            # In a short record the lines of both grids are in the same bins: that which leaves less is it.
            grid = np.linspace(centre - TOLERANCE, centre + TOLERANCE, 41)
            rests = [sum(_rest(r, e, f, sure) for r, e in zip(records, residuals, strict=True)) for f in grid]
            best = min(best, (min(rests), float(grid[int(np.argmin(rests))]), sure))
    _, f0, sure = best
    if not sure:
        return None
    data = tuple(_lines(r, e, f0, sure) for r, e in zip(records, residuals, strict=True))
    strongest, deviation = 0.0, 0.0
    for own, record, residual in zip(data, records, residuals, strict=True):
        lines = np.array(own).reshape(-1, 2 * record.axes + 1)[:, 1:]
        size_now = float(np.hypot(lines[:, ::2], lines[:, 1::2]).max())
        if size_now > strongest:
            strongest = size_now
            rest = residual - (record.v - without(record, own).v)
            deviation = float(np.std(rest)) * float(np.sqrt(2 / len(residual)))
    return Found(data, {"mains": Level(strongest, strongest - 1.96 * deviation, strongest + 1.96 * deviation)})


def without(record: Record, data: Data) -> Record:
    """The run without the lines: each has its frequency [Hz], and cosine and sine [V] of each channel."""
    lines = np.array(data).reshape(-1, 2 * record.axes + 1)
    v = record.v.copy()
    for f, *parts in lines:
        phase = 2 * np.pi * f * (record.t - record.t[0])
        wave = np.column_stack((np.cos(phase), np.sin(phase)))
        v -= wave @ np.reshape(parts, (record.axes, 2)).T
    return replace(record, v=v)


def again(found: Found, record: Record, residual: Floats) -> Data:
    """The lines of another run, at the frequencies that were found."""
    lines = np.array(next(data for data in found.data if data)).reshape(-1, 2 * record.axes + 1)
    return _lines(record, residual, 1.0, lines[:, 0].tolist())


def _waves(record: Record, f0: float, harmonics: Sequence[float]) -> Floats:
    phase = 2 * np.pi * f0 * (record.t - record.t[0])[:, None] * np.array(harmonics)
    return np.hstack((np.cos(phase), np.sin(phase)))


def _below(record: Record) -> list[int]:
    return [n for n in range(1, HARMONICS + 1) if n * max(FREQUENCIES) < 0.45 * record.sample_rate]


def _on_lines(record: Record, f0: float) -> float:
    """The share of the force's power on the lines, a bin to each side."""
    power = (np.abs(np.fft.rfft(record.u * np.hanning(len(record.u))[:, None], axis=0)) ** 2).sum(axis=1)
    f = np.fft.rfftfreq(len(record.u), 1 / record.sample_rate)
    near = np.zeros(len(f), np.bool_)
    for n in _below(record):
        near |= np.abs(f - n * f0) < 1.5 * f[1]
    # A dense spectrum has its share on any lines: what is beyond that counts.
    return float(power[near].sum() / max(power.sum(), 1e-300)) - float(near.mean()) * 5


def _driven(record: Record, f0: float) -> list[int]:
    """Harmonics at which the force has a line of its own: what a wrong model leaves there is a line too."""
    power, lines = _force(record, f0)
    return [n for n, (here, beside) in lines.items() if here > LINE * power and here > ALONE * beside]


def _force(record: Record, f0: float) -> tuple[float, dict[int, tuple[float, float]]]:
    """The force's power, and by harmonic that on its line and in the bins around it, in the median."""
    power = (np.abs(np.fft.rfft(record.u * np.hanning(len(record.u))[:, None], axis=0)) ** 2).sum(axis=1)
    spacing, lines = record.sample_rate / len(record.u), {}
    for n in _below(record):
        k = round(n * f0 / spacing)
        beside = np.concatenate((power[max(k - 2 - AROUND, 0) : max(k - 2, 0)], power[k + 3 : k + 3 + AROUND]))
        lines[n] = float(power[max(k - 2, 0) : k + 3].max()), float(np.median(beside))
    return float(power.sum()), lines


def _apart(records: Sequence[Record], residuals: Sequence[Floats], f0: float, chance: float) -> list[int]:
    """The harmonics whose lines stand out of the bins around them."""
    gains, runs = _gains(records, residuals, f0)
    # Two degrees a line, channel and run.
    needed = chi2.isf(chance, 2 * records[0].axes * runs)
    return [n + 1 for n, gain in enumerate(gains) if gain > needed[n]]


def _together(records: Sequence[Record], residuals: Sequence[Floats], f0: float, chance: float) -> list[int]:
    """The harmonics that explain, beside all others, more than lines half way between them do of what is left."""
    usual = sorted({n for r in records for n in _below(r)})
    halves = [*(n - 0.5 for n in usual), usual[-1] + 0.5] if usual else []
    gains, of_lines, between, of_between, rest, count = np.zeros(len(usual)), np.zeros(len(usual)), 0.0, 0, 0.0, 0
    for record, residual in zip(records, residuals, strict=True):
        slow, lines = _slow(record), _waves(record, f0, usual)[record.valid]
        beside, own = _waves(record, f0, halves)[record.valid], residual[record.valid]
        parts = np.hstack((slow, lines, beside, own, record.u[record.valid]))
        gram, known = parts.T @ parts, slow.shape[1]
        end, all_lines = known + lines.shape[1], known + lines.shape[1] + beside.shape[1]
        values, force = (range(all_lines + k, all_lines + k + record.axes) for k in (0, record.axes))
        left, last = _left(gram, range(end), values), _left(gram, range(all_lines), values)
        between, of_between = between + left - last, of_between + beside.shape[1] * record.axes
        rest, count = rest + last, count + own.size
        # What the force has at low frequencies, on lines and between them.
        on, off = (_left(gram, range(i), force) - _left(gram, range(j), force)
                   for i, j in ((known, end), (end, all_lines)))  # fmt: skip
        driven = usual if on > ON_LINES * (on + off) else _driven(record, f0)
        for i in (i for i, n in enumerate(usual) if n not in driven):
            others = [j for j in range(end) if j - known not in (i, i + len(usual))]
            gains[i] += _left(gram, others, values) - left
            of_lines[i] += 2 * record.axes
    variance = max(between / max(of_between, 1), rest / max(count, 1))
    needed = np.maximum(f_distribution.isf(chance, np.maximum(of_lines, 1), of_between), ALONE) * of_lines * variance
    sure = [n for n, gain, least in zip(usual, gains, needed, strict=True) if gain > least]
    return sure if sure and not _elsewhere(records, residuals, f0, sure, rest / count) else []


def _elsewhere(
    records: Sequence[Record], residuals: Sequence[Floats], f0: float, harmonics: Sequence[int], variance: float
) -> bool:
    """Whether another fundamental than that of a grid explains clearly more: a line of any other frequency is hum to
    the width of a short record's lines. variance: of the noise [V²]."""
    aside = f0 * np.linspace(1 - ASIDE, 1 + ASIDE, 61)
    near = f0 + TOLERANCE * np.linspace(-1, 1, 9)
    inside, outside = (
        min(sum(_rest(r, e, f, harmonics) for r, e in zip(records, residuals, strict=True)) for f in grid)
        for grid in (near, aside)
    )
    return outside < inside - CLEARLY * variance


def _slow(record: Record) -> Floats:
    """What a residual may follow beside lines: an offset, a drift, and each condition that changes."""
    t = (record.t - record.t[0]) / (record.t[-1] - record.t[0])
    changing = [own - own.mean() for own in record.conditions.values() if np.ptp(own) > 0]
    return np.column_stack([np.ones_like(t), t, *(own / np.abs(own).max() for own in changing)])[record.valid]


def _left(gram: Floats, columns: Sequence[int], values: Sequence[int]) -> float:
    """The square that ``columns`` leave of the ``values``, by the products of all."""
    own, of = list(columns), list(values)
    across = gram[np.ix_(own, of)]
    return float(np.trace(gram[np.ix_(of, of)]) - np.sum(across * (inverse_scaled(gram[np.ix_(own, own)]) @ across)))


def _gains(records: Sequence[Record], residuals: Sequence[Floats], f0: float) -> tuple[Floats, Floats]:
    """Of each harmonic, what its lines stand out by, as a chi-square by the bins around, and in how many runs it is
    looked for: those whose force has no line there."""
    gains, runs = np.zeros(HARMONICS), np.zeros(HARMONICS)
    for record, residual in zip(records, residuals, strict=True):
        usable = np.where(record.valid[:, None], residual - residual[record.valid].mean(axis=0), 0.0)
        power = np.abs(np.fft.rfft(usable * np.hanning(len(usable))[:, None], axis=0)) ** 2
        spacing = record.sample_rate / len(usable)
        driven = _below(record) if _on_lines(record, f0) > DRIVE else _driven(record, f0)
        _, lines = _force(record, f0)
        for n in _below(record):
            k = round(n * f0 / spacing)
            around = [i for i in range(max(k - AROUND, 1), k + AROUND + 1) if abs(i - k) > 2 and i < len(power)]
            if len(around) >= AROUND // 2:
                beside = [i for i in _beside(k, f0 / spacing) if 0 < i < len(power)]
                alone = power[k] > ALONE * power[beside].max(axis=0)
                # The median of an exponential distribution is ln 2 of its mean, which is two degrees.
                level = np.maximum(np.median(power[around], axis=0) / np.log(2), 1e-300)
                here, beside_force = lines[n]
                if n in driven and not (power[k] / level * beside_force).max() > FAR * here:
                    continue
                runs[n - 1] += 1
                gains[n - 1] += float(np.sum(alone * 2 * power[k] / level))
    return gains, np.maximum(runs, 1)


def _beside(k: int, distance: float) -> list[int]:
    """Bins beside a line that no other one is in, lines being so many bins apart; in a short record those between."""
    far = [i for i in (*range(k - 5, k - 2), *range(k + 3, k + 6)) if abs(i - distance * round(i / distance)) > 1.5]
    return far or [k - 2, k + 2]


def _lines(record: Record, residual: Floats, f0: float, harmonics: Sequence[float]) -> Data:
    waves = _waves(record, f0, harmonics)[record.valid]
    # A mean belongs to an offset, not to a line.
    waves = np.column_stack((waves, np.ones(len(waves))))
    parts = np.linalg.lstsq(waves, residual[record.valid], rcond=None)[0]
    count, data = len(harmonics), []
    for i, n in enumerate(harmonics):
        own = [float(parts[i + side * count, axis]) for axis in range(record.axes) for side in (0, 1)]
        data += [n * f0, *own]
    return tuple(data)


def _rest(record: Record, residual: Floats, f0: float, harmonics: Sequence[int]) -> float:
    waves = np.column_stack((_waves(record, f0, harmonics)[record.valid], np.ones(int(record.valid.sum()))))
    parts = np.hstack((waves, residual[record.valid]))
    return _left(parts.T @ parts, range(waves.shape[1]), range(waves.shape[1], parts.shape[1]))


DEFECT = Blemish(
    id="mains",
    parameters=(AMPLITUDE,),
    signature="lines at 50 or 60 Hz and harmonics, which the drive does not have",
    source="S. M. Kay, Fundamentals of Statistical Signal Processing: Estimation Theory, 1993, example 4.2",
    find=find,
    without=without,
    again=again,
)
