"""A sensor that wanders while a run lasts, another way in each: slow curves, far below all that drives the device.

A mass that a spring holds answers to no force there but by what bends, which goes with the strength of the motion in
every run alike. What is slow beyond that is the sensor's: it is taken out of the voltage, and a fit does not ask for it
(``Record.steady``). Curves by polynomials: G. E. P. Box, G. M. Jenkins, G. C. Reinsel, Time Series Analysis, 2008,
section 4.1.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np

from discrepancy.data.record import Drift, Floats, Record, curves

FEWEST, MOST, BELOW = 5, 11, 1.5
"""Order of the polynomials at least and at most, and turns of the lowest frequency that drives a run over it. Of two
turns of a sine eleven curves leave 2 %; of forty they take 0.7 % over most of a run and 28 % at its ends, where what is
simulated loses as much."""
DRIVEN: Final = 1e-4
"""Share of a force's power below which it drives nothing."""
PLAIN: Final = 30.0
"""Times the density beside it, at frequencies that nothing drives either, that what is slow has in every run. Of 220
records without a drift, linear and not, at rest for a part of the time and never, none reached 22 in all runs."""
SLOW: Final = 0.7
"""Share of all that is below half of what drives which these curves are, in every run. Of the same with a drift of 2 to
50 % of the motion both held for four in five; masses that friction holds for a part of the time are hard to tell."""
BANDS: Final = 8
"""Into which all that drives the device is cut."""
BENT, BENDS = 2, 0.1
"""Which column is what bends in the motion, and of the motion's rms what it may make of it."""
UNLIKE: Final = 0.05
"""Share of what is slow that neither one line of all runs nor what the motion makes of itself explains: the drift of an
amplifier is the same in all."""


def steadied(records: Sequence[Record]) -> tuple[tuple[Record, ...], tuple[str, ...]]:
    """The runs without what their sensors wander by, and what to say; as they are where those to fit do not show it."""
    fit = [record for record in records if record.role == "fit"]
    alike = len({record.axes for record in records}) == 1
    lowest = min(map(_lowest, records)) if fit and alike else 0
    if lowest < BELOW * FEWEST or not all(map(_held, fit)):
        return tuple(records), ()
    wanders = [axis for axis in range(fit[0].axes) if _wanders(fit, axis)]
    if not wanders:
        return tuple(records), ()
    order = min(int(lowest / BELOW), MOST)
    own = tuple(_without(record, order) for record in records)
    sizes = [float(np.std(record.drift.taken[:, axis])) for record in own if record.drift for axis in wanders]
    names = " and ".join(f"v_{'xy'[axis]}" for axis in wanders)
    text = f"{names}: a slow drift of {max(sizes):.3g} V rms, another in each run, is taken out of the record"
    return own, (text,)


def _lowest(record: Record) -> int:
    """The lowest frequency that drives the run, in turns of it; 0 where nothing does."""
    power = _power(record.u).sum(axis=1)
    total = np.cumsum(power)
    return int(np.argmax(total > DRIVEN * total[-1]))


def _held(record: Record) -> bool:
    """Whether a place answers most to other than the slowest that drives it: a mass that no spring holds goes on with
    the speed that it began with."""
    quick = record.v - curves(len(record.v), FEWEST) @ _numbers(record, record.v)
    force, answer = (_power(s).sum(axis=1)[1:] for s in (record.u, quick))
    f = np.arange(1, len(force) + 1)
    driven = force > DRIVEN * force.max()
    if not driven.any():
        return False
    bands = np.digitize(np.log(f), np.linspace(np.log(f[driven][0]), np.log(f[driven][-1] + 1), BANDS + 1))[driven]
    moved, pushed = (np.bincount(bands, s[driven], BANDS + 1)[1:] for s in (answer / f ** (2.0 * record.order), force))
    return bool(np.argmax(moved / np.maximum(pushed, DRIVEN * pushed.max())) > 0)


def _wanders(records: Sequence[Record], axis: int) -> bool:
    """Whether the voltage of an axis has such curves of its own in the runs."""
    scale = max(float(np.std(record.v[:, axis])) for record in records)
    parts = [_slow(record, axis) for record in records]
    if not scale or min(own.share for own in parts) < SLOW or min(own.density for own in parts) < PLAIN:
        return False
    common = sorted(set.intersection(*(set(record.conditions) for record in records)))
    peaks = {name: max(float(np.abs(record.conditions[name]).max()) for record in records) or 1.0 for name in common}
    found, explained = [], []
    for record, own in zip(records, parts, strict=True):
        # An offset and a line of all runs, and what bends in the motion, which has a mean besides.
        alike = [np.ones(len(own.rest)), np.linspace(-1, 1, len(own.rest)), (own.rest / scale) ** 2]
        alike += [record.conditions[name] / peaks[name] for name in common]
        found.append(own.numbers)
        explained.append(_numbers(record, np.column_stack(alike)))
    what, by = np.concatenate(found), np.vstack(explained)
    bend = float(np.clip(np.linalg.lstsq(by, what, rcond=None)[0][BENT], -BENDS * scale, BENDS * scale))
    rest, others = what - bend * by[:, BENT], np.delete(by, BENT, axis=1)
    left = (rest - others @ np.linalg.lstsq(others, rest, rcond=None)[0]).reshape(len(records), -1)[:, 1:]
    return bool(np.sum(left**2) > UNLIKE * np.sum(np.array(found)[:, 1:] ** 2))


class _Slow(NamedTuple):
    """Of a voltage: the numbers of the curves that it is slow by, and the rest of it (n,); what they are of all below
    half of what drives, and their density over that of the rest there."""

    numbers: Floats
    rest: Floats
    share: float
    density: float


def _slow(record: Record, axis: int) -> _Slow:
    v, top = record.v[:, axis], max(_lowest(record) // 2, 2)
    numbers = _numbers(record, v[:, None])[:, 0]
    slow: Floats = curves(len(v), FEWEST) @ numbers
    own, beside = (float(_power(part)[:top].sum()) for part in (slow, v - slow))
    beside = max(beside, 1e-300)
    return _Slow(numbers, v - slow, own / (own + beside), own / FEWEST * top / beside)


def _numbers(record: Record, values: Floats) -> Floats:
    """Of the curves, by which ``values`` (n, columns) are slow; under a window in which what oscillates leaves none."""
    weights = (np.hanning(len(values)) * record.valid)[:, None]
    return np.asarray(
        np.linalg.lstsq(curves(len(values), FEWEST) * weights, values * weights, rcond=None)[0], np.float64
    )


def _power(values: Floats) -> Floats:
    """Of ``values`` (n, ...) about their mean, by frequency in turns of the run."""
    window = np.hanning(len(values))
    mean = window @ values / window.sum()
    return np.asarray(np.abs(np.fft.rfft(((values - mean).T * window).T, axis=0)) ** 2)


def _without(record: Record, order: int) -> Record:
    """The run without the curves, as what is simulated beside loses them."""
    steady = replace(record, drift=Drift(record.v, order)).steady(record.v)
    return replace(record, v=steady, drift=Drift(record.v - steady, order))
