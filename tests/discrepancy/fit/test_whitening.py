"""Whitening of noises made by another program's recursion: innovations are white, and the level comes back."""

import numpy as np
import pytest
from scipy.linalg import expm

from discrepancy.fit.whitening import Setting, _flicker, likeliest, misfit_under, whitener

PERIOD, SAMPLES = 5e-6, 12_000
DEVICE = {"m": 1.8e-7, "kxx": 63.955, "kyy": 95.92, "kxy": 12.779, "dxx": 1.8e-6, "dyy": 1.8e-6, "dxy": 3.6e-7,
          "sense_gain_x": 1e6, "sense_gain_y": 1e6}  # fmt: skip
VALID = np.ones(SAMPLES, np.bool_)


def shaken(rng: np.random.Generator) -> np.ndarray:
    """V of the reference device under a white force 3 times the thermal one at room temperature, from rest."""
    k = np.array([[63.955, 12.779], [12.779, 95.92]]) / 1.8e-7
    d = np.array([[1.8e-6, 3.6e-7], [3.6e-7, 1.8e-6]]) / 1.8e-7
    step = expm(np.block([[np.zeros((2, 2)), np.eye(2)], [-k, -d]]) * PERIOD)
    impulse = 3 * np.sqrt(2 * 1.380649e-23 * 298.15 * PERIOD) / 1.8e-7 * np.linalg.cholesky(d * 1.8e-7)
    state, v = np.zeros(4), np.empty((SAMPLES, 2))
    for row in v:
        row[:] = 1e6 * state[:2]
        state = step @ state
        state[2:] += impulse @ rng.standard_normal(2)
    return v


def flicker(rng: np.random.Generator, a: float) -> np.ndarray:
    """One-sided density a²/f, shaped in the frequency domain of a record sixteen times as long."""
    n = 16 * SAMPLES
    f = np.fft.rfftfreq(n, PERIOD)
    density = np.divide(a**2, f, out=np.zeros_like(f), where=f >= 1)
    spectrum = np.fft.rfft(rng.standard_normal((n, 2)), axis=0) * np.sqrt(density / (2 * PERIOD))[:, None]
    return np.fft.irfft(spectrum, n, axis=0)[:SAMPLES]


def correlation(innovations: np.ndarray) -> float:
    """The largest of the first 50 autocorrelations, in their standard deviations."""
    e = innovations[0] / innovations[0].std(axis=0)
    return max(float(np.abs(np.mean(e[k:] * e[:-k], axis=0)).max()) * np.sqrt(SAMPLES) for k in range(1, 51))


@pytest.mark.parametrize("kind", ["white", "thermal", "flicker"])
def test_innovations_are_white(kind: str) -> None:
    rng = np.random.default_rng(3)
    white = 2e-5 * rng.standard_normal((SAMPLES, 2))
    coloured = {"white": 0.0, "thermal": shaken(rng), "flicker": flicker(rng, 5e-6)}[kind]
    found = likeliest(DEVICE, PERIOD, [white + coloured], [VALID])
    assert (found.setting.bandwidth > 0) == (kind == "thermal")
    assert (found.setting.corner > 0) == (kind == "flicker")
    # The largest of 100 normal numbers is below 4.5 but once in a thousand times; the raw residual stands at 20 to 100.
    assert correlation(found((white + coloured)[None], VALID)) < 4.5
    if kind != "white":
        assert correlation((white + coloured)[None]) > 10


def test_nothing_to_take_out_is_the_identity() -> None:
    v = np.random.default_rng(1).standard_normal((SAMPLES, 2))
    cost, variance = misfit_under(DEVICE, PERIOD, Setting(), [v], [VALID])
    assert variance == pytest.approx(np.mean(v**2), rel=1e-12)  # rounding of a sum
    assert cost == pytest.approx(v.size * np.log(np.mean(v**2)), rel=1e-12, abs=1e-9)


@pytest.mark.parametrize("length", [4000, 8000, 14_000, 100_000])
def test_lags_have_the_density_of_flicker_up_to_half_the_sample_rate(length: int) -> None:
    # Where it exceeds the white noise everywhere, so that all of it counts.
    corner = 5 / PERIOD
    transition, drift, _, seen = _flicker(1, PERIOD, corner, length)
    f = np.linspace(1 / length, 0.5, 1000) / PERIOD
    turns = np.exp(-2j * np.pi * f * PERIOD)
    # In units of the white noise's variance, one-sided: 2 T Σ drift/|1 - pole/z|²; a²/f has a² = 2 T corner.
    density = 2 * PERIOD * np.sum(np.diag(drift) / np.abs(1 - np.outer(turns, np.diag(transition))) ** 2, axis=1)
    assert np.array_equal(seen, np.ones((1, len(transition))))
    off = density / (2 * PERIOD * corner / f) - 1
    # A sum of lags is flat at half the rate, where a²/f is not: 14 % there, 4 % rms; the mean is what a takes over.
    assert abs(off.mean()) < 0.005
    assert off.std() < 0.05


def test_the_filter_of_a_flicker_is_made_once() -> None:
    setting, other = Setting(0.0, 100.0), {**DEVICE, "kxx": 64.0}
    assert whitener(DEVICE, 2, PERIOD, setting, SAMPLES) is whitener(other, 2, PERIOD, setting, SAMPLES)
    moving = Setting(30.0, 100.0)
    assert whitener(DEVICE, 2, PERIOD, moving, SAMPLES) is not whitener(other, 2, PERIOD, moving, SAMPLES)


@pytest.mark.parametrize("setting", [Setting(300.0, 0.0), Setting(0.0, 40.0), Setting(300.0, 40.0)])
def test_columns_are_filtered_side_by_side_as_each_alone(setting: Setting) -> None:
    rng = np.random.default_rng(1)
    v, valid = rng.normal(size=(37, 200, 2)), rng.random(200) > 0.1
    filtered = whitener(DEVICE, 2, PERIOD, setting, 200)
    np.testing.assert_array_equal(filtered(v, valid), np.concatenate([filtered(own[None], valid) for own in v]))
