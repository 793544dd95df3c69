"""Noise of the envelope form: the densities that the full device has around the carrier."""

from collections.abc import Callable, Mapping
from math import pi

import numpy as np
import pytest
from envelope_device import LOSSLESS, W_X, Complexes, answer, envelopes, matrices, rate_device, start_at
from gyro_runner import Runner
from scipy.signal import welch

Residual = Callable[[str, float, float], None]
NO_FORCE = np.zeros(2, complex)
BOLTZMANN, T = 1.380649e-23, 298.15


@pytest.mark.parametrize("step", [1e-3, 2e-2])
def test_equipartition_at_any_step(envelope: Runner, residual: Residual, step: float) -> None:
    # <q qᵀ> = kB T K⁻¹, and an amplitude has twice the square of its signal. 20 ms is a whole turn of the y mode.
    p = rate_device(200.0, dxy=1e-6, thermal_force=1.0, internal_step=step, seed=3)
    n = round(4000 * 5e-3 / step) if step < 5e-3 else 40000
    z = envelopes(envelope, p, np.arange(100 + n) * step, NO_FORCE)[100:, 2:]
    covariance = (z[:, :, None] * z[:, None, :].conj()).mean(axis=0)
    wanted = 2 * BOLTZMANN * T * np.linalg.inv(matrices(p)[2])
    # An exponential variable a correlation time: squares fade with the decay of 2 · 47 /s.
    independent = n * np.tanh(0.5 * step * W_X / 200.0)
    size = np.sqrt(np.outer(np.diag(wanted), np.diag(wanted)))
    residual("covariance, in deviations", np.max(np.abs(covariance - wanted) / size) * np.sqrt(independent), 4.0)


def test_spectrum_of_the_thermal_hump(envelope: Runner, residual: Residual) -> None:
    q, step = 1000.0, 2e-3
    p = rate_device(q, kxy=0.0, thermal_force=1.0, internal_step=step, seed=4)
    z = envelopes(envelope, p, np.arange(60000) * step, NO_FORCE, 3040.0)[:, 3]
    f, density = welch(z, 1 / step, nperseg=2000, return_onesided=False)
    band = np.abs(f - 10.0) < 30.0
    # Two-sided 2 kB T D of the force is four times that on an amplitude.
    response = np.array([answer(p, 3040.0 + offset, np.array([0.0, 1.0]))[1] for offset in f[band]])
    ratio = density[band] / (4 * 2 * BOLTZMANN * T * p["dyy"] * np.abs(response) ** 2)
    # 60 segments, half overlapped, of 120 bins within 30 Hz, neighbours correlated by the window.
    residual("whole hump", abs(ratio.mean() - 1), 5 / np.sqrt(60 * 120 / 2))
    # A window of 0.25 Hz smears a line of 3 Hz by (0.25/3)² or so.
    near = np.abs(f[band] - 10.0) < 2.0
    residual("its top", abs(ratio[near].mean() - 1), 5 / np.sqrt(60 * 8 / 2))


def quadrature_noise(envelope: Runner, noise: Mapping[str, float], amplitude: float, n: int) -> Complexes:
    """Noise [V] of the amplitude of v_x on a lossless motion of x."""
    p = LOSSLESS | start_at(amplitude + 0j, 0j) | {"seed": 5}
    t = np.arange(n) * 1e-3
    return envelopes(envelope, p | dict(noise), t, NO_FORCE)[:, 0] - envelopes(envelope, p, t, NO_FORCE)[:, 0]


def full_noise(plant: Runner, noise: Mapping[str, float], amplitude: float, n: int) -> Complexes:
    """The same by the full FMU: demodulated, a mean over each millisecond."""
    period = 5e-6
    p = LOSSLESS | {"x_start": amplitude, "seed": 6, "internal_step": period}
    t = np.arange(200 * n) * period
    # Rounding errors must not repeat with the carrier: its frequency is no round number here.
    p["kxx"] *= (1 + 0.01 / np.e) ** 2
    noisy, quiet = plant.run(p | dict(noise), t, outputs=("v_x",))["v_x"], plant.run(p, t, outputs=("v_x",))["v_x"]
    wave = np.exp(-1j * W_X * (1 + 0.01 / np.e) * t)
    return (2 * (noisy - quiet) * wave).reshape(n, 200).mean(axis=1)


