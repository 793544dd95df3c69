"""How many modes a record shows in its band, and where: a linear model of as many states as the record asks for.

Poles come from the observability of the response, which a subspace method finds without a start value (M. Verhaegen,
Automatica 30, 1994: the past of force and voltage as instruments). The response is then linear in the residues, and a
mode counts for what of the voltage is not explained without it.
"""

from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np
from scipy.signal import decimate
from threadpoolctl import threadpool_limits

from discrepancy.data.modal import Complexes, Modal, Runs, or_one, refined
from discrepancy.data.record import Floats, Record, is_driven

MOST: Final = 6
"""Further modes that are looked for."""
INSTANTS: Final = 8_000
"""From which the observability is taken: the noise of a pole falls with their root."""
SAMPLES: Final = 20_000
"""At most, of each run."""
ROWS: Final = 40
"""Samples of the future: two periods of a mode at a fourth of the top of the band."""
POWER: Final = 1e-3
"""Share of the voltage's power above the top of the band."""
ABOVE: Final = 1.3
"""Top of what is looked at, over that; beyond it filters take all away."""
RATE: Final = 2.6
"""Sample rate over the top of what is looked at."""
TAPS: Final = 20
"""Of the filter before samples are left out, to each side, over how many are."""
BROAD: Final = 5.0
"""Quality factor below which a pole is no mode: no peak stands out of a response so broad."""
APART: Final = 0.02
"""Relative distance from another mode below which a pole stands for that one's change: stiffness that is not linear
moves a peak, and two poles imitate that."""
LEAST: Final = 2e-6
"""Share of the voltage's power, 0.14 % of its rms, that a model with one mode an axis leaves at least where a further
one matters; filters and decimation leave a tenth of that."""
ENOUGH: Final = 0.3
"""Share of what a model with one mode an axis leaves, below which further modes bring it."""
HARMONICS: Final = (2, 3, 5)
"""Of a mode, at which its own decay has peaks where its spring is not linear."""
PARTS: Final = 8
"""Of a decay, in each of which its frequency is taken."""
BENT: Final = 0.3
"""Relative change of a frequency over a decay, at most."""
TWICE: Final = 2.0
"""Times what all leave, that is left without one that counts."""
AT_ITS_PEAK: Final = 20.0
"""The same around its peak, in driven runs: 33 to 450 with six modes of an aircraft whose joints rub, of which the
weakest takes 6 % of the motion where 11 % are left; 5.2 with what stands for a spring that bends."""
BETTER: Final = 1.2
"""Times what a model of more states leaves, that is left without these: 1.2 to 2.5 with each pair of states while modes
of a chain of four masses were still missing, 1.01 at most with those after the last of a decay."""

PATIENCE: Final = 2
"""Models of more states that bring nothing in a row, after which none is tried."""


class Mode(NamedTuple):
    """frequency [Hz] and quality factor; seen: whether a peak shows it, or these are a guess."""

    frequency: float
    quality: float
    seen: bool = True


def further_modes(records: Sequence[Record]) -> tuple[list[Mode], list[Mode]]:
    """The modes of a linear model with one an axis, and those that the runs show beside them, by frequency; the second
    empty where a linear model gains nothing by more."""
    runs = _in_band(records)
    axes = records[0].axes
    if not runs.pairs:
        return [], []
    # Threads cost thin matrices more than they bring, many times where cores are shared.
    with threadpool_limits(1, "blas"):
        return _counted(runs, axes)


def answering(records: Sequence[Record]) -> list[Mode]:
    """The modes as which the voltage of ``records`` answers to the force, by frequency; none where no such answer
    explains most of it."""
    runs = _in_band(records)
    if not runs.pairs or not any(u.any() for u, _ in runs.pairs):
        return []
    with threadpool_limits(1, "blas"):
        found = _fitted(runs, [2 * (1 + extra) for extra in range(MOST + 1)])
        return _modes(_needed(runs, found, found.both), runs.step) if found.left < ENOUGH else []


