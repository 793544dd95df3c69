"""Decimation in pieces: what it keeps, what it keeps out, and that the pieces do not show."""

from itertools import pairwise

import numpy as np
import pytest

from cosim.decimation import FLAT, Decimator


def tone(frequency: float, count: int) -> np.ndarray:
    """Of unit amplitude, ``frequency`` in turns a sample."""
    return np.exp(2j * np.pi * frequency * np.arange(count))


@pytest.mark.parametrize("factor", [2, 5, 40])
def test_band_is_flat_in_amplitude_and_phase(factor: int) -> None:
    decimator = Decimator(factor)
    frequency = 0.99 * FLAT / factor
    kept = decimator.feed(tone(frequency, 40 * decimator.taps))
    centres = decimator.taps // 2 + factor * np.arange(len(kept))
    # A Kaiser window of 120 dB has a ripple of 1e-6.
    np.testing.assert_allclose(kept, np.exp(2j * np.pi * frequency * centres), atol=2e-6)


@pytest.mark.parametrize("factor", [2, 5, 40])
def test_what_would_fold_into_the_band_is_kept_out(factor: int) -> None:
    decimator = Decimator(factor)
    # Folds to -FLAT of the new rate.
    kept = decimator.feed(tone((1 - 0.99 * FLAT) / factor, 40 * decimator.taps))
    # 120 dB.
    assert np.abs(kept).max() < 2e-6


def test_pieces_do_not_show() -> None:
    rng = np.random.default_rng(1)
    samples = rng.standard_normal(5000) + 1j * rng.standard_normal(5000)
    whole = Decimator(7).feed(samples)
    decimator = Decimator(7)
    edges = [0, 1, 2, 300, 301, 307, 2000, 5000]
    parts = [decimator.feed(samples[a:b]) for a, b in pairwise(edges)]
    # Sums of some hundred products in another order.
    np.testing.assert_allclose(np.concatenate(parts), whole, rtol=0, atol=1e-13)
    assert len(whole) == (5000 - decimator.taps) // 7 + 1


def test_factor_one_passes_everything() -> None:
    samples = tone(0.3, 50)
    np.testing.assert_allclose(Decimator(1).feed(samples), samples, rtol=1e-15)
