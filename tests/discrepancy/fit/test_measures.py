"""Misfits against their definition."""

import numpy as np
import pytest

from discrepancy.data.record import make_record
from discrepancy.fit.measures import misfits


def test_a_run_that_is_still_after_its_start_counts_by_its_start() -> None:
    t = np.arange(200) / 1000.0
    v = np.where(t < 0.02, 0.3, 0.0)[:, None]
    record = make_record("a", t, np.zeros_like(v), v, sample_rate=1000.0, hold="zero")
    found = misfits([record], {"a": (np.full_like(v, 0.01), 50)})
    # 150 samples of 0.01 over 20 of 0.3.
    assert found["a"] == pytest.approx(np.sqrt(150 * 0.01**2 / (20 * 0.3**2)), rel=1e-12)
    assert found[""] == found["a"]
