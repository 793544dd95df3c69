"""Records of masses, springs and dampers that swing together, propagated exactly between samples: no line of it is the
FMU's."""

import numpy as np
from scipy.linalg import expm

from discrepancy.data.record import Floats, Record, make_record

RATE, SAMPLES = 500.0, 6000
DAMPING = 5.0
"""Of each mass against the ground, over the mass [1/s]."""


class Structure:
    """masses (n,) [kg] and stiffness (n, n) [N/m]; forces act on the masses ``driven``, sensors of 1 V/m are at those
    ``sensed``."""

    def __init__(self, masses: Floats, stiffness: Floats, driven: list[int], sensed: list[int]) -> None:
        self.masses, self.stiffness, self.driven, self.sensed = masses, stiffness, driven, sensed

    def frequencies(self, held: list[int]) -> Floats:
        """Of the structure [Hz], masses ``held``."""
        free = [i for i in range(len(self.masses)) if i not in held]
        scaled = self.stiffness[np.ix_(free, free)] / np.sqrt(np.outer(self.masses[free], self.masses[free]))
        # That of what nothing holds is zero, but for its rounding.
        return np.asarray(np.sqrt(np.maximum(np.linalg.eigvalsh(scaled), 0.0)) / (2 * np.pi))

    def record(
        self, name: str, role: str, seed: int, noise: float, begin: int = 0, *, released: bool = False,
        accelerations: bool = False,
    ) -> Record:  # fmt: skip
        """A run from rest under a multisine of its own, from the sample ``begin`` on, at which the force ends where the
        structure is ``released``; noise over the motion, rms; accelerations: of these just before the force changes, by
        sensors of 1 V s²/m."""
        rng, n, axes = np.random.default_rng(seed), len(self.masses), len(self.driven)
        own = np.block([[np.zeros((n, n)), np.eye(n)],
                        [-self.stiffness / self.masses[:, None], -DAMPING * np.eye(n)]])  # fmt: skip
        pushed = np.zeros((2 * n, axes))
        pushed[[n + i for i in self.driven], range(axes)] = 1 / self.masses[self.driven]
        joined = np.block([[own, pushed], [np.zeros((axes, 2 * n + axes))]])
        step = expm(joined / RATE)[: 2 * n]
        count = SAMPLES + begin
        t = np.arange(count) / RATE
        lines = 2 * np.pi * np.arange(5.0, 90.0, 0.67)
        phase = rng.uniform(0, 2 * np.pi, (axes, len(lines)))
        u = 5.0 * np.stack([np.sin(lines * t[:, None] + own).sum(axis=1) for own in phase], axis=1)
        if released:
            u[begin:] = 0.0
        state, v = np.zeros(2 * n), np.empty((count, axes))
        for i in range(count):
            rates = own @ state + pushed @ u[max(i - 1, 0)]
            v[i] = rates[n:][self.sensed] if accelerations else state[self.sensed]
            state = step @ np.concatenate((state, u[i]))
        v += noise * v.std(axis=0) * rng.standard_normal(v.shape)
        t, u, v = (a[begin:].squeeze() for a in (t - t[begin], u, v))
        senses = "acceleration" if accelerations else "position"
        return make_record(name, t, u, v, role=role, sample_rate=RATE, senses=senses)


def chain(driven: int = 0, sensed: int = 0) -> Structure:
    """Three masses one behind the other, the first on the ground."""
    k = [4e4, 3e4, 5e4]
    stiffness = np.array([[k[0] + k[1], -k[1], 0], [-k[1], k[1] + k[2], -k[2]], [0, -k[2], k[2]]])
    return Structure(np.array([1.0, 0.8, 1.2]), stiffness, [driven], [sensed])


def drive(driven: int = 0, sensed: int = 0) -> Structure:
    """A shaft that drives two masses one behind the other, which nothing holds."""
    k = [3e4, 5e4]
    stiffness = np.array([[k[0], -k[0], 0], [-k[0], k[0] + k[1], -k[1]], [0, -k[1], k[1]]])
    return Structure(np.array([1.0, 0.8, 1.2]), stiffness, [driven], [sensed])


def plane() -> Structure:
    """A mass that moves in a plane, with a resonator on each axis."""
    stiffness = np.diag([4e4, 5e4, 0.0, 0.0])
    stiffness[0, 1] = stiffness[1, 0] = 1.5e3
    for axis, own, k in ((0, 2, 4.5e4), (1, 3, 8.3e4)):
        stiffness[[axis, own], [axis, own]] += k
        stiffness[[axis, own], [own, axis]] -= k
    return Structure(np.array([1.0, 1.0, 0.5, 0.5]), stiffness, [0, 1], [0, 1])
