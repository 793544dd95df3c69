"""Noise from repetitions: known noise on periodic and on repeated runs, and silence where nothing repeats."""

import numpy as np
import pytest

from discrepancy.data.record import Record, make_record
from discrepancy.data.repeats import period_of, repeated_noise

RATE, PERIOD, COUNT = 1e4, 500, 8


def run(seed: int, noise: float = 1e-3, *, periodic: bool = True, decay: float = 0.0) -> Record:
    rng = np.random.default_rng(1)
    u = np.tile(rng.standard_normal(PERIOD), COUNT) if periodic else rng.standard_normal(PERIOD * COUNT)
    v = np.convolve(u, np.exp(-np.arange(100) / 20))[: len(u)] * 1e-2
    t = np.arange(len(u)) / RATE
    v = v + decay * np.exp(-t * RATE / PERIOD) + noise * np.random.default_rng(seed).standard_normal(len(u))
    return make_record(f"run-{seed}", t, u, v, sample_rate=RATE)


@pytest.mark.parametrize("decay", [0.0, 0.1])
def test_periods_give_the_noise(decay: float) -> None:
    assert period_of(run(2).u) == PERIOD
    # 2000 differences and more: 2 % a deviation; four of them.
    assert repeated_noise([run(2, decay=decay)]) == pytest.approx(1e-3, rel=0.1 if decay else 0.06)


def test_runs_of_one_force_give_the_noise() -> None:
    assert repeated_noise([run(2, periodic=False), run(3, periodic=False)]) == pytest.approx(1e-3, rel=0.1)


def test_nothing_repeats() -> None:
    assert period_of(run(2, periodic=False).u) is None
    assert repeated_noise([run(2, periodic=False)]) is None
    # One tone: a period is shorter than what says anything.
    t = np.arange(4000) / RATE
    assert period_of(np.sin(2 * np.pi * 1000 * t)[:, None]) in (None, *range(50, 1000))
