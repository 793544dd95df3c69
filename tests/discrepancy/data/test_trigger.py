"""Force and voltage of two instruments that were not triggered together."""

import numpy as np
import pytest
from scipy.signal import TransferFunction, lsim

from discrepancy.data.trigger import late_by

RATE, SAMPLES, FREQUENCY = 2000.0, 8000, 60.0
"""33 samples a period."""


def records(order: int, tones: int = 60) -> tuple[np.ndarray, np.ndarray]:
    """A force that is held over each sample and the derivative of so high an ``order`` of the motion, Q = 50."""
    rng, t = np.random.default_rng(3), np.arange(SAMPLES) / RATE
    frequency = rng.uniform(15, 150, tones)
    u = np.sin(2 * np.pi * frequency * t[:, None] + rng.uniform(0, 6.28, tones)).sum(axis=1)
    w = 2 * np.pi * FREQUENCY
    _, v, _ = lsim(TransferFunction([*[1.0], *[0.0] * order], [1.0, w / 50, w**2]), u, t, interp=False)
    return u, np.asarray(v + 0.05 * v.std() * rng.standard_normal(SAMPLES))


@pytest.mark.parametrize("order", [0, 1])
@pytest.mark.parametrize("late", [-100, -14, 37, 120])
def test_the_response_says_by_how_many_samples_a_voltage_is_late(order: int, late: int) -> None:
    u, v = records(order)
    begin = max(late, 0), max(-late, 0)
    count = SAMPLES - abs(late)
    assert late_by(u[begin[0] :][:count], v[begin[1] :][:count], order) == late


def test_nothing_is_moved_where_a_response_needs_no_move() -> None:
    u, v = records(0)
    rng = np.random.default_rng(5)
    assert late_by(u, v, 0) == 0
    # Less than a good part of a period is a delay of the device's.
    assert late_by(u[8:], v[:-8], 0) == 0
    # Of a spring that bends far.
    assert late_by(u, np.tanh(3 * v / v.std()), 0) == 0
    assert late_by(u, rng.standard_normal(SAMPLES), 0) == 0
    # One tone is alike at each turn.
    one, answer = records(0, tones=1)
    assert late_by(one[40:], answer[:-40], 0) == 0
    assert late_by(np.zeros(SAMPLES), v, 0) == 0
    assert late_by(u[:200], v[:200], 0) == 0
