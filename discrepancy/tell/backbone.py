"""Frequency and damping over amplitude, as a run shows them where it moves at one frequency at a time: free decays and
swept or stepped sines (docs/theory/records.md, eq. 7)."""

from collections.abc import Mapping, Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from discrepancy.data.linear_fit import held
from discrepancy.data.record import Floats, Record

Complexes = NDArray[np.complex128]

LONG, SHORT = 30.0, 6.0
"""Periods of a window: more hold a line of noise down, fewer follow a fast decay."""
DECAY: Final = 0.1
"""Window over Q periods: the amplitude then falls by e^{-0.3}, which a straight line follows to 1 %."""
PURE: Final = 1e-3
"""Share of a window's power beside its one frequency, above which it holds more than one."""
ACROSS: Final = 0.3
"""Share of a force that the damping takes, below which the window says little of it: off resonance, or amplitude still
grows."""
QUIET: Final = 0.03
"""Amplitude over the largest, below which a decay is noise."""
FEWEST: Final = 6
"""Windows that make a curve."""
SPAN: Final = 1.3
"""Largest amplitude over the smallest, from which there is something to see."""
MOST, TRIED = 200, 10
"""Windows looked at; one in so many is, first."""


class Backbone(NamedTuple):
    """By window: amplitude [m], frequency [Hz] √(k/m)/2π, and quality factor √(k m)/d, each (windows,)."""

    amplitude: Floats
    frequency: Floats
    quality: Floats


class Bent(NamedTuple):
    """The run and axis of the data that show the widest range of amplitudes, and the curves of what was ``measured``,
    of the model after the ``refit`` and of the ``final`` one."""

    run: str
    axis: int
    curves: dict[str, Backbone]


def bent(
    records: Sequence[Record], refit: Sequence[Floats], final: Sequence[Floats], parameters: Mapping[str, float]
) -> Bent | None:
    """Frequency and damping over amplitude in the runs, whose residuals under two models are ``refit`` and ``final``,
    each (n, axes) [V]; None where no run moves at one frequency at a time."""
    found = [
        (own, record, models, axis)
        for record, *models in zip(records, refit, final, strict=True)
        for axis in range(record.axes)
        if (own := backbone(record, record.v, parameters, axis)) is not None
    ]
    if not found:
        return None
    measured, record, models, axis = max(found, key=lambda entry: float(np.ptp(entry[0].amplitude)))
    curves = {"measured": measured}
    for name, residual in zip(("refit", "final"), models, strict=True):
        own = backbone(record, record.v - residual, parameters, axis) if np.isfinite(residual).all() else None
        if own is not None:
            curves[name] = own
    return Bent(record.name, axis, curves)


def backbone(record: Record, v: Floats, parameters: Mapping[str, float], axis: int) -> Backbone | None:
    """What the voltage ``v`` (n, axes) of a run, measured or simulated, shows on an axis with the mass, gains and
    coupling of ``parameters``; None where too few windows hold one frequency, all have one amplitude, or v
    shows no position."""
    name = "xy"[axis]
    m, k, d = (parameters[key] for key in ("m", f"k{name}{name}", f"d{name}{name}"))
    w0 = float(np.sqrt(k / m))
    periods = float(np.clip(DECAY * np.sqrt(k * m) / d, SHORT, LONG))
    n = int(periods * 2 * np.pi / w0 * record.sample_rate)
    if n < 4 * periods or n > len(v) or record.order:
        return None
    q = v / [parameters[f"sense_gain_{own}"] for own in "xy"[: record.axes]]
    starts = [start for start in np.unique(np.linspace(0, len(v) - n, MOST).astype(int))
              if record.valid[start : start + n].all()]  # fmt: skip

    def windows(chosen: Sequence[int]) -> list[tuple[float, float, float]]:
        own = (_window(q[s : s + n], record.u[s : s + n], record, parameters, axis) for s in chosen)
        return [found for found in own if found is not None]

    # Most runs hold many frequencies at a time, which a few windows show.
    if not windows(starts[::TRIED]):
        return None
    amplitude, stiffness, damping = np.array(windows(starts)).T
    seen = (amplitude > QUIET * amplitude.max(initial=0.0)) & (stiffness > 0) & (damping > 0)
    amplitude, stiffness, damping = amplitude[seen], stiffness[seen], damping[seen]
    if len(amplitude) < FEWEST or amplitude.max() < SPAN * amplitude.min():
        return None
    return Backbone(amplitude, np.sqrt(stiffness / m) / (2 * np.pi), np.sqrt(stiffness * m) / damping)


def _window(
    q: Floats, u: Floats, record: Record, p: Mapping[str, float], axis: int
) -> tuple[float, float, float] | None:
    """Amplitude, stiffness and damping (eq. 7); None where the window holds more than one frequency, or a force beside
    the resonance."""
    rate, n = record.sample_rate, len(q)
    w = _frequency(q[:, axis], rate)
    tau = (np.arange(n) - (n - 1) / 2) / rate
    turn = np.exp(1j * w * tau)
    scale = tau / tau[-1]
    courses = [order * part for order in (1.0, scale, 0.5 * scale**2) for part in (turn.real, -turn.imag)]
    basis = np.column_stack((*np.broadcast_arrays(*courses), np.ones(n)))
    both = np.hstack((q, u))
    solution = np.linalg.lstsq(basis, both, rcond=None)[0]
    own = q[:, axis] - solution[-1, axis]
    left = q[:, axis] - basis @ solution[:, axis]
    if not own.any() or np.sum(left**2) > PURE * np.sum(own**2):
        return None
    value, slope, bend = ((solution[2 * k] + 1j * solution[2 * k + 1]) / tau[-1] ** k for k in range(3))
    axes = q.shape[1]
    a, b, c = value[axis], slope[axis], bend[axis]
    force = value[axes + axis] * complex(held(record.hold, np.array(w / rate)))
    for other in set(range(axes)) - {axis}:
        force -= p["kxy"] * value[other] + p["dxy"] * (1j * w * value[other] + slope[other])
    right = force + p["m"] * (w**2 * a - 2j * w * b - c)
    matrix = np.array([[a.real, (1j * w * a + b).real], [a.imag, (1j * w * a + b).imag]])
    stiffness, damping = np.linalg.solve(matrix, [right.real, right.imag])
    if abs(damping * w * a) < ACROSS * abs(force):
        return None
    return abs(a), float(stiffness), float(damping)


def _frequency(q: Floats, rate: float) -> float:
    """That of the strongest line [rad/s]: by the slope of its phase from one half of the window to the other, after
    the bin that holds it."""
    n = len(q)
    spectrum = np.abs(np.fft.rfft((q - q.mean()) * np.hanning(n)))
    w = 2 * np.pi * max(int(np.argmax(spectrum)), 1) * rate / n
    half = n // 2
    line = (q - q.mean()) * np.exp(-1j * w * np.arange(n) / rate)
    first, last = (np.sum(line[part] * np.hanning(half)) for part in (slice(half), slice(n - half, n)))
    return float(w + np.angle(last * np.conj(first)) * rate / (n - half))
