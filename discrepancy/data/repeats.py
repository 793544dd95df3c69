"""Noise without a model: what differs between repetitions of one force is noise.

Where the force of a run has periods, or several runs have the same force, the motion repeats once it has settled, and
half the mean square of the difference of two repetitions is the variance of the noise (R. Pintelon, J. Schoukens,
System Identification: A Frequency Domain Approach, 2012, section 2.5). It holds at any sample rate and takes all that
does not repeat for noise: flicker, thermal motion, mains.
"""

from collections.abc import Sequence
from typing import Final

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft

from discrepancy.data.record import Floats, Record

SHORTEST: Final = 50
"""Samples of a period at least: below, a tone repeats and says nothing of what lies between."""
SAME: Final = 1e-2
"""Of the force's rms, by which two repetitions may differ: the noise of a measured force."""
LIKELY: Final = 0.999
"""Autocorrelation at a lag from which it is tried as a period."""
PERIODS: Final = 3
"""At least: the motion settles over the first."""
ROUNDED: Final = 1e-9
"""Of a force's rms, up to which it does not change."""
SETTLED: Final = 1.5
"""Times the last difference of two periods, in rms, from which an earlier one has not settled."""


def repeated_noise(records: Sequence[Record]) -> float | None:
    """Rms of the noise a sample [V] over all channels; None where nothing repeats."""
    squares = [s for s in (*map(_over_periods, records), *_over_runs(records)) if s is not None]
    return float(np.sqrt(np.mean(squares))) if squares else None


def period_of(u: Floats) -> int | None:
    """The shortest period of u (n, axes) in samples, of which there are PERIODS or more; None where there is none."""
    n = len(u)
    centred = u - u.mean(axis=0)
    total = float(np.sum(centred**2))
    # The mean of a force that never changes is off by its rounding, which repeats.
    if total <= ROUNDED**2 * float(np.sum(u**2)):
        return None
    size = next_fast_len(2 * n, real=True)
    product = irfft((np.abs(rfft(centred, size, axis=0)) ** 2).sum(axis=1), size)[: n // PERIODS + 1]
    # Fewer samples overlap at a longer lag.
    power = np.concatenate(([0.0], np.cumsum((centred**2).sum(axis=1))))
    lags = np.arange(len(product))
    overlap = 0.5 * (power[n - lags] + power[n] - power[lags])
    likely = np.flatnonzero(product > LIKELY * overlap)
    for lag in likely[likely >= SHORTEST]:
        if np.mean((u[lag:] - u[:-lag]) ** 2) < SAME**2 * np.mean(centred**2):
            return int(lag)
    return None


def _over_periods(record: Record) -> float | None:
    period = period_of(record.u)
    if period is None or any(np.ptp(values) > 0 for values in record.conditions.values()):
        return None
    count = len(record.t) // period
    v = record.v[: count * period].reshape(count, period, -1)
    usable = record.valid[: count * period].reshape(count, period)
    squares = [_difference(v[i + 1], v[i], usable[i + 1] & usable[i]) for i in range(count - 1)]
    # From the end back as long as nothing grows: what comes before is the motion settling.
    kept = [squares[-1]]
    for square in reversed(squares[:-1]):
        if square > SETTLED**2 * np.mean(kept):
            break
        kept.append(square)
    return float(np.mean(kept)) if len(kept) > 1 else None


def _over_runs(records: Sequence[Record]) -> list[float | None]:
    found: list[float | None] = []
    for i, one in enumerate(records):
        for other in records[:i]:
            if one.u.shape == other.u.shape and np.array_equal(one.u, other.u) and one.u.any() \
                    and _same_conditions(one, other):  # fmt: skip
                # The second half, where different beginnings have settled.
                quarters = np.array_split(np.arange(len(one.t)), 4)[2:]
                parts = [_difference(one.v[p], other.v[p], one.valid[p] & other.valid[p]) for p in quarters]
                found.append(parts[1] if parts[0] < SETTLED**2 * parts[1] else None)
    return found


def _same_conditions(one: Record, other: Record) -> bool:
    return set(one.conditions) == set(other.conditions) and all(
        np.array_equal(values, other.conditions[name]) for name, values in one.conditions.items()
    )


def _difference(a: Floats, b: Floats, usable: np.ndarray) -> float:
    return float(np.mean((a - b)[usable] ** 2) / 2) if usable.any() else np.inf
