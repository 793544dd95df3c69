"""Flicker noise against 1/f, by formula and by the spectrum of what the FMU gives."""

from collections.abc import Callable

import numpy as np
import pytest
from gyro_runner import Runner
from philox_oracle import PINK_TAPS, pink, pink_sections
from scipy.signal import welch

Residual = Callable[[str, float, float], None]

OUTPUTS = ("v_x", "v_y")
# At rest any internal step will do; 1 kHz reaches low frequencies with few samples.
SLOW = {"internal_step": 1e-3, "sample_period": 1e-3}
RATE, N = 1000.0, 2**18


def record(plant: Runner, seed: int, a: float = 1.0) -> np.ndarray:
    out = plant.run({**SLOW, "flicker_noise": a, "seed": seed}, np.arange(N) * 1e-3, outputs=OUTPUTS)
    return np.stack([out[name] for name in OUTPUTS])


@pytest.mark.parametrize("period", [1e-3, 2e-5, 5e-6])
def test_recursion(plant: Runner, period: float, residual: Residual) -> None:
    own = {"internal_step": period, "sample_period": period, "flicker_noise": 1.0, "seed": 3}
    out = plant.run(own, np.arange(5000) * period, outputs=OUTPUTS)
    wanted = pink(3, "flicker_noise", 5000, period)
    # The oracle takes 1 - pole², 5e-6 at least, by subtraction: 1e-16/5e-6 of the largest numbers, 10 √Hz.
    residual("noise", max(np.max(np.abs(out[name] - wanted[:, i])) for i, name in enumerate(OUTPUTS)), 1e-10)


@pytest.mark.parametrize("rate", [1e2, 1e3, 1e4, 2e5, 1e6, 1e9])
def test_density_of_the_design(rate: float, residual: Residual) -> None:
    corners, variances = pink_sections(1 / rate)
    f = np.geomspace(1.0, rate / 2, 3000)
    z = np.exp(-2j * np.pi * f / rate)
    poles = np.exp(-2 * np.pi * corners / rate)[:, None]
    sections = -np.expm1(-4 * np.pi * corners / rate)[:, None] / np.abs(1 - poles * z) ** 2
    density = 2 / rate * (variances @ sections) * np.abs(np.polyval(PINK_TAPS[::-1], z)) ** 2
    # What fmu_src/pink.h promises.
    residual("to half the rate", np.max(np.abs(density * f - 1)), 0.035)
    low = f < rate / 100
    if low.any():
        residual("below a hundredth of it", np.max(np.abs(density * f - 1)[low]), 0.015)
    # Below the band it levels off, with the power of 1/f down to 0.025 Hz at most: the lowest corner c is 0.0646 Hz or
    # more, and the variances sum to ln(rate/2) + ln(0.692/c) + 1.535 (0.582 - 1 + 1.275).
    assert variances.sum() < np.log(rate / 2 / 0.025)


def test_spectrum(plant: Runner, residual: Residual) -> None:
    a, segment = 3e-4, 2**13
    v = record(plant, 12, a)
    f, density = welch(v, RATE, nperseg=segment)
    density = density.mean(axis=0)
    for low in 2.0 ** np.arange(0, 9):
        band = (f >= low) & (f < min(2 * low, 490.0))
        # Hann segments that overlap by half: (1 + 2/36)/63 of the square a segment (P. D. Welch, 1967), neighbouring
        # bins correlate (1 + 2·4/9 + 2/36); two axes; five standard errors beside what the design may be off.
        deviation = np.sqrt(1.056 / (2 * N / segment - 1) * 1.944 / band.sum() / 2)
        residual(f"{low:g} Hz", abs(np.mean(density[band] * f[band]) / a**2 - 1), 0.035 + 5 * deviation)


def test_it_is_stationary_from_the_first_sample(residual: Residual) -> None:
    # Over seeds; the recursion above shows that the FMU gives these numbers.
    first = np.concatenate([pink(seed, "flicker_noise", 1, 5e-6)[0] for seed in range(1000)])
    corners, variances = pink_sections(5e-6)
    lags = np.exp(-2 * np.pi * corners * 5e-6)
    by_lag = [variances.sum(), variances @ lags, variances @ lags**2]
    wanted = sum(PINK_TAPS[i] * PINK_TAPS[j] * by_lag[abs(i - j)] for i in range(3) for j in range(3))
    # Five standard errors, √(2/n).
    residual("variance", abs(np.mean(first**2) / wanted - 1), 5 * np.sqrt(2 / len(first)))


def test_axes_and_seeds_are_independent(plant: Runner, residual: Residual) -> None:
    # Differences are nearly white, so that a correlation of n numbers has the standard error 1/√n; five of them, and
    # half again for what is not white.
    white = np.concatenate([np.diff(record(plant, seed)) for seed in (5, 6)])
    correlation = np.corrcoef(white) - np.eye(4)
    residual("correlation", np.max(np.abs(correlation)), 1.5 * 5 / np.sqrt(N))


def test_a_sample_is_the_same_however_the_steps_fall(plant: Runner) -> None:
    t = np.arange(1001) * 1e-6
    own = {"flicker_noise": 1.0, "x_start": 1e-6}
    short, long = plant.run(own, t), plant.run(own, t[::50])
    assert np.array_equal(short["v_x"][::50], long["v_x"])
