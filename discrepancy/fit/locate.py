"""Where simulation and measurement disagree: channel, time, frequency band and operating condition.

Every run is cut into blocks, many periods long, every block into bands (DC, drive tones, modes, harmonics, what lies
between, high). The power of each cell is compared with what noise alone would give there; then the power of each band
is ranked against the operating conditions of its blocks, with as many degrees of freedom as are left where successive
blocks are correlated. Both count as found at a false discovery rate (Y. Benjamini, Y. Hochberg, J. Royal Statistical
Society B 57, 1995).

Noise is white in the sensor and, by the fluctuation-dissipation theorem, a white force on the mass: the residual goes
through the Kalman filter that makes both together white, so that thermal motion at a mode is no disagreement.
"""

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from discrepancy.data.conditions import Split, association, operating_conditions, split
from discrepancy.data.linear_fit import mode_frequencies
from discrepancy.data.record import Floats, Record
from discrepancy.fit.fitted import Fitted
from discrepancy.fit.noise import HANN, NO_MEMORY, noise_of, without_memory
from discrepancy.fit.whitening import Setting, Whitener, lifted, whitener
from gyro_model.symbols import BOLTZMANN

FALSE_DISCOVERIES: Final = 0.01
"""Share of the places named that may be chance."""
MATERIAL: Final = 1e-3
"""Share of the residual's power above the noise from which a place is worth a line."""
MOST: Final = 20
"""Places listed at most, largest share first."""
BLOCKS: Final = 24
"""Blocks of a run at most."""
PERIODS: Final = 16
"""Shortest block, in periods of the lowest mode: its mode band is then some five bins wide."""
LIKE: Final = 10.0
"""Neighbouring bands are one place where their densities differ by less than this factor."""
HELD: Final = 0.75
"""A place has a condition where blocks that meet it hold this share of the place's excess power."""
FASTEST: Final = 0.1
"""Tracking bandwidth of the filter times the sample period at most."""
AMBIENT: Final = 298.15

Bools = NDArray[np.bool_]


@dataclass(frozen=True)
class Place:
    """A place of disagreement: run, channel, t [s] and f [Hz] as (begin, end), the operating condition in words or
    "", share of all residual power."""

    run: str
    channel: str
    t: tuple[float, float]
    f: tuple[float, float]
    condition: str
    share: float


class _Cells(NamedTuple):
    """Of one run, shape (blocks, bands, axes): power of the residual [V²], its ratio to what noise gives, chance of so
    high a ratio; spans (blocks, 2) [s]; conditions by name, each (blocks,)."""

    power: Floats
    ratio: Floats
    chance: Floats
    spans: Floats
    conditions: Mapping[str, Floats]


def located(
    residuals: Sequence[Floats],
    records: Sequence[Record],
    parameters: Mapping[str, float],
    noise: Setting = NO_MEMORY,
) -> tuple[Place, ...]:
    """Where ``residuals`` (one (n, axes) a run) [V] of the model with ``parameters`` exceed the noise, largest share
    first; false discoveries at most 1 %. noise: its flicker and colour; a motion that it tracks is no noise here."""
    level = noise_level(residuals, records, parameters, noise)
    if level == 0:
        return ()
    edges = bands(records, parameters)
    cells = [_cells(r, record, parameters, level, noise, edges) for r, record in zip(residuals, records, strict=True)]
    found = _discoveries(np.concatenate([c.chance.ravel() for c in cells]))
    marks = [part.reshape(c.chance.shape) for c, part in
             zip(cells, np.split(found, np.cumsum([c.chance.size for c in cells])[:-1]), strict=True)]  # fmt: skip
    splits = _splits(cells)
    for (band, axis), chosen in splits.items():
        for own, mark in zip(cells, marks, strict=True):
            mark[:, band, axis] |= chosen.holds(own.conditions) & (own.ratio[:, band, axis] > 1)
    total = sum(float(c.power.sum()) for c in cells)
    places = []
    for own, mark, record in zip(cells, marks, records, strict=True):
        places += _places(own, mark, record, edges, splits, total)
    return tuple(sorted(places, key=lambda place: -place.share)[:MOST])


def bands(records: Sequence[Record], parameters: Mapping[str, float]) -> tuple[tuple[float, float], ...]:
    """The bands [Hz] that cover 0 to half the sample rate: DC, drive tones, modes, their second and third harmonics,
    and what lies between."""
    top = 0.5 * min(record.sample_rate for record in records)
    modes = mode_frequencies(parameters, records[0].axes)
    width = max(1 / _block_time(record, modes[0]) for record in records)
    wanted = [(0.0, max(0.1 * modes[0], 2 * width))]
    between = [0.0, *np.sqrt(modes[1:] * modes[:-1]).tolist(), np.inf]
    near = [(max(0.85 * f, a), min(1.15 * f, b)) for f, (a, b) in zip(modes, itertools.pairwise(between), strict=True)]
    wanted += near
    for order in (2, 3):
        wanted += [(order * 0.85 * f, order * 1.15 * f) for f in modes]
    tones = [f for f in drive_tones(records) if not any(low <= f <= high for low, high in wanted)]
    wanted += [(f - 2 * width, f + 2 * width) for f in tones]
    joined: list[tuple[float, float]] = []
    for low, high in sorted((max(low, 0.0), min(high, top)) for low, high in wanted if low < top):
        if joined and low < joined[-1][1]:
            joined[-1] = joined[-1][0], max(high, joined[-1][1])
        else:
            joined.append((low, high))
    edges = sorted({0.0, top, *itertools.chain(*joined)})
    kept = [edges[0]]
    for edge in edges[1:-1]:
        # A band narrower than two bins of a block has no power of its own.
        if edge - kept[-1] >= 2 * width and top - edge >= 2 * width:
            kept.append(edge)
    return tuple(itertools.pairwise([*kept, top]))


