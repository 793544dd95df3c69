"""Inputs that remember: made from a signal as it comes, so that a record and a device in the field make the same.

| name | value |
| --- | --- |
| SIGNAL_rate | its time derivative [1/s of it] |
| SIGNAL_lag_TAU | a first-order lag of TAU [s] of it, less itself |
| SIGNAL_play_WIDTH | a play operator of half width WIDTH on it, less itself |

A lag stands for a temperature that no sensor sees; plays for hysteresis (Prandtl and Ishlinskii's model: M. A.
Krasnosel'skii and A. V. Pokrovskii, Systems with Hysteresis, 1989). Both start at rest at the first reading.
"""

import re
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

_NAME: Final = re.compile(r"^(?P<signal>[a-z]+)(_(?P<kind>rate|lag|play)(_(?P<size>[0-9.e+-]+))?)?$")


class Derived(NamedTuple):
    """What a name says. kind: "", "rate", "lag" or "play"; size: time constant [s] or half width [unit of signal]."""

    signal: str
    kind: str
    size: float

    @property
    def remembers(self) -> bool:
        """Whether it holds more than present value and slope."""
        return self.kind in ("lag", "play")


def derived(name: str) -> Derived:
    """The input called ``name``. Raises ValueError for a name of no such form."""
    match = _NAME.match(name)
    if match is None or (match["kind"] in ("lag", "play")) != (match["size"] is not None):
        raise ValueError(f"input {name!r}: no signal, SIGNAL_rate, SIGNAL_lag_TAU or SIGNAL_play_WIDTH")
    return Derived(match["signal"], match["kind"] or "", float(match["size"] or 0.0))


def lag_name(signal: str, time: float) -> str:
    """Name of a lag of ``time`` [s]."""
    return f"{signal}_lag_{time:g}"


def play_name(signal: str, width: float) -> str:
    """Name of a play of half width ``width`` [unit of the signal], to three digits."""
    return f"{signal}_play_{width:.3g}"


def slope(t: Floats, values: Floats) -> Floats:
    """Differences to the value before over the time between, shape (n,); the first is NaN."""
    return np.diff(values, prepend=np.nan) / np.diff(t, prepend=np.nan)


def memory(wanted: Derived, t: Floats, values: Floats) -> Floats:
    """A lag or play of ``values`` at ``t`` [s], shape (n,), less the values."""
    state, found = values[0], np.empty_like(values)
    if wanted.kind == "play":
        for k, value in enumerate(values.tolist()):
            state = min(max(state, value - wanted.size), value + wanted.size)
            found[k] = state
        return found - values
    kept = np.exp(-np.diff(t, prepend=t[0]) / wanted.size)
    before = values[0]
    for k, (value, keep) in enumerate(zip(values.tolist(), kept.tolist(), strict=True)):
        # Of a straight line between two readings: exact where a ramp is one.
        state = keep * state + (1 - keep) * 0.5 * (before + value)
        before, found[k] = value, state
    return found - values