def _counted(runs: Runs, axes: int) -> tuple[list[Mode], list[Mode]]:
    own, *_ = orders = [2 * (axes + extra) for extra in range(MOST + 1)]
    least = _fitted(runs, [own])
    first = _modes(least.both, runs.step)
    if least.left < LEAST:
        return first, []
    found = _fitted(runs, orders)
    if found.left > ENOUGH * least.left:
        return first, []
    decays = not any(u.any() for u, _ in runs.pairs)
    if decays:
        # One pole for all of them is broader than any.
        first = _own(runs, found, first, axes)
        if not first:
            # What rings at no frequency of its own is no mode that others could stand beside.
            return [], []
    else:
        first = [near for mode in first if (near := _same(mode, _modes(found.both, runs.step)))]
    known = [mode.frequency for mode in first]
    known += _of_one(runs, known) if decays else []
    beside = [p for p in found.both if (m := _mode(p, runs.step)) and all(apart(m.frequency, own) for own in known)]
    further = _modes(_needed(runs, found, beside), runs.step)
    # What is as broad as it is apart stands for how the decay of a mode is not that of a linear one.
    narrow = [mode.frequency for mode in first] if decays else []
    return first, [m for m in further if all(abs(m.frequency - f) > 0.5 * m.frequency / m.quality for f in narrow)]


def _fitted(runs: Runs, orders: Sequence[int]) -> Modal:
    """The model of as many states as it takes: of more where they bring what is left down, and no two of its poles
    stand for one mode that the least model has."""
    first, *more = _poles(runs, orders)
    best, in_vain = refined(runs, first), 0
    alike = _alike(best, runs.step)
    for poles in more:
        model = refined(runs, poles)
        better = BETTER * model.left < best.left and _alike(model, runs.step) <= alike
        best, in_vain = (model, 0) if better else (best, in_vain + 1)
        if in_vain == PATIENCE:
            break
    return best


def _same(rough: Mode, among: Sequence[Mode]) -> Mode | None:
    """The one ``among`` the modes of a better model that is no other than a ``rough`` one; None where each is."""
    near = min(among, key=lambda mode: abs(np.log(mode.frequency / rough.frequency)), default=rough)
    return None if apart(near.frequency, rough.frequency) else near


def _alike(model: Modal, step: float) -> int:
    """How many modes of a model stand beside another."""
    frequencies = [mode.frequency for mode in _modes(model.both, step)]
    return sum(not apart(a, b) for a, b in pairwise(frequencies))


def _own(runs: Runs, model: Modal, rough: Sequence[Mode], axes: int) -> list[Mode]:
    """The modes of a model, one an axis, that are nearest to ``rough`` ones, and those without which most is left where
    these are fewer."""
    poles = model.both
    ringing = [(_mode(p, runs.step), Modal(runs, poles[poles != p]).left) for p in poles]
    modes = [mode for mode, _ in sorted(ringing, key=lambda found: -found[1]) if mode]
    own: list[Mode] = []
    for near in rough:
        rest = [mode for mode in modes if mode not in own]
        own += sorted(rest, key=lambda mode: abs(np.log(mode.frequency / near.frequency)))[:1]
    return sorted([*own, *(mode for mode in modes if mode not in own)][:axes])


def _needed(runs: Runs, model: Modal, among: Iterable[complex]) -> Complexes:
    """The poles ``among`` those of a model without which much more is left, in all or, where a force shows it, around
    the peak: there an effect that leaves much elsewhere does not hide it."""
    driven = any(u.any() for u, _ in runs.pairs)

    def needed(pole: complex) -> bool:
        without = Modal(runs, model.both[model.both != pole])
        if without.left > TWICE * model.left:
            return True
        return driven and without.left_around(pole) > AT_ITS_PEAK * model.left_around(pole)

    return np.array([p for p in among if _mode(p, runs.step) and needed(p)])


def _of_one(runs: Runs, known: Sequence[float]) -> list[float]:
    """Frequencies [Hz] that modes at ``known`` ones [Hz] may have in free decays: harmonics, and all through which a
    mode goes whose spring is not linear, as parts of the decays see it."""
    found = [number * own for own in known for number in HARMONICS]
    course = [f for _, v in runs.pairs for axis in v.T for part in np.array_split(axis, PARTS)
              if (f := _at_one_frequency(part, runs.step))]  # fmt: skip
    for own in known:
        near = [own, *(f for f in course if abs(f / own - 1) < BENT)]
        # A part has gone on from where it began: once more as far beyond on either side.
        beyond = max(near) / min(near)
        steps = int(3 * np.log(beyond) / APART) + 1
        found += np.geomspace(min(near) / beyond, max(near) * beyond, steps + 1).tolist()
    return found


def _at_one_frequency(v: Floats, step: float) -> float | None:
    """The frequency [Hz] at which a voltage (n,) rings, taken for a single mode; None where it does not."""
    before = np.column_stack((v[1:-1], v[:-2]))
    a, b = np.linalg.lstsq(before, v[2:], rcond=None)[0]
    pole = complex(np.roots([1.0, -a, -b])[0])
    return abs(float(np.angle(pole))) / (2 * np.pi * step) or None


