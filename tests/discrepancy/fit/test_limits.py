"""The clip's own test on signals whose clip is known."""

import numpy as np

from discrepancy.data.record import Record, make_record
from discrepancy.fit.limits import clip_level, masked

NOISE = 2e-5


def measured(limit: float, seed: int = 0) -> tuple[Record, np.ndarray]:
    """A beating motion with noise, clipped at ``limit`` [V]; and what a perfect simulation leaves of it."""
    t = np.arange(4000) / 2e5
    clean = np.column_stack((np.sin(2e4 * t) * np.sin(50 * t + 0.3), 0.5 * np.cos(2.3e4 * t)))
    v = np.clip(clean + NOISE * np.random.default_rng(seed).standard_normal(clean.shape), -limit, limit)
    return make_record("run", t, np.ones_like(v), v), v - clean


def test_one_clipped_sample_is_enough_when_it_is_cut_by_more_than_noise() -> None:
    free, _ = measured(10.0)
    top = np.sort(np.abs(free.v).ravel())
    # Between the two largest samples; by 20 deviations of the noise below the largest.
    limit = float(top[-1]) - 20 * NOISE
    record, left = measured(limit)
    assert clip_level([record], [left], 1e-6) == limit
    assert not masked(record, limit).valid.all()


def test_a_clip_that_held_out_runs_alone_meet_is_found() -> None:
    record, left = measured(10.0)
    loud, _ = measured(0.9)
    assert clip_level([record], [left], 1e-6, [loud]) == 0.9
    assert clip_level([record], [left], 1e-6, [measured(10.0, seed=1)[0]]) is None


def test_no_clip_is_found_in_twenty_records_without_one() -> None:
    for seed in range(20):
        record, left = measured(10.0, seed)
        assert clip_level([record], [left], 1e-6) is None


def test_a_model_that_is_wrong_at_the_top_is_no_clip() -> None:
    record, left = measured(10.0)
    # An error of one part in a hundred of every sample is largest at the top, and as large beside it.
    off = left - 0.01 * record.v
    off[np.unravel_index(np.argmax(np.abs(record.v)), record.v.shape)[0] - 3] *= 1.5
    assert clip_level([record], [off], 1e-6) is None
