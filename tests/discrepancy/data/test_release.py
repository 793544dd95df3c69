"""A free decay begins where the device was let go."""

import numpy as np
import pytest

from discrepancy.data.release import released

RATE, SAMPLES = 1000.0, 20_000
T = np.arange(SAMPLES) / RATE
NOISE = 1e-3 * np.random.default_rng(1).standard_normal(SAMPLES)


def decay(t: np.ndarray) -> np.ndarray:
    return np.asarray(np.exp(-0.2 * t) * np.cos(2 * np.pi * 1.3 * t))


@pytest.mark.parametrize("offset", [0.0, -0.4])
def test_a_hand_that_lifts_and_holds_it_is_cut_off(offset: float) -> None:
    rest, held = T < 3.0, (T >= 4.0) & (T < 6.0)
    v = np.where(rest, 0.0, np.where(held, 1.0, np.where(T < 4.0, T - 3.0, decay(T - 6.0)))) + NOISE + offset
    begin = released([v])
    # The first hundredth of its height takes 17 ms of a period of 0.77 s.
    assert 6000 <= begin <= 6030
    assert released([v, NOISE + offset]) >= begin


def test_a_record_that_begins_with_the_motion_is_whole() -> None:
    # A decay, one that swells as the modes of a beat do, and noise alone.
    beat = np.exp(-0.05 * T) * np.sin(2 * np.pi * 0.05 * T + 0.1) * np.sin(2 * np.pi * 5 * T)
    for v in (decay(T), beat, 1e3 * NOISE):
        assert released([v + NOISE]) == 0
