"""Noise that wanders, against sums over its covariance."""

import numpy as np
import pytest

from calibration.compensation.points import Points
from calibration.compensation.record import Blocks
from calibration.compensation.wander import walk_of, whitened


def points(value: np.ndarray, noise: float, step: float = 10.0, cycles: int = 1) -> Points:
    n = len(value)
    t = step * np.arange(n)
    cycle = np.arange(n) * cycles // n
    blocks = Blocks(t, value, np.zeros(n), np.full(n, noise), {"structure": t / t[-1]}, cycle=cycle)
    return Points(blocks, value, np.full(n, noise))


def test_whitened_walk_and_noise_have_no_correlation_left() -> None:
    n, walk, noise = 6, 0.3, 0.7
    found = whitened(points(np.arange(n, dtype=float), noise, 1.0), walk, np.eye(n))
    # Covariance of a walk from 0 at t = 0, 1, 2, ... and of white noise.
    t = np.arange(n)
    covariance = walk * np.minimum.outer(t, t) + noise**2 * np.eye(n)
    np.testing.assert_allclose(found @ covariance @ found.T, np.eye(n - 1), atol=1e-12)


def test_offsets_of_cycles_drop_out() -> None:
    p = points(np.zeros(8), 1.0, cycles=2)
    np.testing.assert_allclose(whitened(p, 0.1, p.blocks.cycle[:, None] * 5.0), np.zeros((6, 1)), atol=1e-12)


def test_of_white_noise_alone_the_sum_of_squares_is_that_about_the_mean() -> None:
    value = np.random.default_rng(2).standard_normal(50)
    found = whitened(points(value, 2.0), 0.0, value[:, None])
    assert float(np.sum(found**2)) == pytest.approx(float(np.sum((value - value.mean()) ** 2)) / 4, rel=1e-9)


def test_walk_is_read_off_beside_a_curve() -> None:
    rng, n, noise = np.random.default_rng(4), 4000, 1.0
    t = 10.0 * np.arange(n)
    value = np.cumsum(np.sqrt(10.0) * 0.2 * rng.standard_normal(n)) + noise * rng.standard_normal(n)
    curve = np.stack([np.sin(t / 900), t / t[-1]], axis=1)
    # 4000 blocks hold 133 differences over 300 s that do not overlap: 12 %, of which three.
    assert walk_of(points(value + 50 * curve[:, 0], noise), curve) == pytest.approx(0.04, rel=0.4)
    assert walk_of(points(noise * rng.standard_normal(n), noise), curve) < 1e-3


def test_a_short_record_tells_no_walk() -> None:
    assert walk_of(points(np.arange(8.0), 1.0), np.zeros((8, 1))) == 0.0
