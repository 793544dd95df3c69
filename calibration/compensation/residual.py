"""What the residual of a compensation is made of, in words: by how much each kind of cause would explain it.

Each kind is a few columns, fitted on parts of the residual and predicted on the others; the best is taken off, and so
on. Nothing of this goes into a compensation: it says what to measure or to try next.
"""

from collections.abc import Iterator
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from calibration.compensation.derived import derived, lag_name, play_name
from calibration.compensation.methods.history import LAGS, WIDTHS
from calibration.compensation.model import Compensation
from calibration.compensation.record import RATE_OF, SIGNALS, Blocks, Floats

PARTS: Final = 6
"""Of a single cycle, contiguous parts, each predicted from the others; else cycles are."""
Parts = NDArray[np.int64]
RIDGE: Final = 1e-3
DEGREE: Final = 4
WORTH: Final = 0.05
"""A kind is named that explains this share of the mean square, where it is not seen."""
SURROGATES: Final = 20
"""Times that its columns are moved to; where one of them explains as much, the kind is not named (5 %)."""
MOST: Final = 8


class Cause(NamedTuple):
    """A kind of cause, and its share of the mean square of the residual [1]."""

    name: str
    share: float


def name_residual(blocks: Blocks, compensation: Compensation, left: Floats) -> list[Cause]:
    """Causes of what is ``left`` at the blocks at rest [unit], shape (number at rest,), as they are found; the last is
    white noise. ``blocks``: all cycles, those of the fit included: repeats tell a cause from a chance."""
    rest = blocks.at_rest
    total = float(np.mean(left**2))
    if not total > 0 or rest.sum() < 4 * PARTS:
        return []
    noise = float(np.mean(blocks.noise[rest] ** 2))
    causes, cycle = [], blocks.cycle[rest]
    part = cycle if len(np.unique(cycle)) > 1 else np.arange(len(left)) * PARTS // len(left)
    numbers, place = np.unique(cycle, return_inverse=True)
    steps = (np.bincount(place, left) / np.bincount(place))[place]
    remains = left - steps
    if float(np.mean(steps**2)) > WORTH * total:
        what = "whole cycles are off by a constant" if len(numbers) > 1 else "the cycle is off by a constant"
        causes.append(Cause(f"step at turn-on: {what}", float(np.mean(steps**2)) / total))
    kinds = {name: columns[rest] for name, columns in _kinds(blocks, compensation)}
    for _ in range(MOST):
        found = {name: _predicted(columns, remains, part) for name, columns in kinds.items()}
        gains = {name: float(np.mean(remains**2) - np.mean((remains - p) ** 2)) / total for name, p in found.items()}
        best = max(gains, key=lambda name: gains[name], default="")
        if not best or gains[best] < WORTH:
            break
        if gains[best] * total <= _by_chance(kinds[best], remains, part):
            del kinds[best]
            continue
        causes.append(Cause(best, gains[best]))
        remains = remains - found[best]
        del kinds[best]
    unexplained = (float(np.mean(remains**2)) - noise) / total
    if unexplained > WORTH:
        causes.append(Cause(_unnamed(blocks.t[rest], remains), unexplained))
    causes.append(Cause("white noise of the record", min(noise / total, 1.0)))
    return causes


def _kinds(blocks: Blocks, compensation: Compensation) -> Iterator[tuple[str, Floats]]:
    """Names and columns, shape (n, columns) each."""
    used = {i.name for i in compensation.inputs}
    signals = [name for name in SIGNALS if name in blocks.inputs]
    lead = next((name for name in signals if name in used), signals[0])
    shape = _smooth(blocks.inputs[lead], 2 * DEGREE)
    yield f"shape: {lead}, which is used, is not followed closely enough", shape
    lags = [lag_name(lead, time) for time in LAGS]
    plays = [play_name(lead, share * float(np.ptp(blocks.inputs[lead]))) for share in WIDTHS]
    inputs = blocks.with_inputs((*lags, *plays)).inputs
    for name in signals:
        if name not in used:
            yield f"input not used: {name}", _beside(shape, _smooth(inputs[name], DEGREE))
    if not any(derived(name).kind in ("rate", "lag") for name in used):
        rates = np.stack([inputs[name + RATE_OF] for name in signals], axis=1)
        yield "lag: the sensor is not as warm as what makes the bias", _beside(shape, rates)
    if not set(lags) & used:
        yield "slow lag: a temperature that no sensor sees", _beside(shape, np.stack([inputs[n] for n in lags], axis=1))
    if not any(derived(name).kind == "play" for name in used):
        loops = _beside(shape, np.stack([inputs[n] for n in plays], axis=1))
        yield "hysteresis: up and down of the temperature differ", loops


def _beside(shape: Floats, columns: Floats) -> Floats:
    """What the columns say beside the leading temperature, whose share of them the compensation has taken."""
    known = np.concatenate([np.ones((len(shape), 1)), shape], axis=1)
    return columns - known @ np.linalg.lstsq(known, columns, rcond=None)[0]


def _smooth(values: Floats, degree: int) -> Floats:
    span = max(float(np.ptp(values)), 1e-12)
    return np.polynomial.chebyshev.chebvander(2 * (values - values.min()) / span - 1, degree)[:, 1:]


def _predicted(columns: Floats, values: Floats, part: Parts) -> Floats:
    """Each ``part`` of ``values``, shape (n,) both, by ridge regression on the others, shape (n,)."""
    size = np.maximum(columns.std(axis=0), 1e-12)
    scaled = (columns - columns.mean(axis=0)) / size
    predicted = np.empty_like(values)
    for number in np.unique(part):
        seen, out = scaled[part != number], part == number
        gram = seen.T @ seen + RIDGE * len(seen) * np.eye(seen.shape[1])
        predicted[out] = scaled[out] @ np.linalg.solve(gram, seen.T @ values[part != number])
    return predicted


def _by_chance(columns: Floats, values: Floats, part: Parts) -> float:
    """The most that the same columns explain where they are moved in time: what wanders correlates with any course."""
    moved = (np.roll(columns, shift * len(values) // SURROGATES, axis=0) for shift in range(1, SURROGATES))
    power = float(np.mean(values**2))
    return max(power - float(np.mean((values - _predicted(other, values, part)) ** 2)) for other in moved)


def _unnamed(t: Floats, values: Floats) -> str:
    """Walk where differences over longer times are larger, else scatter."""
    lags = np.unique(np.geomspace(1, max(len(values) // 4, 2), 8).astype(int))
    growth = [float(np.mean((values[lag:] - values[:-lag]) ** 2)) for lag in lags]
    slope = float(np.polyfit(np.log(lags), np.log(np.maximum(growth, 1e-300)), 1)[0])
    # Of a random walk the mean square of a difference grows with its time, slope 1; flicker lies between.
    if slope > 0.3:
        return "walk: it wanders in time, whatever the temperature"
    return f"none of these: no input tells it, and it does not outlast {np.median(np.diff(t)):.3g} s"
