"""Posterior Cramer-Rao bound on all that a design leaves unknown: constants, effects, the rate, and the pattern's
turning.

No estimator that sees the samples up to t, and knows the priors, has a smaller rms error. The model is linearised along
the true motion with u held fixed, so the bound is the covariance of the loop's own filter where it is told the truth
(Tichavsky, Muravchik, Nehorai 1998, for a state without noise but for the random walk of the rate).
"""

import ctypes
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import numpy.typing as npt

from cosim.core.library import HEALTH_NAMES, Library, library, pointer
from cosim.core.settings import FILTER
from cosim.design import Design
from cosim.layout import PARAMETER_NAMES
from cosim.running import filter_drift, start_filter
from cosim.setting import defaults

Array = npt.NDArray[np.float64]

OMEGA_WALK: Final = 10.0
"""Prior of the bound: the rate is a random walk of this size [rad/s per sqrt(s)]."""


@dataclass(frozen=True)
class Motion:
    """The true motion, one row a sample: the samples are taken at t = k * period [s].

    states f8[n, 4] = x, x', y, y' [m, m/s]; forces f8[n, 2] [N], row k commanded from t_k on; omega_z f8[n] [rad/s],
    held from t_k; measured f8[n, 4]: temperature [K], a_x, a_y [m/s^2], v_bias [V]."""

    states: Array
    forces: Array
    omega_z: Array
    measured: Array
    period: float

    def part(self, begin: int, end: int) -> "Motion":
        """The samples begin .. end - 1."""
        s = slice(begin, end)
        return Motion(self.states[s], self.forces[s], self.omega_z[s], self.measured[s], self.period)


@dataclass(frozen=True)
class Bound:
    """Standard deviations at times ``t`` [s], shape (n,): of the ``names``, SI, shape (n, len(names)); of the rate
    [rad/s], shape (n,); of the pattern's turning at its worst angle [rad/s], shape (n,)."""

    t: Array
    names: tuple[str, ...]
    values: Array
    omega: Array
    drift: Array


def bound(
    motion: Motion, design: Design, times: Array, omega_walk: float = OMEGA_WALK, stiffness: float | None = None
) -> Bound:
    """The bound at ``times`` [s], rising, for a device that is as ``design.values`` say, known beforehand within
    ``design.deviations``, and made an isotropic oscillator of ``stiffness`` [N/m], by default the design's.

    Raises ValueError for a time that the motion does not reach.
    """
    index = np.rint(np.asarray(times) / motion.period).astype(np.int64)
    if index.size and (index.min() < 0 or index.max() >= len(motion.states)):
        last = (len(motion.states) - 1) * motion.period
        raise ValueError(f"times = {times} s: choose times from 0 to {last} s, where the motion ends")
    growing = GrowingBound(design, motion.period, omega_walk, stiffness)
    names = growing.names
    values, omega, drift = np.empty((len(index), len(names))), np.empty(len(index)), np.empty(len(index))
    begin = 0
    for row, end in enumerate(index + 1):
        growing.extend(motion.part(begin, int(end)))
        begin = int(end)
        values[row], omega[row], drift[row] = growing.deviations()
    return Bound(np.asarray(times, dtype=float), names, values, omega, drift)


class GrowingBound:
    """The bound along a motion that comes in parts, so that a long one need not be kept."""

    def __init__(
        self, design: Design, period: float, omega_walk: float = OMEGA_WALK, stiffness: float | None = None
    ) -> None:
        self._design, self.stiffness = design, design.stiffness if stiffness is None else stiffness
        self._lib = library(design.known_model)
        self._memory = self._lib.memory("filter")
        # Nothing is filtered again where the truth is told: the start ends with its first block.
        walks = {
            "omega_walk_min": omega_walk,
            "omega_walk_max": omega_walk,
            "slope_walk_min": 0.0,
            "slope_walk_max": 0.0,
        }
        settings = np.array(list((defaults(FILTER) | walks).values()))
        start_filter(self._lib, design, period, settings, self._memory, slope_deviation=0.0)
        self.names = self._lib.known.value_names
        self._force = np.zeros(2)
        self._rate: float | None = None

    def extend(self, part: Motion) -> None:
        """Takes the next samples."""
        if not len(part.states):
            return
        count, states = len(part.states), self._lib.sizes["NS"]
        # What acted until a sample was commanded, and held, at the one before.
        u = np.vstack((self._force, part.forces[:-1]))
        z = np.zeros((count, states + 1))
        z[:, :4] = part.states
        z[:, states] = np.concatenate(([part.omega_z[0] if self._rate is None else self._rate], part.omega_z[:-1]))
        temperature = part.measured[:, :1]
        inputs = np.hstack((part.measured, temperature, temperature))
        told = map(np.ascontiguousarray, (u, z, inputs))
        self._lib.call.core_filter_told(pointer(self._memory), ctypes.c_int64(count), *(pointer(a) for a in told))
        self._force, self._rate = part.forces[-1].copy(), float(part.omega_z[-1])

    def deviations(self) -> tuple[Array, float, float]:
        """Of the ``names``, SI, of the rate [rad/s], and of the pattern's turning [rad/s], at the last sample."""
        return _deviations(self._lib, self._design, self._memory, self.stiffness)


def _deviations(lib: Library, design: Design, memory: Array, stiffness: float) -> tuple[Array, float, float]:
    count, size = lib.sizes["NP"], lib.moving_size
    p, root, health = np.zeros(count), np.zeros((count, count)), np.zeros(len(HEALTH_NAMES))
    lib.call.core_filter_found(pointer(memory), pointer(p), pointer(root), pointer(health))
    slopes, own = np.zeros((size, count)), np.zeros((size, size))
    lib.call.core_filter_slopes(pointer(memory), pointer(slopes), pointer(own))
    to_values = _to_values(p, design)
    rate = lib.sizes["NS"]
    omega = np.sqrt(own[rate, rate] + np.sum((slopes[rate] @ root) ** 2))
    drift = filter_drift(lib, memory, stiffness, 0.0)
    return np.sqrt(np.sum((to_values @ root) ** 2, axis=1)), float(omega), drift["turning"]


def _to_values(p: Array, design: Design) -> Array:
    """Derivative of the values by the filter's coordinates, shape (n, n): k = (k/m)/(1/m)."""
    mass = 1.0 / p[-1]
    others = len(PARAMETER_NAMES) - 1
    jacobian = np.zeros((len(p), len(p)))
    for i in range(others):
        jacobian[i, i] = mass
        jacobian[i, -1] = -mass * mass * p[i]
    jacobian[others, -1] = -mass * mass
    for i in range(len(PARAMETER_NAMES), len(p)):
        jacobian[i, i - 1] = 1.0
    return jacobian


def at_the_truth(design: Design, true: dict[str, float]) -> Design:
    """The design with the true values in place of first estimates and known ones, and its own deviations: what the
    bound is taken with."""
    values = {name: true.get(name, value) for name, value in design.values.items()}
    return replace(design, values=values)
