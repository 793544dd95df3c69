"""Sampling jitter against the derivative of a known motion."""

from collections.abc import Callable

import numpy as np
import pytest
from gyro_runner import Runner
from philox_oracle import normals

from gyro_model.errors import InputError
from gyro_model.model import EFFECTS_FOLDER, load_model

Residual = Callable[[str, float, float], None]

N, PERIOD, SEED, SIGMA = 20_001, 5e-6, 9, 2e-9
T = np.arange(N) * PERIOD
W, M = 2 * np.pi * 3000.0, 1.8e-7
# Undamped and uncoupled: x = A cos ωt, y = -A/2 cos ωt, a volt and half a volt.
FREE = {"kxx": M * W**2, "kyy": M * W**2, "kxy": 0.0, "dxx": 0.0, "dyy": 0.0, "dxy": 0.0}
FREE |= {"x_start": 1e-6, "y_start": -0.5e-6, "seed": SEED}
DRAWN = normals(SEED, "sampling_jitter", np.arange(N))


def noise(plant: Runner, **own: float) -> np.ndarray:
    """What jitter adds to the voltages, shape (n, 2)."""
    with_it, without = (
        plant.run(FREE | own | jitter, T, outputs=("v_x", "v_y")) for jitter in ({"sampling_jitter": SIGMA}, {})
    )
    return np.stack([with_it[name] - without[name] for name in ("v_x", "v_y")], axis=1)


def test_it_is_the_rate_times_the_error_of_time(plant: Runner, residual: Residual) -> None:
    found = noise(plant)
    wanted = -W * np.sin(W * T)[:, None] * np.array([1.0, -0.5]) * SIGMA * DRAWN
    # The difference of two voltages of 1 V rounds 2e-16 V; after 0.1 s the phase of the motion is good to 1e-10.
    residual("noise [V]", np.max(np.abs(found - wanted)), 1e-15 + 1e-10 * W * SIGMA * np.max(np.abs(DRAWN)))


def test_its_size_on_a_sine(plant: Runner, residual: Residual) -> None:
    # A ω σ/√2 rms; five standard errors, √(κ-1)/2√n with κ = 3 · 3/2 for a normal number on a sine.
    rms = np.std(noise(plant), axis=0) / (W * SIGMA / np.sqrt(2) * np.array([1.0, 0.5]))
    residual("rms", np.max(np.abs(rms - 1.0)), 5 * np.sqrt(3.5 / (4 * N)))


@pytest.mark.parametrize("tau", [1e-8, 2e-6, 5e-5])
def test_behind_the_amplifier(plant: Runner, tau: float, residual: Residual) -> None:
    # v = Re[e^{iωt}/(1 + iωτ)] + what is left of the start, and its derivative; a drift adds its own rate.
    found = noise(plant, amplifier_time_constant=tau, offset_drift=3e3)[:, 0]
    steady = 1 / (1 + 1j * W * tau)
    rate = (1j * W * np.exp(1j * W * T) * steady).real - (1 - steady.real) * np.exp(-T / tau) / tau + 3e3
    # The lag is good to 1.5e-11 V (test_amplifier_lag), a rate of that over τ; voltages of up to 300 V round 6e-14 V.
    scale = SIGMA * np.max(np.abs(DRAWN))
    limit = 1.5e-11 / tau * scale + 6e-14 + 1e-10 * W * scale
    residual("noise [V]", np.max(np.abs(found - rate * SIGMA * DRAWN[:, 0])), limit)


def test_still_voltage_has_none(plant: Runner) -> None:
    still = FREE | {"x_start": 0.0, "y_start": 0.0, "offset_x": 1.0, "sampling_jitter": SIGMA}
    out = plant.run(still, T[:100], outputs=("v_x", "v_y"))
    assert np.all(out["v_x"] == 1.0) and np.all(out["v_y"] == 0.0)


def test_only_the_converter_sees_the_rate(tmp_path) -> None:
    text = (EFFECTS_FOLDER / "sampling_jitter.py").read_text(encoding="utf-8")
    text = text.replace("sampled noise", "amplifier offset").replace("sampling_jitter", "early")
    (tmp_path / "early.py").write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match="effect early: symbol 'v_x_rate' is unknown"):
        load_model(tmp_path)
