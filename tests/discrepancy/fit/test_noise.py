"""Sizes of noises with their intervals, from noises shaped in the frequency domain."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from discrepancy.criteria import Criteria
from discrepancy.fit.noise import flicker, jitter, noise_of, unlike_flicker
from discrepancy.fit.whitening import Setting, likeliest, whitener

PERIOD, SAMPLES, WHITE = 5e-6, 8000, 2e-5
DEVICE = {"m": 1.8e-7, "kxx": 64.0, "kyy": 96.0, "kxy": 12.8, "dxx": 1.8e-6, "dyy": 1.8e-6, "dxy": 0.0,
          "sense_gain_x": 1e6, "sense_gain_y": 1e6}  # fmt: skip


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


def wandering(rng: np.random.Generator, kind: str) -> np.ndarray:
    """What is slow and no flicker, with the power of the white noise or more, (SAMPLES, 2) [V]."""
    t = np.arange(SAMPLES) * PERIOD
    if kind == "hum":
        return 1e-4 * np.sin(2 * np.pi * 70 * t[:, None] + rng.uniform(0, 6.28, 2))
    if kind == "walk":
        return 1e-4 * np.cumsum(rng.standard_normal((SAMPLES, 2)), axis=0) / SAMPLES**0.5
    bumps = np.hanning(SAMPLES // 10)
    wander = np.stack([np.convolve(rng.standard_normal(2 * SAMPLES), bumps, "valid")[:SAMPLES] for _ in range(2)], 1)
    return 5e-5 * wander / wander.std()


# What is strong is no less a flicker: 4e-4 V/√Hz are above the white noise at all frequencies that the runs have.
@pytest.mark.parametrize("kind", [3.2e-6, 2.5e-5, 1e-4, 4e-4, "hum", "walk", "wander"])
def test_flicker_is_told_by_its_spectrum(kind: float | str) -> None:
    rng, limits = np.random.default_rng(8), Criteria()
    made = [r + wandering(rng, kind) if isinstance(kind, str) else r
            for r in residuals(rng, 0.0 if isinstance(kind, str) else kind)]  # fmt: skip
    valid = np.ones(SAMPLES, np.bool_)
    at: Any = SimpleNamespace(parameters=DEVICE, residuals=made, whiten=likeliest(DEVICE, PERIOD, made, [valid] * 2))
    runs: Any = [SimpleNamespace(valid=valid, sample_rate=1 / PERIOD, axes=2)] * 2
    assert at.whiten.setting.corner > 0
    assert (unlike_flicker(at, runs, limits.noise_chance, limits.coloured) is not None) == isinstance(kind, str)


def test_what_flicker_and_colour_promise_and_the_residual_has_not_is_told() -> None:
    rng, limits = np.random.default_rng(8), Criteria()
    t = np.arange(SAMPLES) * PERIOD
    hum = [r + 2.3e-4 * np.sin(2 * np.pi * 60 * t[:, None] + rng.uniform(0, 6.28, 2)) for r in residuals(rng, 0.0)]
    # As they are fitted to hum in runs of 40 ms: an autoregression to some kilohertz, and flicker below its corner.
    colour = (0.178, 0.153, 0.164, 0.131, 0.115, 0.098, 0.082, 0.072)
    whiten = whitener(DEVICE, 2, PERIOD, Setting(corner=100.0, colour=colour), SAMPLES)
    at: Any = SimpleNamespace(parameters=DEVICE, residuals=hum, whiten=whiten)
    runs: Any = [SimpleNamespace(valid=np.ones(SAMPLES, np.bool_), sample_rate=1 / PERIOD, axes=2)] * 2
    found = unlike_flicker(at, runs, limits.noise_chance, limits.coloured)
    assert found is not None
    assert found[0] > 200
    assert found[1] < 0.1


def test_white_noise_that_grows_with_the_motion_counts_in_full() -> None:
    # As of a jittering clock behind a sweep that comes to its resonance at the end.
    noise = WHITE * np.linspace(0, 1, SAMPLES)[:, None] ** 2 * np.random.default_rng(3).standard_normal((SAMPLES, 2))
    run: Any = SimpleNamespace(valid=np.ones(SAMPLES, np.bool_), sample_rate=1 / PERIOD, axes=2, t=np.arange(SAMPLES),
                               v=noise)  # fmt: skip
    found = noise_of([noise], [run], DEVICE)
    assert found is not None
    # Half of the last sixteenth, the strongest, is not seen: 0.09 of the power.
    assert 0.95 * noise.std() < found.rms < 1.03 * noise.std()


def test_white_noise_beside_strong_flicker_is_that_of_the_sensor() -> None:
    made = residuals(np.random.default_rng(2), 1e-4)
    runs: Any = [SimpleNamespace(valid=np.ones(SAMPLES, np.bool_), sample_rate=1 / PERIOD, axes=2, t=np.arange(SAMPLES),
                                 v=r) for r in made]  # fmt: skip
    corner = 1e-4**2 / (2 * WHITE**2 * PERIOD)
    found = noise_of(made, runs, DEVICE, Setting(corner=corner))
    assert found is not None
    # Above 20 kHz there is up to 100 times as much flicker; the lags that stand for it are within 4 %.
    assert found.rms == pytest.approx(WHITE, rel=0.05)


def sweeps(rng: np.random.Generator, noise: np.ndarray, late: float) -> tuple[Any, list[Any]]:
    """Three runs of two axes, each as much larger than the one before, with so much white noise [V] in each channel
    and instants that are off by ``late`` [s]."""
    t = np.arange(SAMPLES) * PERIOD
    made, runs = [], []
    for size, own in zip((0.01, 0.1, 1.0), noise, strict=True):
        turns = 2 * np.pi * (3e3 * t + 2e4 * t**2)
        v = size * np.stack((np.sin(turns), 0.3 * np.cos(turns)), 1) * np.sin(np.pi * t[:, None] / t[-1])
        slope = np.gradient(v, PERIOD, axis=0)
        made.append(own * rng.standard_normal((SAMPLES, 2)) + late * slope * rng.standard_normal((SAMPLES, 1)))
        runs.append(SimpleNamespace(valid=np.ones(SAMPLES, np.bool_), sample_rate=1 / PERIOD, axes=2, v=v + made[-1]))
    at: Any = SimpleNamespace(parameters=DEVICE, residuals=made, whiten=whitener(DEVICE, 2, PERIOD, Setting(), SAMPLES))
    return at, runs


def test_channels_of_unlike_noise_are_no_jitter() -> None:
    # As a range that is switched makes: a thousandth of each channel's motion.
    noise = 1e-3 * np.outer((0.01, 0.1, 1.0), (0.5, 0.15))
    for seed in range(20):
        assert jitter(*sweeps(np.random.default_rng(seed), noise, 0.0)) is None


@pytest.mark.parametrize("share", [0.1, 1.0])
def test_jitter_beside_channels_of_unlike_noise(share: float) -> None:
    late = 5e-8
    noise = share * late * 2e4 * np.outer((0.01, 0.1, 1.0), (0.5, 0.15))
    for seed in range(5):
        found = jitter(*sweeps(np.random.default_rng(seed), noise, late))
        assert found is not None
        # Five 95 % intervals, doubled: one in 5,000 of normal numbers is beyond.
        assert abs(found.value - late) < found.high - found.low
