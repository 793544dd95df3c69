"""How a run sets out: its first samples held against a motion whose place and speed are known."""

from dataclasses import replace

import numpy as np
import pytest

from discrepancy.data.record import Record, make_record
from discrepancy.data.setting_out import as_shown, contradicted, shown

RATE, SAMPLES, GAIN, NOISE = 1000.0, 4000, 2.0, 1e-4


def thrown(place: float, speed: float, senses: str, seed: int = 1) -> Record:
    """A mass of 1 kg with 0.5 N.s/m under 2 N, by its solution."""
    t, rng = np.arange(SAMPLES) / RATE, np.random.default_rng(seed)
    faded = np.exp(-0.5 * t)
    moved = place + 4.0 * t + (speed - 4.0) * (1 - faded) / 0.5
    rate = 4.0 + (speed - 4.0) * faded
    run = make_record("a", t, np.full((SAMPLES, 1), 2.0), np.zeros((SAMPLES, 1)) + t[:, None], sample_rate=RATE)
    reference = 3.0 if senses == "velocity" else 1.0
    v = GAIN * (rate / reference if senses == "velocity" else moved)
    v = v + NOISE * rng.standard_normal(SAMPLES)
    return replace(run, v=v[:, None], senses=senses, reference=reference)


@pytest.mark.parametrize("senses", ["position", "velocity"])
@pytest.mark.parametrize("speed", [0.0, 1.5, -3.0])
def test_first_samples_show_place_and_speed(senses: str, speed: float) -> None:
    for seed in range(20):
        told = shown(thrown(0.7, speed, senses, seed))
        # Of 120 starts one is five deviations off once in ten thousand times.
        assert abs(told.speed - GAIN * speed) < 5 * told.deviation
        assert told.place == pytest.approx(GAIN * 0.7 if senses == "position" else 0.0, abs=5 * NOISE)


@pytest.mark.parametrize("senses", ["position", "velocity"])
def test_a_start_that_never_was_is_seen(senses: str) -> None:
    runs = [thrown(0.0, speed, senses) for speed in (0.0, 1.0)]
    as_it_was = [{"x_start": 0.0, "x_dot_start": speed} for speed in (0.0, 1.0)]
    assert not contradicted(runs, as_it_was, GAIN)
    assert contradicted(runs, [as_it_was[0], {"x_start": 0.0, "x_dot_start": 1.2}], GAIN)


def test_what_noise_hides_contradicts_nothing() -> None:
    run = thrown(0.0, 0.0, "position")
    noisy = replace(run, v=run.v + np.random.default_rng(2).standard_normal(run.v.shape))
    assert not contradicted([run, noisy], [{"x_dot_start": 1.0}, {"x_dot_start": 1.0}], GAIN)
    assert as_shown(noisy).begun is None
    clipped = replace(run, valid=np.arange(SAMPLES) > 45)
    assert not contradicted([clipped], [{"x_dot_start": 1.0}], GAIN)
    assert as_shown(clipped).begun is None


def test_a_run_is_held_to_what_it_shows() -> None:
    place, speed = as_shown(thrown(0.7, 1.5, "position")).begun or (np.nan, np.nan)
    assert place == pytest.approx(GAIN * 0.7, rel=1e-3)
    assert speed == pytest.approx(GAIN * 1.5, rel=1e-2)