SIGMA, JITTER, LSB, FLICKER, AMPLITUDE = 3e-5, 2e-9, 2e-4, 1e-5, 5e-6
SLOPE = W_X * AMPLITUDE * 1e6 * JITTER
# Variance a sample times (cos part, sin part): of white noise 2 and 2; of jitter, which lives on the slope, sin²: the
# means of 4 sin² cos² and 4 sin⁴.
NOISES = {
    "sense_noise": ({"sense_noise": SIGMA}, SIGMA**2, (2.0, 2.0)),
    "sampling_jitter": ({"sampling_jitter": JITTER}, SLOPE**2, (0.5, 1.5)),
    # One-sided a²/f as white noise of the same density at the carrier: variance · 2 · 5 µs.
    "flicker_noise": ({"flicker_noise": FLICKER}, FLICKER**2 / 3000.0 / 1e-5, (2.0, 2.0)),
    "adc_quantisation": ({"adc_lsb": LSB}, LSB**2 / 12, (2.0, 2.0)),
}


@pytest.mark.parametrize("name", NOISES)
def test_noise_of_the_sample(name: str, envelope: Runner, plant: Runner, residual: Residual) -> None:
    noise, variance, parts = NOISES[name]
    for form, z in {
        "envelope": quadrature_noise(envelope, noise, AMPLITUDE, 20000)[1:],
        "full": full_noise(plant, noise, AMPLITUDE, 600),
    }.items():
        for part, values in zip(parts, (z.real, z.imag), strict=True):
            # 200 samples in a millisecond; a variance estimated from n normal numbers is √(2/n) off.
            ratio = np.var(values) / (variance * part / 200)
            residual(f"{form}, {part}, in deviations", abs(ratio - 1) / np.sqrt(2 / len(z)), 4.0)
        residual(f"{form}, correlation of the parts", abs(np.corrcoef(z.real, z.imag)[0, 1]) * np.sqrt(len(z)), 4.0)
        residual(f"{form}, with the next", abs(np.corrcoef(z.real[1:], z.real[:-1])[0, 1]) * np.sqrt(len(z)), 4.0)


def test_both_axes_and_other_seeds_are_independent(envelope: Runner, residual: Residual) -> None:
    t = np.arange(5000) * 1e-3
    p = rate_device(1000.0, sense_noise=1e-4)
    one, other = (envelopes(envelope, p | {"seed": seed}, t, NO_FORCE)[:, :2] for seed in (1, 2))
    parts = np.concatenate((one.real.T, one.imag.T, other.real.T, other.imag.T))
    off = np.corrcoef(parts) - np.eye(len(parts))
    residual("correlation", np.max(np.abs(off)) * np.sqrt(len(t)), 4.5)


def test_thermal_motion_against_the_full_plant(envelope: Runner, plant: Runner, residual: Residual) -> None:
    # A low Q, so that a second holds a hundred correlation times.
    q, period, seconds = 20.0, 5e-6, 1.0
    p = rate_device(q, kxy=0.0, thermal_force=1.0, seed=8)
    t = np.arange(round(seconds / period)) * period
    x = plant.run(p | {"internal_step": period}, t, outputs=("x",))["x"]
    n = 20000
    z = envelopes(envelope, p | {"internal_step": 1e-3}, np.arange(n) * 1e-3, NO_FORCE)[50:, 2]
    wanted = BOLTZMANN * T / p["kxx"]
    independent = seconds * W_X / q / 2
    residual("full", abs(np.var(x) / wanted - 1) * np.sqrt(independent), 4.0)
    residual("envelope", abs(np.mean(np.abs(z) ** 2) / 2 / wanted - 1) * np.sqrt(n * 1e-3 * W_X / q / 2), 4.0)
    assert pi * 3000.0 / q > 400, "correlation time of 2 ms"