def drive_tones(records: Sequence[Record], most: int = 4) -> list[float]:
    """Frequencies [Hz] of the drive where so few lines hold half of its power; else none."""
    found: set[float] = set()
    for record in records:
        power = np.abs(np.fft.rfft(record.u * np.hanning(len(record.u))[:, None], axis=0)) ** 2
        power = power.sum(axis=1)
        power[:3] = 0.0
        total = float(power.sum())
        lines = []
        for _ in range(most):
            peak = int(np.argmax(power))
            own = slice(max(peak - 3, 0), peak + 4)
            share = float(power[own].sum())
            if total == 0 or share < 0.05 * total:
                break
            lines.append((peak * record.sample_rate / len(record.u), share))
            power[own] = 0.0
        if sum(share for _, share in lines) > 0.5 * total:
            found |= {round(f, 3) for f, _ in lines}
    return sorted(found)


def noise_level(
    residuals: Sequence[Floats],
    records: Sequence[Record],
    parameters: Mapping[str, float],
    memory: Setting = NO_MEMORY,
) -> float:
    """Deviation of the white noise a sample [V]: far above the modes, or the lower quartile of sixteen bands where the
    sample rate leaves no room there. memory: flicker and colour that are no part of it."""
    noise = noise_of(residuals, records, parameters, memory)
    if noise is not None:
        return noise.rms
    means: list[float] = []
    for given, record in zip(residuals, records, strict=True):
        residual = without_memory(given, record, parameters, memory)
        window = np.hanning(len(residual))[:, None]
        power = np.abs(np.fft.rfft(residual * window, axis=0)) ** 2 / np.sum(window**2)
        means += [float(np.mean(part)) for part in np.array_split(power, 16)]
    return float(np.sqrt(np.quantile(means, 0.25)))


def no_noise(at: Fitted, records: Sequence[Record]) -> float:
    """What of the cost of a fit is surely no noise [V²]; a motion that its filter tracks is none."""
    given = at.residuals, records, at.parameters, at.whiten.setting
    noise = noise_of(*given)
    level = noise.high if noise else noise_level(*given)
    return max(at.cost - level**2 * at.count, 0.0)


def _block_time(record: Record, lowest: float) -> float:
    """The shortest block of a run [s]."""
    return max(len(record.t) / record.sample_rate / BLOCKS, PERIODS / lowest)


def _whitener(record: Record, p: Mapping[str, float], level: float, noise: Setting) -> Whitener:
    """The filter that makes thermal motion and white noise of ``level`` [V] together white: the force of density 4 k T
    d moves the tracked amplitude as ``whitening.whitener`` says of a bandwidth b."""
    w = 2 * np.pi * mode_frequencies(p, record.axes)[-1]
    temperature = float(np.mean(record.conditions.get("temperature", AMBIENT)))
    d, gain = max(p["dxx"], p.get("dyy", 0.0)), abs(p["sense_gain_x"])
    period = 1 / record.sample_rate
    square = float(BOLTZMANN) * temperature * d * gain**2 / (2 * p["m"] ** 2 * w**2 * period * level**2)
    thermal = min(float(np.sqrt(square / lifted(noise, w * period))), FASTEST / period)
    return whitener(p, record.axes, period, replace(noise, bandwidth=thermal), len(record.t))


def _cells(
    residual: Floats,
    record: Record,
    p: Mapping[str, float],
    level: float,
    noise: Setting,
    edges: Sequence[tuple[float, float]],
) -> _Cells:
    filtered = _whitener(record, p, level, noise)(residual[None], record.valid)[0]
    usable = np.where(record.valid[:, None], residual, 0.0)
    shortest = _block_time(record, mode_frequencies(p, record.axes)[0]) * record.sample_rate
    # A hair more than whole, which rounding may leave.
    count = max(int(len(residual) / shortest + 1e-6), 1)
    power = np.zeros((count, len(edges), record.axes))
    ratio, chance = np.zeros_like(power), np.ones_like(power)
    parts = np.array_split(np.arange(len(residual)), count)
    for b, part in enumerate(parts):
        window = np.hanning(len(part))[:, None]
        f = np.fft.rfftfreq(len(part), 1 / record.sample_rate)
        seen = float(np.sum(window[record.valid[part]] ** 2))
        # Leakage must not put the power of a resonance into other bands' chance; but power itself adds up as it is.
        plain = 2 * np.abs(np.fft.rfft(usable[part], axis=0)) ** 2 / len(part)
        windowed = np.abs(np.fft.rfft(filtered[part] * window, axis=0)) ** 2
        for k, (low, high) in enumerate(edges):
            inside = (f >= low) & (f < high)
            bins = int(inside.sum())
            if not bins or seen < 0.1 * np.sum(window**2):
                continue
            power[b, k] = plain[inside].sum(axis=0)
            ratio[b, k] = windowed[inside].sum(axis=0) / (level**2 * seen * bins)
            freedom = 2 * bins / HANN
            chance[b, k] = chi2.sf(ratio[b, k] * freedom, freedom)
    spans = np.array([[record.t[part[0]], record.t[part[-1]]] for part in parts])
    return _Cells(power, ratio, chance, spans, operating_conditions(record, p, parts))


