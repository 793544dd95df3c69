"""A filter that is known is found again, and what is read off it is what can be reckoned by hand."""

import numpy as np
import pytest

from calibration.analysis.frequency_response import Response, bandwidth, between, frequency_response, group_delay
from gyro_model.errors import InputError

INTERVAL = 1e-3
ROWS = 2000
LINES = np.unique(np.rint(np.geomspace(1, 200, 40)))
BASE = 1 / (ROWS * INTERVAL)


def record(delay: float, seed: int, noise: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Sines, and the same after a delay [s] and half the size, four periods."""
    t = INTERVAL * np.arange(4 * ROWS)
    rng = np.random.default_rng(seed)
    phases = rng.uniform(0, 2 * np.pi, len(LINES))
    given = sum(np.cos(2 * np.pi * f * t + p) for f, p in zip(LINES * BASE, phases, strict=True))
    late = sum(np.cos(2 * np.pi * f * (t - delay) + p) for f, p in zip(LINES * BASE, phases, strict=True))
    return given, 0.5 * late + noise * rng.standard_normal(len(t))


def test_gain_and_delay_come_back() -> None:
    found = frequency_response(*record(2.5e-3, 1), INTERVAL, LINES * BASE, BASE)
    np.testing.assert_allclose(np.abs(found.gain), 0.5, rtol=1e-9)
    assert group_delay(found, 50.0)[0] == pytest.approx(2.5e-3, rel=1e-9)


def test_the_stated_error_is_that_of_the_noise() -> None:
    off = []
    for seed in range(20):
        found = frequency_response(*record(0.0, seed, 0.05), INTERVAL, LINES * BASE, BASE)
        # A complex error of which the scatter is stated: half of its square in each part.
        off.append((found.gain - 0.5).real / (found.error / np.sqrt(2)))
    # Four periods give Student's t with three complex, six real degrees of freedom: sqrt(6/4) wider than normal.
    assert np.std(off) == pytest.approx(np.sqrt(6 / 4), rel=0.12)


def test_bandwidth_of_one_pole_and_of_a_peak() -> None:
    f = np.geomspace(0.1, 100, 2000)
    assert bandwidth(f, np.abs(1 / (1 + 1j * f / 7))) == pytest.approx(7.0, rel=1e-3)
    # Undamped at f0: 1/(f²/f0² - 1) = 1/sqrt(2) at f0 sqrt(1 + sqrt 2).
    peak = np.abs(1 / (1 - (f / 10) ** 2 + 1e-6j))
    assert bandwidth(f, peak) == pytest.approx(10 * np.sqrt(1 + np.sqrt(2)), rel=1e-3)
    assert bandwidth(f, np.ones_like(f)) is None


@pytest.mark.parametrize("ratio", [1.0, 1.01, 1.02, 1.04, 1.06])
def test_bandwidth_between_coarse_lines_beside_a_resonance(ratio: float) -> None:
    f = 0.1 * ratio * 1.07 ** np.arange(100)
    gain = np.abs(1 / (1 - (f / 10) ** 2 + 1e-4j * f))
    # Straight lines between these are up to 0.08 % off.
    edge = 10 * np.sqrt(1 + np.sqrt(2))
    assert bandwidth(f, gain) == pytest.approx(edge, rel=2e-4)
    # The phase of such a mode 20 times as broad, -167.6° there: straight lines are up to 0.09° off.
    phase = np.degrees(np.unwrap(np.angle(1 / (1 - (f / 10) ** 2 + 0.02j * f))))
    there = -180 + np.degrees(np.arctan2(0.02 * edge, (edge / 10) ** 2 - 1))
    assert between(f, phase, edge) == pytest.approx(there, abs=0.01)


def test_too_short_a_record_is_refused() -> None:
    given, output = record(0.0, 1)
    with pytest.raises(InputError, match="no two periods of 2 s"):
        frequency_response(given[: ROWS + 5], output[: ROWS + 5], INTERVAL, LINES * BASE, BASE)


def test_group_delay_of_one_line_alone() -> None:
    found = Response(np.array([1.0]), np.array([np.exp(-2j * np.pi * 0.01)]), np.array([1e-3]))
    delay, error = group_delay(found, 0.5)
    assert delay == pytest.approx(0.01)
    assert error == pytest.approx(1e-3 / (2 * np.pi))
