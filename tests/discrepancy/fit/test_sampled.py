"""What samples show of a place and a speed, against the motion that they are of, far from linear."""

import numpy as np
import pytest

from benchmarks.bent import Bent, motion
from discrepancy.data.record import Record, make_record
from discrepancy.fit.sampled import sampled_starts

RATE, SAMPLES, GAIN = 4000.0, 3000, 2.5
OWN = Bent(1.0, 30.0, (2 * np.pi * 100) ** 2, 4e5 * (2 * np.pi * 100) ** 2, 0.0)
"""100 Hz, Q = 21; below the cube makes it 0.8 to 1.2 times as stiff again, in the mean."""


def measured(order: int, noise: float) -> tuple[Record, np.ndarray]:
    rng, t = np.random.default_rng(order), np.arange(SAMPLES) / RATE
    tones = 2 * np.pi * np.linspace(10, 300, 60)
    u = np.cos(np.outer(t, tones) + rng.uniform(0, 2 * np.pi, 60)).sum(axis=1)
    true = motion(OWN, 60 * u, 1 / RATE, "first")
    v = true[:, order] + noise * true[:, order].std() * rng.standard_normal(SAMPLES)
    senses = ("position", "velocity", "acceleration")[order]
    record = make_record("1", t, u[:, None], GAIN * v[:, None], sample_rate=RATE, hold="first", senses=senses)
    return record, true[:, :2]


@pytest.mark.parametrize(
    ("order", "place", "speed"),
    # Medians; reached are 0.0020, 0.0033; 0.022, 0.011; 0.16, 0.006. A speed has lost the slow part of its place, an
    # acceleration more of it.
    [(0, 0.003, 0.006), (1, 0.04, 0.02), (2, 0.3, 0.02)],
)
def test_place_and_speed_are_near_the_true_ones(order: int, place: float, speed: float) -> None:
    record, true = measured(order, 2e-3)
    gain = GAIN * record.reference**order
    off = []
    for here in range(0, SAMPLES, 60):
        first, *more = sampled_starts(record, here, RATE / 100, {"sense_gain_x": gain})
        off.append(np.abs([first["x_start"] - true[here, 0], first["x_dot_start"] - true[here, 1]]) / true.std(axis=0))
        assert bool(more) is (order > 0)
    assert (np.median(off, axis=0) < [place, speed]).all()


def test_masked_samples_show_none() -> None:
    record, _ = measured(0, 0.0)
    record.valid[300] = False
    gains = {"sense_gain_x": GAIN}
    assert sampled_starts(record, 302, RATE / 100, gains) == []
    assert sampled_starts(record, 400, RATE / 100, gains) != []
