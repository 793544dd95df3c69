"""What a run of rate mode says of itself: bias and scale factor, their errors, what the harmonic balance leaves out."""

from dataclasses import replace
from math import pi

import numpy as np
import polars as pl
import pytest

from cosim.rate import metrics
from cosim.rate.allan import noise_limits
from cosim.rate.courses import Course, constant, constant_temperature, rate_step
from cosim.rate.master import simulate
from cosim.rate.metrics import allan_of, fit_line, summarise
from cosim.rate.run import RateRun
from gyro_model.device import load_device
from gyro_model.errors import InputError

DEVICE = load_device("rate-mode")
QUIET = DEVICE.with_parameters({"sense_noise": 0.0, "thermal_force": 0.0})


def run_of(rate: Course, duration: float, device=QUIET, **others) -> RateRun:
    return RateRun(device, rate, constant_temperature(25), False, duration, 1, envelope=True, **others)


def sine(frequency: float) -> Course:
    return Course(lambda t: np.sin(2 * pi * frequency * t), np.inf, "sine")


@pytest.mark.parametrize(("frequency", "output_rate"), [(3.0, 20.0), (20.0, 50.0), (30.0, 50.0)])
def test_the_scale_factor_of_a_sine_is_that_of_a_step(frequency: float, output_rate: float, residual) -> None:
    run = run_of(sine(frequency), 3.0, output_rate=output_rate)
    line = fit_line(simulate(run).record, run)
    assert line is not None and line.scale_factor is not None
    # The envelope holds the rate for 1 ms, which takes 0.15 % off 30 Hz. The rate between rows by straight lines made
    # 1.2 % at 3 Hz, and 0.74 instead of 1 at 30 Hz.
    residual("scale factor", abs(line.scale_factor - 1), 2e-3)


def test_pieces_of_a_long_record_are_the_whole(monkeypatch: pytest.MonkeyPatch) -> None:

    run = run_of(sine(3.0), 4.0, output_rate=20.0)
    whole = metrics.shown_rate(run)
    monkeypatch.setattr(metrics, "AT_ONCE", 1)
    later = np.arange(run.rows) * run.interval > run.settling
    # A piece begins 12 time constants earlier, e^-12 = 6e-6, at an edge of up to 1 rad/s.
    np.testing.assert_allclose(metrics.shown_rate(run)[later], whole[later], atol=2e-5)


def test_a_rate_that_stays_has_neither_bias_nor_scale_factor() -> None:
    run = run_of(constant(0.5, "0.5 rad/s"), 1.0)
    summary = summarise(run, simulate(run))
    assert summary["bias_deg_s"] is None and summary["scale_factor"] is None
    assert "stays at 28.65 °/s" in summary["warnings"][0]


def test_a_converter_that_hides_the_signal_is_told() -> None:
    # The plant's step, whatever the loops know of it.
    run = run_of(constant(0.0, "rest"), 1.0, DEVICE.with_parameters({"adc_lsb": 1.0}), design=DEVICE)
    record = simulate(run).record.with_columns(rate=pl.lit(0.0))
    assert "adc_lsb = 1 V" in metrics.warnings(run, record)[0]
    assert not metrics.warnings(run, simulate(run).record)


def test_errors_of_rows_that_hang_together_cover() -> None:
    # Rows of 10 ms behind a filter of 40 Hz: 150 known biases and the errors that are told of them.
    rows, z = 3000, []
    run = run_of(constant(0.0, "rest"), 30.0, DEVICE, output_rate=100.0)
    record = simulate(run).record
    rng = np.random.default_rng(1)
    kernel = np.exp(-np.arange(50) / 2.5)
    for _ in range(150):
        noise = np.convolve(rng.standard_normal(rows + 49), kernel, "valid")
        line = fit_line(record.with_columns(rate=noise), run)
        assert line is not None and line.bias is not None
        z.append(line.bias / line.bias_error)
    # Student's t of 19 has a deviation of 1.06; of 150 that is known to 6 %, and parts share a few percent.
    assert 0.9 < np.std(z) < 1.3


def test_thermal_noise_of_a_wide_split_does_not_fold_onto_rest() -> None:
    p = DEVICE.all_parameters
    kyy = p["m"] * (np.sqrt(p["kxx"] / p["m"]) + 2 * pi * 2000) ** 2
    run = run_of(constant(0.0, "rest"), 60.0, DEVICE.with_parameters({"kyy": kyy}), output_rate=10.0)
    found = allan_of(simulate(run).record, run)
    assert found is not None and run.interval == pytest.approx(0.1)
    expected = noise_limits(run.nominal, 298.15, 5e-6).total
    # Folded, it was 4 times as much; the error is some 10 %.
    assert abs(found[0].angle_random_walk - expected) < 3 * found[0].angle_random_walk_error
    assert found[0].angle_random_walk_error < 0.2 * expected


