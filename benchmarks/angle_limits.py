"""What the error of the angle can't fall below in this loop: what the filters of the units do to it, and what is not
known of the damping."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from cosim.angle import Block, make_units
from cosim.layout import PARAMETER_NAMES
from cosim.metrics import REFERENCE, Bounds, angle_metrics
from cosim.run import Run

Floats = NDArray[np.float64]

GRID: Final = 2e-3
"""Step of the sums over time [s]; the bound falls slowly beside it."""
DRAWS: Final = 4000
"""Realisations; quantiles are then good to 2 %."""


def units_alone(run: Run, converged_at: float, mass_error: float = 0.0) -> dict[str, float]:
    """Rms error [deg] of each unit fed with the exact orbit of the isotropic oscillator under the rate of ``run``:
    no plant, no noise, no tones. What is left is what its filter does to the angle.

    The angle counts from ``converged_at`` [s] to the end. ``mass_error``, relative, of the estimated mass: the
    stiffness k is made for it, so the oscillation misses the centre of the filters.
    """
    t: Floats = np.arange(run.samples, dtype=np.float64) * np.float64(run.period)
    omega_z = run.scenario.omega_z(0, run.samples, run.period)
    turned = np.concatenate(([0.0], np.cumsum(omega_z)[:-1])) * run.period
    w = np.sqrt(run.design.stiffness / (run.device.all_parameters["m"] * (1.0 + mass_error)))
    # The pattern turns backwards by the angle (docs/theory/angle.md, eq. 2).
    along, across = np.cos(-turned), np.sin(-turned)
    x, x_dot = np.cos(w * t), -w * np.sin(w * t)
    converged = t >= converged_at
    states = np.stack((x * along, x_dot * along, x * across, x_dot * across))
    none = np.zeros((4, len(t)))
    block = Block(t, states, none, none, np.full(len(t), w * w), converged, 1.0, np.zeros(len(t)), np.zeros(len(t)))
    angle_true = turned - turned[converged.argmax()]
    edges = run.scenario.edges_until(run.duration)
    result = {}
    for name, unit in make_units(run.sample_rate, run.oscillation_hz).items():
        angle, _ = unit.process(block)
        found = angle_metrics(t, angle, angle_true, omega_z, converged_at, edges)
        result[name] = float(found["rms_deg"] or 0.0)
    return result


def damping_bound(run: Run, bounds: Bounds, converged_at: float, seeds: int) -> dict[str, dict[str, float]]:
    """Angle error [deg], ``rms`` and at the ``end``, and ``drift`` [deg/s] from convergence to the last bound, median,
    95 % and expected worst of ``seeds`` runs, for dampings known as well as their Cramer-Rao bound allows at each
    moment.

    The pattern lies within 15 deg of x, where damping that is not cancelled turns it at (error of dxy)/2m. An efficient
    estimator has errors e(t) with E[e(s) e(t)] = P(max(s, t)), P the bound: what is learned later is independent of
    what is known already. The angle follows as a double integral, its distribution by draws. It is no bound for a
    unit that corrects its past angle when it learns better.
    """
    t = np.arange(converged_at, bounds.t[-1], GRID)
    p = run.device.all_parameters
    relative = bounds.relative_at(t)[:, PARAMETER_NAMES.index("dxy")]
    rate = np.rad2deg(relative * abs(p["dxy"]) / (2 * p["m"]))
    covariance = np.square(rate)[np.maximum.outer(np.arange(len(t)), np.arange(len(t)))]
    # The controller uses what it knew up to 10 ms before: that is left out, so the truth lies above.
    values, vectors = np.linalg.eigh(covariance)
    normal = np.random.default_rng(0).standard_normal((len(t), DRAWS))
    errors = vectors @ (np.sqrt(np.maximum(values, 0.0))[:, np.newaxis] * normal)
    angle = np.cumsum(errors, axis=0) * GRID
    # Less its mean over the first 10 ms, as the angle error is taken.
    angle -= angle[: max(round(REFERENCE / GRID), 1)].mean(axis=0)
    centred = t - t.mean()
    sizes = {
        "rms": np.sqrt(np.mean(angle**2, axis=0)),
        "end": np.abs(angle[-1]),
        "drift": np.abs(centred @ angle / (centred @ centred)),
    }
    # The largest of n is at its own median below a when each is below a with probability 2^(-1/n).
    quantiles = (0.5, 0.95, 0.5 ** (1 / seeds))
    return {
        name: dict(zip(("median", "95 %", "worst"), map(float, np.quantile(values, quantiles)), strict=True))
        for name, values in sizes.items()
    }
