"""Misfits against their definition."""

from dataclasses import replace

import numpy as np
import pytest

from discrepancy.data.record import make_record
from discrepancy.fit.measures import START_SAMPLES, misfits, start_fitted
from discrepancy.fit.refit import Fitter
from discrepancy.fit.simulate import Simulator
from gyro_model.model import load_model


def test_a_run_that_is_still_after_its_start_counts_by_its_start() -> None:
    t = np.arange(200) / 1000.0
    v = np.where(t < 0.02, 0.3, 0.0)[:, None]
    record = make_record("a", t, np.zeros_like(v), v, sample_rate=1000.0, hold="zero")
    found = misfits([record], {"a": (np.full_like(v, 0.01), 50)})
    # 150 samples of 0.01 over 20 of 0.3.
    assert found["a"] == pytest.approx(np.sqrt(150 * 0.01**2 / (20 * 0.3**2)), rel=1e-12)
    assert found[""] == found["a"]


@pytest.mark.parametrize(("rate", "samples", "start"), [(2e6, 4000, 1000), (2e6, 100_000, 10_000), (100.0, 120, 50)])
def test_a_start_is_5_ms_or_50_samples_and_no_more_than_a_quarter_of_a_longer_run(
    rate: float, samples: int, start: int
) -> None:
    device = {"m": 1.0, "kxx": (0.1 * rate) ** 2, "dxx": 0.02 * rate, "sense_gain_x": 1.0}
    t = np.arange(samples) / rate
    v = np.cos(0.1 * np.arange(samples))[:, None]
    record = make_record("a", t, np.zeros_like(v), v, sample_rate=rate, hold="zero")
    with Simulator(load_model(), jobs=1) as simulator:
        residual, n = start_fitted(simulator, record, device)
    assert n == start
    # What is off by all of the motion has a misfit.
    assert misfits([record], {"a": (residual, n)})["a"] > 0.1


@pytest.mark.parametrize("coupling", [0.0, 60.0])
def test_as_much_of_a_run_as_tells_how_it_began_is_its_start(coupling: float) -> None:
    # A mode of 3 Hz beside one of 4 Hz: 50 samples, an eighth of a second, hardly tell four states.
    mode = {"parasitic_coupling": coupling, "parasitic_frequency": 3.0, "parasitic_q": 40.0}
    device = {"m": 1.0, "kxx": (2 * np.pi * 4) ** 2, "dxx": 0.5, "sense_gain_x": 1.0, **mode}
    rng, rate, n = np.random.default_rng(3), 400.0, 6000
    t = np.arange(n) / rate
    w = 2 * np.pi * rng.uniform(2, 6, 40)
    u = np.cos(w * t[:, None] + rng.uniform(0, 6.28, 40)).sum(axis=1)[:, None]
    record = make_record("a", t, u, u, sample_rate=rate, hold="zero")
    with Simulator(load_model(), jobs=1) as simulator:
        v = simulator.run(record, {**device, "x_start": 1e-3})
        noisy = v + 3e-3 * v.std() * rng.standard_normal(v.shape)
        residual, start = start_fitted(simulator, make_record("a", t, u, noisy, sample_rate=rate, hold="zero"), device)
    assert (start > START_SAMPLES) == (coupling > 0)
    assert start <= n // 2
    # The noise, and what it leaves open of the start.
    assert np.std(residual[start:]) < 1.2 * 3e-3 * v.std()


def test_what_is_open_of_a_start_is_little_beside_the_noise() -> None:
    # A sensor of acceleration hardly shows the displacement of a slow mass. 100 samples, a fifth of its period, leave
    # that open by less than a hundredth of the motion, but by half of the noise: 1.12 of it is left then.
    mode = {"parasitic_coupling": 30.0, "parasitic_frequency": 9.0, "parasitic_q": 40.0}
    device = {"m": 1.0, "kxx": (2 * np.pi * 3) ** 2, "dxx": 0.2, "sense_gain_x": 1.0, **mode}
    rng, rate, n, noise = np.random.default_rng(5), 1500.0, 6000, 1e-3
    t = np.arange(n) / rate
    w = 2 * np.pi * rng.uniform(2.1, 11.7, 40)
    u = np.cos(w * t[:, None] + rng.uniform(0, 6.28, 40)).sum(axis=1)[:, None]
    known = {"sample_rate": rate, "hold": "zero", "senses": "acceleration"}
    still = make_record("a", t, u, u, **known)
    with Simulator(load_model(), jobs=1) as simulator:
        v = simulator.run(still, device)
        noisy = make_record("a", t, u, v + noise * v.std() * rng.standard_normal(v.shape), **known)
        residual, start = start_fitted(simulator, noisy, device)
    # Of n numbers the deviation is known to 1 %; 0.3 of it beside it make 4 %.
    assert np.std(residual[start:]) < 1.07 * noise * v.std()


def test_the_mean_that_was_taken_out_of_a_velocity_is_found_again_where_it_was_the_motions() -> None:
    # Nothing but a damper holds the shaft: what the first cosine pushes it to goes within a fifth of the run.
    device = {"m": 1.0, "kxx": 1e-6, "dxx": 1.0, "sense_gain_x": 1.0}
    rng, rate, n, noise, offset = np.random.default_rng(7), 250.0, 6000, 3e-3, 0.7
    t = np.arange(n) / rate
    u = np.cos(2 * np.pi * rng.uniform(2, 9, 40) * t[:, None] + rng.uniform(0, 6.28, 40)).sum(axis=1)[:, None]
    shown = make_record("a", t, u, u, sample_rate=rate, senses="velocity")
    with Simulator(load_model(), jobs=1) as simulator:
        v = simulator.run(shown, device)
        noisy = v + offset + noise * v.std() * rng.standard_normal(v.shape)
        record = make_record("a", t, u, noisy, sample_rate=rate, senses="velocity")
        assert record.centred
        left = {**device, "sense_gain_x": record.reference / shown.reference}
        residual, _ = start_fitted(simulator, record, left)
        fitter = Fitter(simulator, [record])
        begun = fitter.begin({**left, "dxx": 1.2})
        at = fitter.fit(replace(begun, free=tuple(own for own in begun.free if own.name == "dxx")))
    # The noise, and no level; the mean under a window is off it by a hundredth of the motion.
    assert np.std(residual) < 1.02 * noise * v.std() and abs(residual.mean()) < 0.05 * noise * v.std()
    assert abs(v.mean() + offset - (noisy - record.v).mean()) > 3 * noise * v.std()
    assert fitter.off(at) < 1.02 * noise
    assert at.parameters["dxx"] == pytest.approx(1.0, rel=3e-3)
