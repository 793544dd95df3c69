"""Allan deviation: known noises give known coefficients; the simulated device meets its own limits."""

from dataclasses import replace
from math import pi, sqrt

import numpy as np
import pytest

from cosim.rate.allan import FLAT, allan_deviation, noise_limits, overlapping
from cosim.rate.courses import constant, constant_temperature
from cosim.rate.master import simulate
from cosim.rate.metrics import PER_ROOT_HOUR, allan_of, summarise
from cosim.rate.run import RateRun
from gyro_model.device import load_device
from gyro_model.errors import InputError

DEVICE = load_device("rate-mode")


def test_white_noise_gives_its_random_walk_and_no_bottom() -> None:
    walk, interval = 3e-5, 0.01
    rate = walk / sqrt(interval) * np.random.default_rng(1).standard_normal(100_000)
    found = allan_deviation(rate, interval, 0.0)
    # Three standard errors, which the estimator states: 0.5 % here.
    assert abs(found.angle_random_walk - walk) < 3 * found.angle_random_walk_error
    assert found.angle_random_walk_error < 0.01 * walk
    assert found.bias_instability is None


def test_rate_random_walk_makes_a_bottom() -> None:
    rng, interval, n = np.random.default_rng(2), 0.01, 200_000
    walk, drift = 3e-5, 3e-5
    rate = walk / sqrt(interval) * rng.standard_normal(n) + drift * sqrt(interval) * np.cumsum(rng.standard_normal(n))
    found = allan_deviation(rate, interval, 0.0)
    # σ² = N²/τ + K²τ/3 is lowest at τ = √3 N/K = 1.7 s with σ² = 2NK/√3.
    assert found.instability_tau == pytest.approx(sqrt(3), rel=0.6)
    # 10 % of statistical error near the bottom.
    assert found.bias_instability == pytest.approx(sqrt(2 * walk * drift / sqrt(3)) / FLAT, rel=0.2)


def test_short_record_says_how_long_it_must_be() -> None:
    with pytest.raises(InputError, match="needs 1 s"):
        allan_deviation(np.zeros(50), 0.01, 0.0)


def run(closed: bool, duration: float) -> RateRun:
    return RateRun(
        DEVICE, constant(0.0, "rest"), constant_temperature(25), closed, duration, 3, output_rate=50.0, envelope=True
    )


def test_thermal_limit_by_hand() -> None:
    limits = noise_limits(run(False, 10.0).nominal, 298.15, 5e-6)
    # m w Q = m² w²/dyy; w at 25 °C is 2π·4999.82, A = 4 µm.
    by_hand = sqrt(1.380649e-23 * 298.15 * 1.058e-6) / (2e-8 * 2 * pi * 4999.82 * 4e-6)
    assert limits.thermal == pytest.approx(by_hand, rel=1e-5)
    # 12.7 nm/(rad/s) at a split of 50 Hz, 20 pm at 200 kHz: √(2·5 µs)·20 pm/12.5 nm.
    assert limits.electronics == pytest.approx(sqrt(1e-5) * 2e-5 / 0.012454, rel=1e-3)


@pytest.mark.parametrize("closed", [False, True])
def test_simulated_device_meets_its_limits(closed: bool) -> None:
    asked = run(closed, 400.0)
    result = simulate(asked)
    noise = allan_of(result.record, asked)
    assert noise is not None
    allan, limits = noise
    # Three standard errors of 3 %; without the thermal force the limit would be 19 % of the total.
    assert abs(allan.angle_random_walk - limits.total) < 3 * allan.angle_random_walk_error
    shown = summarise(asked, result)["allan"]
    assert shown["thermal_limit_deg_rth"] == pytest.approx(PER_ROOT_HOUR * limits.thermal)
    assert shown["thermal_limit_deg_rth"] < shown["expected_deg_rth"] < 1.1 * shown["thermal_limit_deg_rth"]


def test_random_walk_of_an_open_loop_of_high_q_is_read_past_its_ringing() -> None:
    p = DEVICE.parameters
    sharp = DEVICE.with_parameters({"kyy": p["m"] * (2 * pi * 5009.7) ** 2, "dyy": p["dyy"] * 600 / 38_000})
    asked = replace(run(False, 1000.0), device=sharp)
    noise = allan_of(simulate(asked).record, asked)
    assert noise is not None
    allan, limits = noise
    # The statistical error is 14 %; read from 40 delays of the filter on, seeds 1 to 3 give 1.61 to 1.69 of the limit.
    assert allan.angle_random_walk == pytest.approx(limits.total, rel=0.42)
    # Decays of 2.4 s.
    assert asked.white_from == pytest.approx(3 * 38_000 / (pi * 5009.7), rel=0.01)


@pytest.mark.parametrize("rows", [200, 4321])
def test_overlapping_deviation_is_that_of_an_independent_program(rows: int) -> None:
    allantools = pytest.importorskip("allantools", reason="an independent Allan deviation")
    rng = np.random.default_rng(rows)
    rate = rng.normal(size=rows) + 0.1 * np.cumsum(rng.normal(size=rows)) + 30.0
    tau, deviation = overlapping(rate, 0.01)
    theirs_tau, theirs, _, _ = allantools.oadev(rate, rate=100.0, data_type="freq", taus=tau)
    assert tau == pytest.approx(theirs_tau, rel=1e-12)
    # Sums of thousands of doubles with a mean thirty times the noise.
    assert deviation == pytest.approx(theirs, rel=1e-9)
