"""What no model explains: the noises, drawn by seed."""

import math
from typing import Final, NamedTuple

import numpy as np

from benchmarks.blind.difficulties import WHITE, Difficulty
from benchmarks.blind.physics import Floats, Plant, Run, clipped, simulate

BOLTZMANN: Final = 1.380649e-23


class Noise(NamedTuple):
    """white [V rms a sample], lsb [V], flicker [V/√Hz at 1 Hz], jitter [s rms], thermal: force noise on."""

    white: float = WHITE
    lsb: float = 0.0
    flicker: float = 0.0
    jitter: float = 0.0
    thermal: bool = False


def measured(
    rng: np.random.Generator, plant: Plant, run: Run, noise: Noise, difficulty: Difficulty | None = None
) -> Floats:
    """What the lab records of ``run``, (n, 2) [V]: noises, then the converter's limits, then its steps."""
    if noise.thermal:
        run = run._replace(u=run.u + thermal_force(rng, plant, run))
    v = clean(plant, run, difficulty)
    slope = np.gradient(v, 1 / run.rate, axis=0)
    v = v + noise.white * rng.standard_normal(v.shape) + noise.jitter * slope * rng.standard_normal(v.shape)
    if noise.flicker:
        v = v + np.stack([flicker(rng, len(v), run.rate, noise.flicker) for _ in range(2)], axis=1)
    if difficulty and difficulty.marks:
        v = difficulty.marks(rng, v, run)
    v = clipped(v, plant)
    return np.round(v / noise.lsb) * noise.lsb if noise.lsb else v


def clean(plant: Plant, run: Run, difficulty: Difficulty | None = None) -> Floats:
    """The voltage of ``run`` before noise, (n, 2) [V]."""
    return difficulty.acts(plant, run) if difficulty and difficulty.acts else simulate(plant, run).v


def thermal_force(rng: np.random.Generator, plant: Plant, run: Run) -> Floats:
    """Force (n, 2) [N] of one-sided density 4 k_B T D, held over a sample: its variance is that times rate/2. It takes
    the way of u, so it is for devices whose actuators are ideal."""
    root = np.linalg.cholesky(np.array([[plant.dxx, plant.dxy], [plant.dxy, plant.dyy]]))
    scale = np.sqrt(2 * BOLTZMANN * run.temperature * run.rate)
    force: Floats = scale[:, None] * (rng.standard_normal(run.u.shape) @ root.T)
    return force


def flicker(rng: np.random.Generator, n: int, rate: float, a: float) -> Floats:
    """N samples of one-sided density a²/f from 1 Hz to rate/2: a piece of a record of a second or more."""
    length = max(n, math.ceil(rate))
    f = np.fft.rfftfreq(length, 1 / rate)
    density = np.zeros_like(f)
    density[f >= 1] = a**2 / f[f >= 1]
    phase = rng.standard_normal(len(f)) + 1j * rng.standard_normal(len(f))
    # irfft divides by the length: a bin of one-sided density S has E|X|² = S rate length / 2.
    spectrum = np.sqrt(density * rate * length / 4) * phase
    first = rng.integers(0, length - n + 1)
    piece: Floats = np.fft.irfft(spectrum, length)[first : first + n]
    return piece


def sigma(noise: Noise) -> float:
    """The white part [V rms a sample], rounding included, that sets the detectable size."""
    return math.sqrt(noise.white**2 + noise.lsb**2 / 12)
