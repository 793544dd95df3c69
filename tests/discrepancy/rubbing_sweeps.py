"""Sweeps of a mass that rubs on a bent spring, by no line of the FMU."""

from typing import Final

import numpy as np
from numba import njit

from discrepancy.data.record import Floats, Record, make_record

M, FREQUENCY, Q, K3, FRICTION = 0.4, 20.0, 40.0, 5e7, 0.3
"""kg; Hz; none; N/m³, at the largest motion 1.4 times as strong as the spring; N, a tenth of the force."""
K: Final = M * (2 * np.pi * FREQUENCY) ** 2
D: Final = M * 2 * np.pi * FREQUENCY / Q
STEEP: Final = 1e-4
"""Speed [m/s] at which friction turns round, a thousandth of the highest."""
RATE, SAMPLES, PARTS = 1600.0, 9600, 16
"""Hz; six seconds; steps a sample."""


@njit(cache=True)
def _moved(u: Floats, step: float, every: int, k3: float, friction: float) -> Floats:
    """Places at every so many-th of the steps of force u, in between which it is the mean of its ends: the implicit
    midpoint rule, each step by Newton's method."""
    x, v, found = 0.0, 0.0, np.empty((len(u) - 1) // every + 1)
    for i in range(len(u) - 1):
        if i % every == 0:
            found[i // every] = x
        force, new = 0.5 * (u[i] + u[i + 1]), v
        for _ in range(60):
            middle, speed = x + 0.25 * step * (v + new), 0.5 * (v + new)
            rubs = np.tanh(speed / STEEP)
            left = M * (new - v) / step + D * speed + K * middle + k3 * middle**3 + friction * rubs - force
            slope = M / step + D / 2 + (K + 3 * k3 * middle**2) * step / 4 + friction * (1 - rubs**2) / (2 * STEEP)
            new -= left / slope
            if abs(left) < 1e-13:
                break
        x, v = x + 0.5 * step * (v + new), new
    found[-1] = x
    return found


def sweep(name: str, amplitude: float, role: str = "fit", *, k3: float = K3, friction: float = FRICTION) -> Record:
    """A run under a force of that amplitude [N] from 5 Hz to 45 Hz, in micrometres, with noise of 1e-3. The force runs
    on between samples, which the record does not say."""
    fine = RATE * PARTS
    t = np.arange(SAMPLES * PARTS + 1) / fine
    phase = 2 * np.pi * (5 * t + 0.5 * 40 * t**2 / t[-1])
    u = amplitude * np.sin(phase)
    x = _moved(u, 1 / fine, PARTS, k3, friction)[:SAMPLES]
    v = 1e6 * (x + 1e-3 * x.std() * np.random.default_rng(len(name)).standard_normal(SAMPLES))
    return make_record(name, t[::PARTS][:SAMPLES], u[::PARTS][:SAMPLES], v, sample_rate=RATE, role=role)
