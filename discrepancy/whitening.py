"""Turns residuals into innovations: what a disturbed mechanical motion and white sensor noise leave unpredicted.

Thermal force, and any force that a model lacks, shake the modes, so a residual of the output is correlated over the
decay of a mode (longer than many records) and a test for white residuals finds effects in it that are not there. The
linear model with a white force of unknown strength, in a steady-state Kalman filter, takes the correlation out;
without such a force the filter changes nothing. Columns go through the same filter, so the fit that follows is
generalised least squares (T. Kailath, IEEE Trans. Automatic Control 13, 1968).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numba import njit
from scipy.linalg import expm, solve_discrete_are

from discrepancy.record import Bools, Floats

MEMORIES: Final = (0.0, 1.0, 4.0, 16.0, 64.0, 256.0, 1024.0)
"""Tracking bandwidths tried, in units of one over the length of a run; 0: no disturbance."""


@dataclass(frozen=True)
class Whitener:
    """transition (s, s), gain (s, axes), seen (axes, s), root (axes, axes): innovation = root (v - seen s)."""

    transition: Floats
    gain: Floats
    seen: Floats
    root: Floats
    bandwidth: float

    def __call__(self, v: Floats, valid: Bools) -> Floats:
        """Innovations of v (columns, n, axes) [V], zero where a sample is not valid (n,); same shape and unit."""
        out = np.empty_like(v)
        _filter(self.transition, self.gain, self.seen, self.root, np.ascontiguousarray(v), valid, out)
        return out


def whitener(p: Mapping[str, float], axes: int, period: float, bandwidth: float) -> Whitener:
    """The filter of a device with parameters ``p`` (FMU names, SI) for a tracking ``bandwidth`` [1/s]; 0 gives the
    identity."""
    n = 2 * axes
    seen = np.zeros((axes, n))
    seen[range(axes), range(0, n, 2)] = [p["sense_gain_x"], p.get("sense_gain_y", 1.0)][:axes]
    if bandwidth == 0:
        return Whitener(np.eye(n), np.zeros((n, axes)), seen, np.eye(axes), 0.0)
    k = np.array([[p["kxx"], p.get("kxy", 0.0)], [p.get("kxy", 0.0), p.get("kyy", 1.0)]])[:axes, :axes] / p["m"]
    d = np.array([[p["dxx"], p.get("dxy", 0.0)], [p.get("dxy", 0.0), p.get("dyy", 0.0)]])[:axes, :axes] / p["m"]
    rate = np.zeros((n, n))
    rate[::2, 1::2], rate[1::2, ::2], rate[1::2, 1::2] = np.eye(axes), -k, -d
    # In time of 1/w and volt, where all entries are of order 1 and the Riccati equation is well scaled.
    w = float(np.sqrt(np.linalg.eigvalsh(k).max()))
    gains = seen[range(axes), range(0, n, 2)]
    scale = np.repeat(1 / gains, 2) * np.tile([1.0, w], axes)
    transition = expm(rate * period)
    balanced = transition * scale / scale[:, None]
    observed = np.zeros((axes, n))
    observed[range(axes), range(0, n, 2)] = 1.0
    # A slowly turning amplitude with drift variance s a second in white noise of density r T is tracked with s = b^2
    # r T.
    drift = np.diag(np.tile([0.0, 4 * bandwidth**2 * period**2], axes))
    p_inf = solve_discrete_are(balanced.T, observed.T, drift, np.eye(axes))
    innovation = observed @ p_inf @ observed.T + np.eye(axes)
    gain = p_inf @ observed.T @ np.linalg.inv(innovation)
    root = np.linalg.inv(np.linalg.cholesky(innovation))
    return Whitener(transition, gain * scale[:, None], seen, root, bandwidth)


def likeliest(p: Mapping[str, float], period: float, residuals: Sequence[Floats], valid: Sequence[Bools]) -> Whitener:
    """The filter under which ``residuals`` (one (n, axes) a run) [V] are likeliest, their noise level free."""
    axes = residuals[0].shape[1]
    length = max(len(r) for r in residuals) * period
    best, least = None, np.inf
    for memory in MEMORIES:
        filtered = whitener(p, axes, period, memory / length)
        square, count = 0.0, 0
        for residual, usable in zip(residuals, valid, strict=True):
            square += float(np.sum(filtered(residual[None], usable) ** 2))
            count += int(usable.sum()) * axes
        cost = count * np.log(square / count) - 2 * count / axes * np.log(np.linalg.det(filtered.root))
        # Each bandwidth beyond none has to earn its parameter beyond doubt.
        if cost < least - 30.0:
            best, least = filtered, cost
    assert best is not None
    return best


@njit(cache=True, nogil=True)
def _filter(transition, gain, seen, root, v, valid, out):  # type: ignore[no-untyped-def]
    columns, n, axes = v.shape
    size = len(transition)
    for c in range(columns):
        state = np.zeros(size)
        moved = np.zeros(size)
        error = np.zeros(axes)
        for k in range(n):
            for i in range(axes):
                error[i] = 0.0
                if valid[k]:
                    error[i] = v[c, k, i] - seen[i, 2 * i] * state[2 * i]
            for i in range(size):
                for j in range(axes):
                    state[i] += gain[i, j] * error[j]
            for i in range(axes):
                total = 0.0
                for j in range(i + 1):
                    total += root[i, j] * error[j]
                out[c, k, i] = total
            for i in range(size):
                total = 0.0
                for j in range(size):
                    total += transition[i, j] * state[j]
                moved[i] = total
            for i in range(size):
                state[i] = moved[i]
