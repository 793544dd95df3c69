"""The numbers of summary.json, from the decimated trace of a run.

Nothing here can be NaN: a number that does not exist (no convergence, no bound) is None, so that
the file is strict JSON.
"""

import math
from collections.abc import Mapping
from typing import Any, Final, NamedTuple

import numpy as np
import polars as pl
from numpy.typing import NDArray

from cosim.angle import UNIT_NAMES
from cosim.layout import PARAMETER_NAMES

Floats = NDArray[np.float64]
Summary = dict[str, Any]

WITHIN: Final = 0.01
"""Relative error that counts as converged (TW 201137310 draws no line)."""
SETTLING: Final = 0.02
"""The rate error counts from this long after an edge of the rate [s]."""
REFERENCE: Final = 0.01
"""The angle error is taken less its mean over this long after convergence [s], without what a filter makes of edges of
the rate: the time until SETTLING after one, where there is any other."""
ANGLE_NAMES: Final = (
    *("rms_deg", "max_deg", "reference_deg", "raw_rms_deg", "raw_max_deg"),
    *("drift_deg_per_s", "lag_s"),
)
"""Numbers of an angle unit, see `angle_metrics`."""
LAG_WINDOW: Final = 0.1
"""The lag is taken from what the rate does within this time [s]."""
LAG_NEEDS: Final = 0.1
"""A lag is reported where the rate has at least this rms [rad/s] about its trend in a window."""


class Bounds(NamedTuple):
    """Posterior Cramer-Rao bounds, as standard deviations, at times t.

    t [s], shape (n,), rising; relative: of the seven in the order of PARAMETER_NAMES, shape (n, 7);
    omega: of the rate [rad/s], shape (n,); drift: of the pattern's turning at its worst angle
    [rad/s], shape (n,); effects: of what else is estimated, by FMU name, SI, shapes (n,).
    """

    t: Floats
    relative: Floats
    omega: Floats
    drift: Floats
    effects: Mapping[str, Floats] = {}

    def relative_at(self, t: Floats) -> Floats:
        """Return the relative bounds at `t` [s], shape (m,), as (m, 7); NaN where none is known.

        Bounds fall as powers of time, so their logarithm is interpolated.
        """
        columns = [np.interp(t, self.t, np.log(column), left=np.nan, right=np.nan) for column in self.relative.T]
        bounds: Floats = np.exp(np.stack(columns, axis=1))
        return bounds


def parameter_metrics(trace: pl.DataFrame, bounds: Bounds | None) -> Summary:
    """Return per parameter {true, estimate, relative_error, within_1_percent_at, over_bound}.

    Values are those at the end of the run; within_1_percent_at is the time [s] from which the
    estimate stays within 1 % of the truth of the moment, None if it ends outside; over_bound is
    the size of the relative error over its bound, at the last time for which that is known.
    """
    t = trace["t"].to_numpy()
    result: Summary = {}
    for index, name in enumerate(PARAMETER_NAMES):
        true, estimate = trace[f"true_{name}"].to_numpy(), trace[f"est_{name}"].to_numpy()
        # A cross term may be zero; its relative error is then no number.
        with np.errstate(divide="ignore", invalid="ignore"):
            error = estimate / true - 1
        over_bound = None
        if bounds is not None:
            last = np.searchsorted(t, bounds.t[-1], side="right") - 1
            with np.errstate(divide="ignore", invalid="ignore"):
                over_bound = number(abs(error[last]) / bounds.relative_at(t[last : last + 1])[0, index])
        result[name] = {
            "true": number(true[-1]),
            "estimate": number(estimate[-1]),
            "relative_error": number(error[-1]),
            "within_1_percent_at": _stays_from(t, np.abs(error) <= WITHIN),
            "over_bound": over_bound,
        }
    return result


def omega_metrics(trace: pl.DataFrame, converged_at: float | None, edges: Floats) -> Summary:
    """Return {rms_error} [rad/s] of the estimated rate from convergence on.

    The 20 ms after each of `edges` [s], shape (n,), are left out.
    """
    if converged_at is None:
        return {"rms_error": None}
    t = trace["t"].to_numpy()
    counts = (t >= converged_at) & _settled(t, edges)
    error = (trace["est_omega_z"] - trace["omega_true"]).to_numpy()[counts]
    return {"rms_error": _rms(error)}


def angle_metrics(
    t: Floats,
    angle: Floats,
    angle_true: Floats,
    omega: Floats,
    converged_at: float | None,
    edges: Floats,
) -> Summary:
    """Return {rms_deg, max_deg, reference_deg, raw_rms_deg, raw_max_deg, drift_deg_per_s, lag_s} from convergence to
    the end.

    angle, angle_true [rad], omega: true rate [rad/s], shapes (n,). The error is taken less its mean just after
    convergence, reference_deg (`reference_mean`), the raw one as it is; drift is the slope of its straight-line fit.
    The lag is `run_lag` without the 20 ms after each of `edges` [s]: what a filter does to an edge counts as error, not
    as lag.
    """
    error = angle - angle_true
    valid = np.isfinite(error)
    if converged_at is not None:
        valid &= t >= converged_at
    if converged_at is None or np.count_nonzero(valid) < 2:
        return dict.fromkeys(ANGLE_NAMES)
    t, error, omega = t[valid], error[valid], omega[valid]
    settled = _settled(t, edges)
    lag = run_lag(t[settled], error[settled], omega[settled])
    raw = np.rad2deg(error)
    reference = float(np.rad2deg(reference_mean(t, error, converged_at, edges)))
    error = raw - reference
    return {
        "rms_deg": _rms(error),
        "max_deg": number(np.abs(error).max()),
        "reference_deg": number(reference),
        "raw_rms_deg": _rms(raw),
        "raw_max_deg": number(np.abs(raw).max()),
        "drift_deg_per_s": number(np.polyfit(t - t.mean(), error, 1)[0]),
        "lag_s": lag,
    }