def _modes(poles: Complexes, step: float) -> list[Mode]:
    return sorted(mode for p in poles if (mode := _mode(p, step)))


def _mode(pole: complex, step: float) -> Mode | None:
    """The mode of one of a pair of poles; None of the other, where there is no peak, and beyond the band."""
    if not (np.isfinite(pole) and pole.imag > 0):
        return None
    rate = complex(np.log(pole)) / step
    if abs(rate) * step > 2 * np.pi / RATE or not 0 < -2 * BROAD * rate.real < abs(rate):
        return None
    return Mode(abs(rate) / (2 * np.pi), abs(rate) / (-2 * rate.real))


def apart(a: float, b: float) -> bool:
    """Whether two frequencies are those of two modes, not of one that changes."""
    return abs(a / b - 1) > APART


def _in_band(records: Sequence[Record]) -> Runs:
    """The runs without what is above the modes, at a rate that is enough for them."""
    rate = records[0].sample_rate
    top = ABOVE * max(band_of(record) for record in records)
    number = max(1, int(rate / (RATE * top)))
    decays = not is_driven(records)
    pairs, at_once = [], []
    for record in (r for r in records if r.sample_rate == rate):
        before = np.vstack((record.u[:1], record.u[:-1]))
        # What is held until the next sample acts half a step later; an acceleration shows it as it was just before,
        # or, where it is not held, as it is. What the motion makes runs on as it does.
        late = 0.5 * (record.u + before) if record.hold == "zero" else record.u
        courses = tuple(record.courses.values())
        acting = np.hstack((late, *courses))
        seen = np.hstack((record.u, before, *courses)) if record.order == 2 else acting
        u, v, own = (_fewer(a, number)[:SAMPLES] for a in (acting, record.v, seen))
        if len(u) > 4 * ROWS and (u.any() or decays):
            pairs.append((u, v - v.mean(axis=0)))
            at_once.append(own)
    scales = [np.sqrt(np.mean([np.mean(a**2, axis=0) for a in side], axis=0)) for side in zip(*pairs, strict=True)]
    return Runs([(u / or_one(scales[0]), v / or_one(scales[1])) for u, v in pairs], at_once, number / rate)


def band_of(record: Record, signal: Floats | None = None) -> float:
    """The frequency [Hz] below which almost all of the power of a signal (n, axes) is, by default the voltage's."""
    own = record.v if signal is None else signal
    count = len(own)
    # What dies away first is at the beginning of a free decay.
    window = np.hanning(count) if record.u.any() else np.hanning(2 * count)[count:]
    power = np.abs(np.fft.rfft((own - own.mean(axis=0)) * window[:, None], axis=0)) ** 2
    share = np.cumsum(power, axis=0) / np.maximum(power.sum(axis=0), 1e-300)
    last = int((share < 1 - POWER).sum(axis=0).max())
    return max(last, 1) * record.sample_rate / count


def _fewer(signal: Floats, number: int) -> Floats:
    """Every so many-th sample, what it can't hold filtered out, without the ends that the filter does not know."""
    if number == 1:
        return signal
    taps = TAPS * number
    if len(signal) <= 3 * taps:
        return signal[:0]
    return np.asarray(decimate(signal, number, taps, "fir", axis=0)[TAPS:-TAPS])


def _poles(runs: Runs, orders: Sequence[int]) -> list[Complexes]:
    """The poles of models of so many states."""
    instants = sum(len(u) - 2 * ROWS for u, _ in runs.pairs)
    stride, rows = max(1, instants // INSTANTS), []
    for u, v in runs.pairs:
        window = np.arange(0, len(u) - 2 * ROWS + 1, stride)[:, None] + np.arange(2 * ROWS)
        past, future = window[:, :ROWS], window[:, ROWS:]
        rows.append(np.hstack([a.reshape(len(window), -1) for a in (u[future], u[past], v[past], v[future])]))
    forces, axes = (signal.shape[1] for signal in runs.pairs[0])
    triangle = np.asarray(np.linalg.qr(np.vstack(rows), mode="r"))
    known, told = ROWS * forces, ROWS * (2 * forces + axes)
    vectors, sizes, _ = np.linalg.svd(triangle[known:told, told:].T, full_matrices=False)
    found = []
    for order in orders:
        seen = vectors[:, :order] * np.sqrt(sizes[:order])
        later = np.linalg.lstsq(seen[:-axes], seen[axes:], rcond=None)[0]
        poles = np.linalg.eigvals(later)
        # One that grows is none of a device at rest; its mirror image has the same peak.
        found.append(np.where(np.abs(poles) > 1, 1 / np.conj(poles), poles))
    return found
