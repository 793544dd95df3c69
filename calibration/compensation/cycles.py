"""Temperature cycles of a test, and what of it a fit may not see.

Temperature cycles are repeats: neighbouring stretches of one cycle share its turn-on, its walk and its hysteresis, so
that leaving out every other stretch says little of the next cycle. Whole cycles are held out. Of a single one only
contiguous parts can be, with gaps between, and another cycle then is untested.
"""

from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from calibration.compensation.record import Blocks

Floats = NDArray[np.float64]
Chosen = NDArray[np.bool_]

ZONE: Final = 0.2
"""A cycle goes from one end of the temperature range to the other and back: an end is this share of the range."""
ARRIVED: Final = 0.05
"""A temperature is back where it began within this share of the range."""
FOLDS: Final = 4
PARTS: Final = 8
"""A single cycle is cut in so many parts; two that lie half the cycle apart are left out at once, a quarter."""
INNER_PARTS: Final = 16
"""And what is left in so many for the inner validation: holes upon holes must leave points in every segment."""
MEMORY: Final = 3.0
"""A gap lasts this many times what the residual remembers: e^-3 = 5 % of it crosses."""
LARGEST_GAP: Final = 0.25
"""Of a part that is left out, on either side: more would leave too little to fit."""
NEAR: Final = 1 / 40
"""Share of an input's range within which a fitted block covers one that is left out: 2 °C of -20 .. 60."""


class HoldOut(NamedTuple):
    """fitted, left_out: which blocks, shape (n,); those in neither are the gaps. whole: left out are whole cycles."""

    fitted: Chosen
    left_out: Chosen
    whole: bool


def cycle_numbers(temperature: Floats) -> NDArray[np.int64]:
    """Number of the cycle of each block, shape (n,), rising from 0.

    A test that begins at an end of the range ends a cycle in the middle of its return to that end; one that begins
    between them, once it is back there from both. What does not return belongs to the cycle before.
    """
    low, span = float(temperature.min()), float(np.ptp(temperature))
    zone = np.where(temperature <= low + ZONE * span, -1, np.where(temperature >= low + (1 - ZONE) * span, 1, 0))
    visits: list[list[int]] = []
    for k in np.flatnonzero(zone).tolist():
        if visits and zone[visits[-1][0]] == zone[k]:
            visits[-1][1] = k
        else:
            visits.append([k, k])
    if zone[:1].any():
        # Visits 0, 2, 4, ... are at the end where it begins. Cut in those that a further return follows.
        cuts = [(first + last) // 2 + 1 for first, last in visits[2:-2:2]]
    else:
        # Visits 0 and 1 are the two ends, as are 2 and 3. Cut between them where both of the next pair are there.
        cuts = [
            last + 1 + _back(temperature[last + 1 : after[0] + 1], temperature[0], span)
            for (_, last), after in zip(visits[1:-2:2], visits[2:-1:2], strict=True)
        ]
    numbers = np.zeros(len(temperature), dtype=np.int64)
    for cut in cuts:
        numbers[cut:] += 1
    return numbers


def _back(temperature: Floats, begin: float, span: float) -> int:
    """The first block, of those from one end to the other, shape (n,), that is back at the temperature ``begin``, or as
    near to it as lags let it come."""
    up = temperature[-1] > temperature[0]
    left = (begin - temperature) * (1 if up else -1)
    return int(np.argmax(left <= ARRIVED * span))


def count(blocks: "Blocks") -> int:
    """How many cycles."""
    return len(np.unique(blocks.cycle))


def by_cycle(blocks: "Blocks") -> "list[Blocks]":
    """The cycles, one by one."""
    return [blocks.part(blocks.cycle == number) for number in np.unique(blocks.cycle)]


def last_cycle(blocks: "Blocks", gap: float) -> HoldOut:
    """What is held out of a test for judging: its last cycle, or of a single cycle the two parts that the others cover
    best."""
    folds = hold_outs(blocks, gap)
    return folds[-1] if folds[0].whole else max(folds, key=lambda fold: int(covered(blocks, fold).sum()))


def hold_outs(blocks: "Blocks", gap: float, parts: int = PARTS) -> list[HoldOut]:
    """Each cycle left out in turn; of a single one every fourth of so many ``parts``, ``gap`` [s] on either side."""
    numbers = np.unique(blocks.cycle)
    if len(numbers) > 1:
        return [HoldOut(blocks.cycle != number, blocks.cycle == number, True) for number in numbers]
    order = np.arange(len(blocks)) * parts // len(blocks)
    gap = min(gap, LARGEST_GAP * float(np.ptp(blocks.t)) / parts)
    return [_parts(blocks, order % FOLDS == fold, gap) for fold in range(FOLDS)]


def _parts(blocks: "Blocks", left_out: Chosen, gap: float) -> HoldOut:
    edges = np.flatnonzero(np.diff(left_out))
    ends = 0.5 * (blocks.t[edges] + blocks.t[edges + 1])
    near = (np.abs(blocks.t[:, None] - ends) < gap).any(axis=1) if len(ends) else np.zeros(len(blocks), dtype=bool)
    return HoldOut(~left_out & ~near, left_out, False)


def covered(blocks: "Blocks", held: HoldOut) -> Chosen:
    """Which of the blocks left out have a fitted one within NEAR of the range of every input, shape (n,); where fewer
    than half have, as on a way up without a way down, those within the range fitted."""
    near, within = held.left_out.copy(), held.left_out.copy()
    for values in blocks.inputs.values():
        seen = np.sort(values[held.fitted])
        if len(seen):
            above = np.minimum(np.searchsorted(seen, values), len(seen) - 1)
            nearest = np.minimum(np.abs(seen[above] - values), np.abs(seen[np.maximum(above - 1, 0)] - values))
            near &= nearest <= NEAR * float(np.ptp(values))
            within &= (values >= seen[0]) & (values <= seen[-1])
    return near if near.sum() >= 0.5 * held.left_out.sum() else within


def memory_of(blocks: "Blocks") -> float:
    """How long what a smooth curve over temperature leaves of the rate at rest goes on as it was [s]: the integral of
    its correlation to the first zero; at least the time between two blocks."""
    rest = blocks.part(blocks.at_rest)
    step = float(np.median(np.diff(rest.t))) if len(rest) > 1 else 0.0
    if len(rest) < 16:
        return step
    x = rest.temperature
    u = 2 * (x - x.min()) / max(float(np.ptp(x)), 1e-12) - 1
    design = np.polynomial.chebyshev.chebvander(u, 5)
    left = rest.rate - design @ np.linalg.lstsq(design, rest.rate, rcond=None)[0]
    spectrum = np.fft.rfft(left - left.mean(), 2 * len(left))
    correlation = np.fft.irfft(np.abs(spectrum) ** 2)[: len(left)]
    if not correlation[0] > 0:
        return step
    correlation /= correlation[0]
    zero = int(np.argmax(correlation <= 0)) if (correlation <= 0).any() else len(left)
    return step * max(1.0, float(correlation[:zero].sum()))
