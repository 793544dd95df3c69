"""Bias over the pattern angle: made-up harmonics come back, and their standard errors are right."""

from math import pi

import numpy as np
import pytest

from calibration.analysis.spin import Spin, spin
from gyro_model.errors import InputError

T = np.arange(20_000) * 1e-3
PATTERN = 0.3 - 2.0 * T


def wrong_by(mean: float, c2: float, s2: float, c4: float, s4: float, pattern: np.ndarray = PATTERN) -> np.ndarray:
    """Error of the angle [rad] for a pattern that turns at -2 rad/s: the rate error by hand, integrated by hand."""
    integral = c2 * np.sin(2 * pattern) / 2 - s2 * np.cos(2 * pattern) / 2
    integral += c4 * np.sin(4 * pattern) / 4 - s4 * np.cos(4 * pattern) / 4
    return mean * T + integral / -2.0


def test_harmonics_by_hand() -> None:
    found = spin(T, wrong_by(1e-3, 2e-3, -3e-3, 4e-4, 5e-4), PATTERN)
    second, fourth = found.harmonics
    values = (found.mean, second.cosine, second.sine, fourth.cosine, fourth.sine)
    # Trapezoids of 1 ms under a wave of 8 rad/s: (8e-3)^2/12 = 5e-6 of it.
    np.testing.assert_allclose(values, (1e-3, 2e-3, -3e-3, 4e-4, 5e-4), atol=1e-7)
    assert (second.order, fourth.order) == (2, 4)
    assert second.amplitude == pytest.approx(13**0.5 * 1e-3, rel=1e-4)
    assert found.rounds == pytest.approx(2 * T[-1] / pi)
    # At its angle the harmonic is largest.
    assert second.cosine * np.cos(2 * second.angle) + second.sine * np.sin(2 * second.angle) == pytest.approx(
        second.amplitude
    )


def test_the_curve_over_the_pattern_by_hand() -> None:
    found = spin(T, wrong_by(1e-3, 2e-3, 0.0, 0.0, 0.0), PATTERN)
    assert len(found.pattern) == 36
    # Mean and difference over 10 deg leave 1 - 2 (0.1745)^2/6 = 0.990 of it; a bin of 5 deg has one phase of them.
    np.testing.assert_allclose(found.rate_error, 1e-3 + 1.98e-3 * np.cos(2 * found.pattern), atol=2.5e-4)


def test_a_pattern_that_turns_to_and_fro_is_as_good() -> None:
    pattern = 4.0 * np.sin(0.5 * T)
    rate = 1e-3 + 2e-3 * np.cos(2 * pattern)
    error = np.concatenate(([0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]) * np.diff(T))))
    found = spin(T, error, pattern)
    np.testing.assert_allclose((found.mean, found.harmonics[0].cosine), (1e-3, 2e-3), atol=1e-7)


def pulls(noise: object) -> np.ndarray:
    rows = []
    for seed in range(60):
        found: Spin = spin(T, wrong_by(1e-3, 2e-3, -3e-3, 0.0, 0.0) + noise(seed), PATTERN)  # type: ignore[operator]
        second = found.harmonics[0]
        rows.append(
            (
                (found.mean - 1e-3) / found.mean_error,
                (second.cosine - 2e-3) / second.cosine_error,
                (second.sine + 3e-3) / second.sine_error,
            )
        )
    return np.sqrt(np.mean(np.square(rows), axis=0))


def test_standard_errors_of_a_random_walk() -> None:
    rms = pulls(lambda seed: np.cumsum(1e-5 * np.random.default_rng(seed).standard_normal(len(T))))
    # 60 records: 9 % of scatter each, so 28 % for three sigma; the estimator is a few per cent small.
    assert (rms > 0.7).all()
    assert (rms < 1.3).all()


def test_standard_errors_of_white_angle_noise_are_on_the_safe_side() -> None:
    rms = pulls(lambda seed: 1e-5 * np.random.default_rng(seed).standard_normal(len(T)))
    assert (rms < 1.3).all()


@pytest.mark.parametrize(
    ("t", "pattern", "message"),
    [
        (T, 0.1 * T, "pattern turned by 2 rad: bias over its angle needs 3.14 rad; give a higher rate"),
        (T[:60], 0.2 * np.arange(60.0), "60 rows for 68 blocks of 10 deg: give 272 rows or more"),
        (T, np.where(T < 1, np.nan, T), "without a number"),
    ],
)
def test_what_can_not_be_known_is_said(t: np.ndarray, pattern: np.ndarray, message: str) -> None:
    with pytest.raises(InputError, match=message):
        spin(t, np.zeros_like(t), pattern)