def _discoveries(chances: Floats) -> Bools:
    """Which of the tests with these chances count as found."""
    order = np.argsort(chances)
    passed = np.flatnonzero(chances[order] <= FALSE_DISCOVERIES * np.arange(1, len(chances) + 1) / len(chances))
    found = np.zeros(len(chances), dtype=bool)
    found[order[: passed.max(initial=-1) + 1]] = True
    return found


def _splits(cells: Sequence[_Cells]) -> dict[tuple[int, int], Split]:
    """By (band, axis), over the blocks of all runs, the condition with which the power goes most, where one does."""
    conditions = {name: np.concatenate([c.conditions[name] for c in cells]) for name in cells[0].conditions
                  if all(name in c.conditions for c in cells)}  # fmt: skip
    ratios = np.concatenate([c.ratio for c in cells])
    begins = np.cumsum([0, *(len(c.ratio) for c in cells)])[:-1]
    tests = []
    for band, axis in np.ndindex(*ratios.shape[1:]):
        for name, values in conditions.items():
            rank, chance = association(values, ratios[:, band, axis], begins)
            tests.append(((band, axis), name, rank, chance))
    found = _discoveries(np.array([test[3] for test in tests]))
    best: dict[tuple[int, int], Split] = {}
    for place, name, rank, _ in sorted(itertools.compress(tests, found), key=lambda test: -abs(test[2])):
        if place not in best:
            best[place] = split(name, conditions[name], ratios[:, place[0], place[1]], rising=rank > 0)
    return best


def _places(
    cells: _Cells,
    mark: Bools,
    record: Record,
    edges: Sequence[tuple[float, float]],
    splits: Mapping[tuple[int, int], Split],
    total: float,
) -> list[Place]:
    """The marked cells of one run, neighbours in time and like neighbours in frequency joined."""
    excess = cells.power * np.maximum(1 - 1 / np.maximum(cells.ratio, 1e-9), 0)
    places = []
    for axis in range(record.axes):
        for first, last in _joined_bands(excess[..., axis], mark[..., axis], edges):
            own = slice(first, last + 1)
            held = mark[:, own, axis].any(axis=1)
            texts = {str(splits[k, axis]): splits[k, axis] for k in range(first, last + 1) if (k, axis) in splits}
            for begin, end in _runs(np.asarray(held)):
                here = excess[begin:end, own, axis].sum(axis=1)
                if here.sum() < MATERIAL * total:
                    continue
                meets = {text: float(here[s.holds(cells.conditions)[begin:end]].sum()) for text, s in texts.items()}
                condition = max(meets, key=lambda text: meets[text], default="")
                if condition and meets[condition] < HELD * here.sum():
                    condition = ""
                span = float(cells.spans[begin, 0]), float(cells.spans[end - 1, 1])
                share = float(cells.power[begin:end, own, axis].sum()) / total
                channel = "v_" + "xy"[axis]
                f = (float(edges[first][0]), float(edges[last][1]))
                places.append(Place(record.name, channel, span, f, condition, share))
    return places


def _joined_bands(excess: Floats, mark: Bools, edges: Sequence[tuple[float, float]]) -> list[tuple[int, int]]:
    """Marked bands as (first, last); neighbours of like density, marked over like times, are one."""
    joined: list[tuple[int, int]] = []
    for k in np.flatnonzero(mark.any(axis=0)).tolist():
        if joined and joined[-1][1] == k - 1:
            density = [excess[:, j].sum() / (edges[j][1] - edges[j][0]) for j in (k - 1, k)]
            both, either = (mark[:, k] & mark[:, k - 1]).sum(), (mark[:, k] | mark[:, k - 1]).sum()
            if max(density) < LIKE * min(density) and both > 0.8 * either:
                joined[-1] = joined[-1][0], k
                continue
        joined.append((k, k))
    return joined


def _runs(held: Bools) -> list[tuple[int, int]]:
    """Stretches of marked blocks as [begin, end), gaps of up to two blocks bridged."""
    stretches: list[tuple[int, int]] = []
    for b in np.flatnonzero(held):
        if stretches and b - stretches[-1][1] <= 2:
            stretches[-1] = stretches[-1][0], int(b) + 1
        else:
            stretches.append((int(b), int(b) + 1))
    return stretches
