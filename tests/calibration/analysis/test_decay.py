"""Modes of made-up decays come back."""

import numpy as np
import pytest

from calibration.analysis.decay import modes

INTERVAL = 1e-3


def decays(rng: np.random.Generator, noise: float, *poles: tuple[float, float, complex]) -> np.ndarray:
    """Two channels of modes (frequency [Hz], decay [1/s], amplitude), the second with the conjugate amplitudes."""
    t = INTERVAL * np.arange(3000)
    waves = [np.exp((2j * np.pi * f - decay) * t) for f, decay, _ in poles]
    sizes = np.array([a for *_, a in poles])
    own = np.stack([sizes @ waves, sizes.conj() @ waves])
    return own + noise * (rng.standard_normal(own.shape) + 1j * rng.standard_normal(own.shape))


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_two_modes_come_back_beside_noise(seed: int) -> None:
    rng = np.random.default_rng(seed)
    first, second = (-20.0, 3.0, 1.0 + 0.5j), (31.0, 20.0, 0.7j)
    found = sorted(modes(decays(rng, 1e-4, first, second), INTERVAL, 4)[:2], key=lambda mode: mode.frequency)
    for mode, (frequency, decay, _) in zip(found, (first, second), strict=True):
        # Noise of 1e-4 over amplitude and some hundred samples of a decay: 1e-4/sqrt(100) of 1/(decay time).
        assert mode.frequency == pytest.approx(frequency, abs=1e-3)
        assert mode.decay == pytest.approx(decay, rel=1e-3)


def test_the_strongest_comes_first_and_shares_add_up() -> None:
    records = decays(np.random.default_rng(1), 0.0, (5.0, 2.0, 0.1), (-40.0, 2.0, 1.0))
    found = modes(records, INTERVAL, 2)
    assert found[0].frequency == pytest.approx(-40.0, abs=1e-6)
    # The energy is that of each mode alone: amplitude squared, by 1 to 0.01.
    assert found[0].energy == pytest.approx(1 / 1.01, rel=1e-3)
