"""Sizes of noises with their intervals, from noises shaped in the frequency domain."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from discrepancy.fit.noise import flicker
from discrepancy.fit.whitening import Setting

PERIOD, SAMPLES, WHITE = 5e-6, 8000, 2e-5


def residuals(rng: np.random.Generator, a: float) -> list[np.ndarray]:
    """Two runs of white noise and flicker of one-sided density a²/f: pieces of a second."""
    n = round(1 / PERIOD)
    f = np.fft.rfftfreq(n, PERIOD)
    density = np.divide(a**2, f, out=np.zeros_like(f), where=f >= 1)
    shaped = np.fft.rfft(rng.standard_normal((n, 2)), axis=0) * np.sqrt(density / (2 * PERIOD))[:, None]
    wander = np.fft.irfft(shaped, n, axis=0)
    return [wander[k : k + SAMPLES] + WHITE * rng.standard_normal((SAMPLES, 2)) for k in (0, n // 2)]


# Equal to the white noise at 2.5 kHz, at 160 kHz, and nowhere below half the sample rate, where alone it counts.
@pytest.mark.parametrize("a", [3.2e-6, 2.5e-5, 1e-4])
def test_size_of_flicker(a: float) -> None:
    rng, deviations = np.random.default_rng(5), []
    for _ in range(6):
        at: Any = SimpleNamespace(parameters={}, residuals=residuals(rng, a), whiten=SimpleNamespace(
            setting=Setting(corner=rng.uniform(0.6, 1.6) * a**2 / (2 * WHITE**2 * PERIOD))))  # fmt: skip
        runs: Any = [SimpleNamespace(valid=np.ones(SAMPLES, np.bool_), sample_rate=1 / PERIOD, axes=2)] * 2
        found = flicker(at, runs)
        assert found is not None
        deviations.append((found.value - a) / (found.high - found.low) * 2 * 1.96)
    # The mean of six estimates, in its standard deviations: 3.3 come by chance once in a thousand times.
    assert abs(np.mean(deviations)) * np.sqrt(6) < 3.3
    # Six normal numbers have a root mean square between 0.25 and 2 but in one of 250 cases.
    assert 0.25 < np.sqrt(np.mean(np.square(deviations))) < 2