def reference_mean(t: Floats, error: Floats, converged_at: float, edges: Floats) -> float:
    """Mean of `error`, without its gaps, over the first 10 ms after convergence, as far as they are at least 20 ms
    after the last of `edges` [s], shape (n,); over all 10 ms if none are; 0 if empty."""
    inside = (t >= converged_at) & (t < converged_at + REFERENCE) & np.isfinite(error)
    first, settled = error[inside], _settled(t[inside], edges)
    if not first.size:
        return 0.0
    return float(first[settled].mean() if settled.any() else first.mean())


def run_lag(t: Floats, error: Floats, omega: Floats) -> float | None:
    """Lag [s] of the angle over a run with any rate, None where the rate varies too slowly.

    An angle that is late by tau is wrong by -tau * omega: tau is minus the regression coefficient
    of `error` [rad] on `omega` [rad/s], shapes (n,), with offset and drift removed in every window
    of 0.1 s. The short window is what makes it a lag: errors of the estimated damping make the
    angle drift by f(theta), and df/dtheta of 0.01 /s turns a rate that swings at w into an error
    that looks like a lag of 0.01/w^2, 0.3 ms for a hand at 1 Hz and 3 us at 10 Hz.
    """
    if len(t) == 0:
        return None
    cuts = np.searchsorted(t, np.arange(t[0], t[-1], LAG_WINDOW)[1:])
    product = power = 0.0
    for part in np.split(np.arange(len(t)), cuts):
        varying = _without_trend(t[part], omega[part])
        product += float(varying @ error[part])
        power += float(varying @ varying)
    return number(-product / power) if power >= len(t) * LAG_NEEDS**2 else None


def summarise(
    trace: pl.DataFrame,
    *,
    scenario: str,
    seed: int,
    unit: str,
    converged_at: float | None,
    edges: Floats,
    bounds: Bounds | None,
    validity: Any,
    extra: Mapping[str, float],
    real_time_factor: float,
    run: dict[str, str | float | bool | None],
) -> Summary:
    """Return the content of summary.json.

    trace: the columns of trace.parquet; unit: the angle unit chosen, A, B or C; edges: of the rate
    [s]; validity: a cosim.recorder.Validity; extra: true values, by name, of what was estimated
    beside the seven, SI; run: what else the reader should know (device, observer, duration, ...), copied.
    """
    converged_at = number(converged_at)
    columns = {name: trace[name].to_numpy() for name in ("t", "angle_true", "omega_true")}
    units = {
        name: angle_metrics(
            columns["t"],
            trace[f"angle_{name}"].to_numpy(),
            columns["angle_true"],
            columns["omega_true"],
            converged_at,
            edges,
        )
        for name in UNIT_NAMES
    }
    return {
        "scenario": scenario,
        "seed": seed,
        "converged_at": converged_at,
        "valid": {
            "share": number(validity.share),
            "withdrawn": [{"t": number(t), "reason": reason} for t, reason in validity.withdrawn],
            "now": bool(validity.now),
            "reason": validity.reason,
            "stopped": validity.stopped,
        },
        "predicted": {
            "drift_sigma_deg_per_s": number(np.rad2deg(trace["drift_sigma"][-1])),
            "drift_sigma_now_deg_per_s": number(np.rad2deg(trace["drift_sigma_now"][-1])),
            "angle_sigma_deg": number(np.rad2deg(trace["angle_sigma"][-1])),
            "drift_bound_deg_per_s": None if bounds is None else number(np.rad2deg(bounds.drift[-1])),
        },
        "effects": {
            name: {"true": number(true), "estimate": number(trace[f"est_{name}"][-1])} for name, true in extra.items()
        },
        "parameters": parameter_metrics(trace, bounds),
        "omega": omega_metrics(trace, converged_at, edges),
        "angle": {"unit": unit, **units[unit]},
        "angle_units": units,
        "real_time_factor": number(real_time_factor),
        "run": dict(run),
    }


def number(value: float | None) -> float | None:
    """Return a plain float, or None for what JSON can't hold (NaN, infinities)."""
    return float(value) if value is not None and math.isfinite(value) else None


def _rms(error: Floats) -> float | None:
    return number(np.sqrt(np.mean(np.square(error)))) if error.size else None


def _without_trend(t: Floats, values: Floats) -> Floats:
    """Subtract the straight line of least squares; nothing is left of one or two values."""
    if len(t) < 3:
        return np.zeros_like(values)
    since = t - t.mean()
    centred = values - values.mean()
    detrended: Floats = centred - since * (since @ centred) / (since @ since)
    return detrended


def _stays_from(t: Floats, inside: NDArray[np.bool_]) -> float | None:
    """First time from which `inside` holds to the end."""
    outside = np.flatnonzero(~inside)
    if outside.size == 0:
        return number(t[0])
    return number(t[outside[-1] + 1]) if outside[-1] + 1 < len(t) else None


def _settled(t: Floats, edges: Floats) -> NDArray[np.bool_]:
    """Whether the last edge is at least 20 ms ago."""
    # Half a microsecond: an edge at k * period belongs to sample k whatever its rounding.
    last_edge = np.searchsorted(edges, t + 5e-7, side="right") - 1
    settled: NDArray[np.bool_] = t - np.append(edges, -np.inf)[last_edge] >= SETTLING
    return settled
