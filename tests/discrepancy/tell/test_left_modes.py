"""Modes in what a fit leaves: seen there, or not, whatever else moves in the runs."""

import numpy as np
import pytest
from scipy.signal import cont2discrete, lfilter

from discrepancy.data.record import Floats, Record, make_record
from discrepancy.tell.left_modes import left_modes

RATE, OWN = 2560.0, 38.0


def answer(frequency: float, quality: float, u: Floats) -> Floats:
    """Of an oscillator of 1 kg to a force that is held between samples."""
    w = 2 * np.pi * frequency
    number, below, _ = cont2discrete(([1.0], [1.0, w / quality, w**2]), 1 / RATE)
    return np.asarray(lfilter(np.squeeze(number), below, u))


@pytest.fixture(scope="module")
def runs() -> list[Record]:
    """Runs whose own motion hides all else."""
    found = []
    for seed in range(2):
        t, u = np.arange(12_000) / RATE, np.random.default_rng(seed).normal(size=12_000)
        found.append(make_record(f"run-{seed}", t, u, answer(OWN, 90, u), sample_rate=RATE))
    return found


def left(runs: list[Record], *modes: tuple[float, float]) -> list[Floats]:
    """What a fit leaves that lacks these modes, and as much noise as a tenth of it."""
    found = []
    for run in runs:
        rest = sum((answer(*mode, run.u[:, 0]) for mode in modes), np.zeros(len(run.t)))
        noise = np.random.default_rng(9).normal(size=len(run.t))
        found.append((rest + (0.1 * rest.std() if modes else 1e-6) * noise)[:, None])
    return found


def test_modes_are_told_with_their_frequencies(runs: list[Record]) -> None:
    said = left_modes(runs, left(runs, (97.0, 120.0), (171.0, 150.0)), [OWN])
    assert said is not None
    assert "97 Hz" in said
    assert "171 Hz" in said


@pytest.mark.parametrize("missing", [(), ((OWN, 90.0),)])
def test_noise_and_a_mode_that_the_model_has_are_not(
    runs: list[Record], missing: tuple[tuple[float, float], ...]
) -> None:
    assert left_modes(runs, left(runs, *missing), [OWN]) is None


def test_a_fit_that_left_all_bounds_says_nothing(runs: list[Record]) -> None:
    assert left_modes(runs, [np.full_like(run.v, np.nan) for run in runs], [OWN]) is None
