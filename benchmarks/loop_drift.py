"""How the angle of unit C drifts in a run, beside what the loop predicts of it and what its bound leaves."""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cosim.metrics import angle_metrics
from cosim.monitor import strayed_slope
from cosim.recorder import Result
from cosim.run import Run

Floats = NDArray[np.float64]

SPAN: Final = (0.5, 1.0)
"""The drift of a run is the slope of the angle's error over this [s]."""
AFTER_EDGE: Final = 2e-3
"""The rate is known again this long after an edge [s]."""
WINDOW: Final = 0.1
STRIDE: Final = 0.01
"""Windows in which a valid angle must not drift: length, and from the start of one to that of the next [s]."""
LIE: Final = 0.5
"""A valid angle that drifts faster than this [deg/s] and than LIE_SIGMAS times its prediction was not valid."""
LIE_SIGMAS: Final = 4.0


class Lie(NamedTuple):
    """The worst window in which the angle was said to be valid and drifted all the same: its start [s], the drift and
    its predicted standard deviation [deg/s]; ``windows``: all such in the run."""

    t: float
    drift: float
    sigma: float
    windows: int


def drift(result: Result, span: tuple[float, float] = SPAN) -> float:
    """Slope [deg/s] of the error of angle C over ``span`` [s]; infinite unless there is an angle throughout."""
    t, error = _error(result)
    inside = (t >= span[0]) & (t < span[1])
    if inside.sum() < 2 or t[-1] < 0.5 * sum(span) or not np.isfinite(error[inside]).all():
        return np.inf
    return slope(t[inside], error[inside])


def drift_between_edges(result: Result, run: Run, span: tuple[float, float] = SPAN) -> float:
    """The same with a step of the angle left free at each edge of the rate, and AFTER_EDGE left out behind it.

    A step of the rate turns the pattern itself, by up to half its size over the oscillation's angular frequency, where
    the plant has a Coriolis force without the Euler force; no loop takes part in that.
    """
    t, error = _error(result)
    edges = run.scenario.edges_until(run.duration)
    since = np.searchsorted(edges, t + 5e-7, side="right")
    last = np.append(edges, -np.inf)[since - 1]
    inside = (t >= span[0]) & (t < span[1]) & (t - last >= AFTER_EDGE)
    if inside.sum() < 2 or t[-1] < 0.5 * sum(span) or not np.isfinite(error[inside]).all():
        return np.inf
    # Within each piece less its mean: the slope that all pieces share.
    t, error, piece = t[inside], error[inside], since[inside]
    count = np.bincount(piece)
    with np.errstate(invalid="ignore"):
        t, error = (v - (np.bincount(piece, v) / count)[piece] for v in (t, error))
    return float(t @ error / (t @ t))


def predicted(result: Result, span: tuple[float, float] = SPAN) -> float:
    """The loop's own standard deviation of its drift [deg/s]: of the turning, rms over ``span`` [s], together with the
    slope that what the pattern strays by in it gives (``strayed_slope``); infinite where it had none."""
    t, turning, strayed = (result.trace[name].to_numpy() for name in ("t", "drift_sigma_now", "stray_sigma"))
    inside = (t >= span[0]) & (t < span[1])
    if not inside.any():
        return np.inf
    walked = strayed_slope(float(strayed[inside][-1] ** 2 - strayed[inside][0] ** 2), span[1] - span[0])
    return float(np.rad2deg(np.hypot(np.sqrt(np.mean(np.square(turning[inside]))), walked)))


def bound(result: Result, span: tuple[float, float] = SPAN) -> float:
    """The Cramer-Rao bound on the drift [deg/s]: rms over ``span`` [s]; NaN where there is none."""
    if result.bounds is None:
        return np.nan
    t = result.trace["t"].to_numpy()
    inside = t[(t >= span[0]) & (t < span[1])]
    found = np.interp(inside, result.bounds.t, result.bounds.drift)
    return float(np.rad2deg(np.sqrt(np.mean(np.square(found))))) if len(inside) else np.nan


class Window(NamedTuple):
    """A window in which the angle was said to be valid throughout: its start [s], the drift and its predicted standard
    deviation [deg/s]."""

    t: float
    drift: float
    sigma: float

    def is_lie(self) -> bool:
        """Whether the angle drifted by more than LIE and LIE_SIGMAS times what was predicted."""
        return not abs(self.drift) <= max(LIE, LIE_SIGMAS * self.sigma)


def valid_windows(result: Result) -> list[Window]:
    """All windows of WINDOW, STRIDE apart, in which the angle was said to be valid throughout."""
    t, error = _error(result)
    valid, sigma = result.trace["converged"].to_numpy(), np.rad2deg(result.trace["drift_sigma"].to_numpy())
    windows = []
    for begin in np.arange(0.0, t[-1] - WINDOW + 0.5 * STRIDE, STRIDE):
        first, last = np.searchsorted(t, [begin - 1e-9, begin + WINDOW - 1e-9])
        if last - first >= 2 and valid[first:last].all():
            expected = float(np.sqrt(np.mean(np.square(sigma[first:last]))))
            windows.append(Window(float(begin), slope(t[first:last], error[first:last]), expected))
    return windows


def lie(result: Result) -> Lie | None:
    """The worst window in which the flag was up throughout and the angle drifted, or None."""
    lies = [window for window in valid_windows(result) if window.is_lie()]
    # A drift that is no number is the worst.
    worst = max(lies, key=lambda window: np.nan_to_num(abs(window.drift), nan=np.inf), default=None)
    return None if worst is None else Lie(*worst, windows=len(lies))


def angle_rms(result: Result, run: Run) -> float:
    """Rms error of angle C [deg] from convergence to the end; infinite where it was never valid."""
    trace = result.trace
    t, angle, true, omega = (trace[name].to_numpy() for name in ("t", "angle_C", "angle_true", "omega_true"))
    edges = run.scenario.edges_until(run.duration)
    found = angle_metrics(t, angle, true, omega, result.converged_at, edges)["rms_deg"]
    return np.inf if found is None else float(found)


def slope(t: Floats, values: Floats) -> float:
    """Slope of the straight line of least squares through ``values``, shape (n,), at ``t``."""
    since = t - t.mean()
    return float(since @ (values - values.mean()) / (since @ since))


def _error(result: Result) -> tuple[Floats, Floats]:
    """Time [s] and error of angle C [deg]."""
    trace = result.trace
    return trace["t"].to_numpy(), np.rad2deg((trace["angle_C"] - trace["angle_true"]).to_numpy())
