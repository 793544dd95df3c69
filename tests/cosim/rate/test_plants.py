"""Rate mode on both plants: against the harmonic balance, against each other, and what happens without lock."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from cosim.rate.courses import ZERO_CELSIUS, constant_temperature, rate_step, temperature_ramp
from cosim.rate.master import simulate
from cosim.rate.metrics import fit_line, plateaus, summarise
from cosim.rate.run import RateRun
from cosim.rate.steady_state import output_at
from gyro_model.device import load_device
from gyro_model.errors import InputError

QUIET = load_device("rate-mode").with_parameters({"sense_noise": 0.0, "thermal_force": 0.0})
STEP = np.deg2rad(20.0)


def run_at(celsius: float, closed: bool, envelope: bool) -> RateRun:
    course = rate_step(STEP, 3.0)
    return RateRun(QUIET, course, constant_temperature(celsius), closed, 3.0, envelope=envelope)


@cache
def settled_output(celsius: float, closed: bool, envelope: bool) -> np.ndarray:
    """Scale factor, bias, quadrature [rad/s], drive frequency [Hz], drive force [N]."""
    run = run_at(celsius, closed, envelope)
    record = simulate(run).record
    found = plateaus(record, run)
    rest = record.filter(record["t"] < 0.75).tail(20)
    columns = ("quadrature", "drive_frequency", "drive_force")
    means = [float(rest[name].to_numpy().mean()) for name in columns]
    return np.array([found.scale_factors()[1].mean(), found.biases()[1][0], *means])


# Ω² pulls the settled state of a rate step by (Ω/Δω)² = 1e-6, start and steps have decayed to e^-12 = 6e-6 of 300 °/s
# and 20 °/s; a sampled force has images at the sample rate that the mode passes at 1e-6. All but the first would be
# smaller with more patience.
LIMITS = np.array([2e-5, 2e-5, 1e-4, 1e-5, 1e-12])


@pytest.mark.parametrize(("closed", "celsius"), [(False, 60.0), (True, -20.0)])
def test_full_plant_settles_where_the_harmonic_balance_says(closed: bool, celsius: float, residual) -> None:
    run = run_at(celsius, closed, False)
    expected = np.array(output_at(QUIET, run.nominal.calibration, celsius + ZERO_CELSIUS))
    off = np.abs(settled_output(celsius, closed, False) - expected)
    names = ("scale factor", "bias", "quadrature", "frequency", "force")
    for name, value, limit in zip(names, off, LIMITS, strict=True):
        residual(name, value, limit)


@pytest.mark.parametrize("closed", [False, True])
@pytest.mark.parametrize("known", [False, True])
def test_a_curved_pickoff_is_calibrated_where_the_design_knows_it(closed: bool, known: bool, residual) -> None:
    curved = QUIET.with_parameters({"pickoff_inverse_gap": 1e5})
    course = rate_step(STEP, 3.0)
    run = RateRun(curved, course, constant_temperature(25), closed, 3.0, design=None if known else QUIET)
    record = simulate(run).record
    scale, bias = plateaus(record, run).scale_factors()[1].mean(), plateaus(record, run).biases()[1][0]
    expected = output_at(curved, run.nominal.calibration, 25 + ZERO_CELSIUS)
    # By hand: a swing a that shows as 0.4 gaps, 2 (1/√(1 - a²) - 1)/a = 0.4, is 0.360549; over 0.4 that is 0.901372.
    # Quadrature of 300 °/s swings y by 67 nm: (3/4) (y/g)² = 3e-5 of the open loop, less with the smaller swing.
    assert expected.scale_factor == pytest.approx(1.0 if known else 0.901372, abs=3e-5)
    residual("scale factor", abs(scale - expected.scale_factor), LIMITS[0])
    residual("bias", abs(bias - expected.bias), LIMITS[1])


@pytest.mark.parametrize(("closed", "celsius"), [(False, 60.0), (True, -20.0)])
def test_envelope_settles_where_the_full_plant_does(closed: bool, celsius: float, residual) -> None:
    full, slow = (settled_output(celsius, closed, envelope) for envelope in (False, True))
    scale = QUIET.rate_mode["full_scale"]
    # Asked: 1 % of full range. Both settle to the same state but for what LIMITS names.
    residual("bias over full range", abs(slow[1] - full[1]) / scale, 1e-5)
    residual("quadrature over full range", abs(slow[2] - full[2]) / scale, 5e-5)
    residual("scale factor", abs(slow[0] - full[0]), 2e-5)


def test_a_ramp_is_followed_with_the_lags_of_structure_and_circuit() -> None:
    ramp = 5.0 / 60
    course = temperature_ramp(20 + ZERO_CELSIUS, 45 + ZERO_CELSIUS, 5.0)
    run = RateRun(QUIET, rate_step(STEP, 20.0), course, False, 300.0, output_rate=10.0, envelope=True)
    result = simulate(run)
    record, p = result.record, QUIET.parameters
    t = record["t"].to_numpy()
    for place in ("structure", "circuit"):
        lag = p[f"{place}_lag"]
        # First-order answer to a ramp; the ambient is held at the middle of each millisecond.
        expected = 20 + ZERO_CELSIUS + ramp * (t - lag * (1 - np.exp(-t / lag)))
        np.testing.assert_allclose(record[f"temperature_{place}"].to_numpy(), expected, atol=1e-6)
    kelvin, bias = plateaus(record, run).biases()
    settled = [output_at(QUIET, run.nominal.calibration, float(T)).bias for T in kelvin]
    # The bias follows the structure at once but for the sense mode's 40 ms: 3e-3 K of 2 °/s in 10 K, 1e-5 rad/s; and
    # the curve bends within the 5 s of a stretch, 0.4 K: 1e-5 rad/s.
    np.testing.assert_allclose(bias, settled, atol=2e-5)
    line = fit_line(record, run)
    assert line is not None and line.scale_factor is not None
    assert summarise(run, result)["temperature_deg_c"]["structure"]["max"] < 45


def test_record_repeats_with_its_seed_and_differs_with_another() -> None:
    noisy = load_device("rate-mode")
    records = [
        simulate(RateRun(noisy, rate_step(STEP, 5.0), constant_temperature(25), False, 1.0, seed, envelope=True)).record
        for seed in (1, 1, 2)
    ]
    assert records[0].equals(records[1])
    assert not records[0]["rate"].equals(records[2]["rate"])


def test_a_lost_lock_is_said_with_its_time() -> None:
    lazy = replace(QUIET.with_parameters({"structure_lag": 0.0}), rate_mode={**QUIET.rate_mode, "phase_bandwidth": 0.3})
    # 9 °C/s move the drive by 1.35 Hz/s: a phase error of 2π·1.35/(2π·0.3)² = 2.4 rad.
    course = temperature_ramp(20 + ZERO_CELSIUS, 80 + ZERO_CELSIUS, 540.0)
    run = RateRun(lazy, rate_step(STEP, 100.0), course, False, 6.0, output_rate=10.0, envelope=True)
    with pytest.raises(InputError, match=r"lost its lock at t = [0-9.]+ s .*phase_bandwidth"):
        simulate(run)


def test_a_loop_that_never_locks_is_said() -> None:
    deaf = QUIET.with_parameters({"sense_noise": 100.0})
    run = RateRun(deaf, rate_step(STEP, 5.0), constant_temperature(25), False, 1.0, envelope=True)
    with pytest.raises(InputError, match="not in lock"):
        simulate(run)