def test_what_the_harmonic_balance_leaves_out_is_named_with_the_reason() -> None:
    run = run_of(rate_step(0.3, 8.0), 1.0, QUIET.with_parameters({"ageing": 1e-6, "offset_x": 1e-3}))
    summary = summarise(run, simulate(run))
    assert summary["harmonic_balance"]["left_out"] == {"ageing": "changes with time"}
    assert summary["warnings"] == []
    assert summarise(plain := run_of(rate_step(0.3, 8.0), 1.0), simulate(plain))["harmonic_balance"]["left_out"] == {}


def test_an_effect_that_the_design_does_not_know_is_in_the_balance_of_the_device() -> None:
    # x² y moves the split: 2 k22 A²/4 of the stiffness of y, 0.08 N/m of the 0.4 that the modes are apart.
    device = QUIET.with_parameters({"k22": 1e10})
    unknown, known = run_of(rate_step(0.3, 8.0), 8.0, device, design=QUIET), run_of(rate_step(0.3, 8.0), 8.0, device)
    summary = summarise(unknown, simulate(unknown))
    assert summary["scale_factor"] == pytest.approx(0.91, abs=0.01)
    # Ω² of a rate of 0.3 rad/s pulls the split by 1e-6.
    assert summary["harmonic_balance"]["scale_factor"] == pytest.approx(summary["scale_factor"], abs=2e-5)
    assert summary["warnings"] == []
    assert summarise(known, simulate(known))["scale_factor"] == pytest.approx(1.0, abs=2e-5)


def test_what_the_balance_does_not_know_says_what_it_does() -> None:
    # A step of the damping after the calibration: force and bias follow.
    device = QUIET.with_parameters({"damping_step_factor": 3.0, "damping_step_time": 0.1})
    run = run_of(rate_step(0.3, 8.0), 8.0, device)
    [told] = summarise(run, simulate(run))["warnings"]
    assert "does not know damping_step (changes with time): the bias is" in told


def test_a_device_without_a_settled_state_is_said() -> None:
    # 1 N/m/V² at 100 V takes 1e4 N/m away, of 20; the design knows nothing of it.
    run = run_of(rate_step(0.3, 8.0), 1.0, QUIET)
    result = simulate(run)
    pulled, bias = QUIET.with_parameters({"softening": 1.0}), {"v_bias": constant(100.0, "100 V")}
    lost = replace(run, device=pulled, design=QUIET, others=bias)
    summary = summarise(lost, result)
    assert summary["harmonic_balance"]["scale_factor"] is None
    assert any("x has no stiffness left" in text for text in summary["warnings"])


def test_rows_that_come_less_often_than_asked_are_told() -> None:
    run = run_of(constant(0.0, "rest"), 1.0, output_rate=3333.0)
    [told] = summarise(run, simulate(run))["warnings"]
    assert told == "rows come 1000 a second, not 3333: each is a whole number of steps of 0.001 s"
    exact = run_of(constant(0.0, "rest"), 1.0, output_rate=500.0)
    assert summarise(exact, simulate(exact))["warnings"] == []


@pytest.mark.parametrize("name", ["sense_gain_x", "sense_gain_y", "angular_gain"])
def test_a_device_that_shows_no_rate_is_refused(name: str) -> None:
    with pytest.raises(InputError, match=f"{name} = 0: no rate would show"):
        run_of(constant(0.0, "rest"), 1.0, QUIET.with_parameters({name: 0.0}))


def test_an_amplitude_in_micrometres_is_asked_about() -> None:
    with pytest.raises(InputError, match="drive_amplitude = 4 m: in m; 4 µm are 4e-6"):
        run_of(constant(0.0, "rest"), 1.0, replace(QUIET, rate_mode={**QUIET.rate_mode, "drive_amplitude": 4.0}))


def test_a_clock_that_the_run_does_not_take_is_refused() -> None:
    with pytest.raises(InputError, match=r"give --sample-rate 1e\+06 instead"):
        run_of(constant(0.0, "rest"), 1.0, QUIET.with_parameters({"sample_period": 1e-6}))
