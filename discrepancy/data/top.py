"""The highest frequency of a record's signals that is more than noise."""

from typing import Final

import numpy as np

from discrepancy.data.record import Floats, Record

POWER: Final = 1e-4
"""Share of the power beside noise that may be faster than that."""
SCATTER: Final = 5.0
"""Of a sum of noise, in its standard deviations."""
BROAD: Final = 0.2
"""Share of a force's power from which noise is no noise but the force, as of a generator of noise."""


def top_of_motion(record: Record) -> float:
    """Of the voltage [Hz]."""
    return max(_top(column, record) for column in record.v.T)


def top_of_force(record: Record) -> float | None:
    """Of the force [Hz]; None of one that is noise itself, which has no highest; 0 where there is none."""
    driven = [column for column in record.u.T if column.any()]
    if any(_noise(column, record)[1] > BROAD for column in driven):
        return None
    return max((_top(column, record) for column in driven), default=0.0)


def _top(signal: Floats, record: Record) -> float:
    power, _ = _noise(signal, record)
    noise = float(power[len(power) // 2 :].mean())
    rest = np.cumsum(power - noise)
    # Sums of noise scatter as the root of their number, and so does what is taken for its mean.
    beside = max(POWER * rest[-1], SCATTER * noise * np.sqrt(len(power)))
    return float(np.argmax(rest >= rest[-1] - beside) + 1) * record.sample_rate / len(signal)


def _noise(signal: Floats, record: Record) -> tuple[Floats, float]:
    """The power of ``signal`` (n,) by frequency, and the share of it that is noise, if that is what the upper half of
    the frequencies has on average."""
    n = len(signal)
    # What dies away first is at the beginning of a free decay.
    window = np.hanning(n) if record.u.any() else np.hanning(2 * n)[n:]
    power = np.abs(np.fft.rfft((signal - signal.mean()) * window)) ** 2
    return power, float(power[len(power) // 2 :].mean() * len(power) / max(power.sum(), 1e-300))
