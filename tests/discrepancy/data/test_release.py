"""A free decay begins where the device was let go."""

import numpy as np
import pytest

from discrepancy.data.release import cut_off, released

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


def driven(off: float, begin: float = 0.0) -> np.ndarray:
    """A device that follows in 0.5 s a drive at 40 Hz, on from ``begin`` [s] to ``off`` [s], that nobody recorded."""
    loud = np.where(off > T, 1 - np.exp(-np.maximum(T - begin, 0.0) / 0.5), np.exp(-(T - off) / 2.0))
    return np.asarray(np.where(begin - 5.0 > T, 1.0, loud) * np.cos(2 * np.pi * 40.0 * T))


@pytest.mark.parametrize("begin", [-10.0, 1.0])
def test_a_drive_that_nobody_recorded_is_cut_off(begin: float) -> None:
    sample = cut_off([driven(9.0, begin) + NOISE])
    # The block in which it ends and a part of the next one: blocks have 200 samples.
    assert 9000 <= sample <= 9400
    assert cut_off([0.1 * driven(9.0, begin), driven(9.0, begin) + NOISE]) == sample


def test_no_drive_is_seen_in_a_decay() -> None:
    carrier = np.cos(2 * np.pi * 40.0 * T)
    loud = {
        "viscous": np.exp(-0.1 * T),
        "dry": np.maximum(1 - 0.06 * T, 0.0),
        "of the square of the speed": 1 / (1 + T),
        "of two modes": np.exp(-0.05 * T) * np.abs(np.cos(2 * np.pi * 0.03 * (T - 6.0))),
        "none": np.ones_like(T),
    }
    assert {kind: cut_off([own * carrier + NOISE]) for kind, own in loud.items()} == dict.fromkeys(loud, 0)
    assert cut_off([decay(T) + NOISE]) == 0
    assert cut_off([NOISE]) == 0
