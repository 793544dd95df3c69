"""Values at a temperature that is reached from either side, on courses made here."""

import numpy as np
import pytest

from calibration.analysis.returns import settled_value, side

LAG, INTERVAL = 240.0, 10.0


def test_the_value_behind_a_curve_of_the_temperature() -> None:
    rng = np.random.default_rng(3)
    since = np.arange(3 * LAG, 6 * LAG, INTERVAL)
    off = 60.0 * np.exp(-since / LAG)
    values = 5.0 + 3.0 * off - 0.05 * off**2 + 5e-4 * off**3
    # The cube of the 3 K that are left at first, 0.013, less what two powers take of it.
    assert settled_value(since, values, LAG)[0] == pytest.approx(5.0, abs=2e-3)
    pulls = []
    for _ in range(400):
        value, error = settled_value(since, values + 0.5 * rng.standard_normal(len(since)), LAG)
        pulls.append((value - 5.0) / error)
    # 400 values: their scatter is known to 3.5 %; Student's of 69 degrees of freedom is 1.5 % wider than normal.
    assert np.std(pulls) == pytest.approx(1.0, abs=0.12)


@pytest.mark.parametrize("walk", [0.0, 1.0, 5.0])
def test_the_error_covers_what_white_noise_and_a_walk_do(walk: float) -> None:
    rng = np.random.default_rng(4)
    pulls = []
    for _ in range(3000):
        values = rng.standard_normal(6) + walk * np.cumsum(rng.standard_normal(6)) + 2.0 * np.arange(6)
        values[1::2] += 7.0
        found = side(values, np.ones(6))
        pulls.append((found.difference - 7.0) / found.error)
    # One standard error covers 68 % (3,000 draws: to 0.9 %), or some more where the values' own error is the larger. A
    # walk's steps are not as independent as Student's are: some 4 % less.
    assert 0.62 < np.mean(np.abs(pulls) < 1) < 0.84
    assert abs(np.mean(np.clip(pulls, -3, 3))) < 0.1
