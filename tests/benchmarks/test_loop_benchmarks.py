"""What the measures of the loop are made of: drift, lies, random devices, effects drawn by seed."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import polars as pl
import pytest

from benchmarks import (
    loop_circle,
    loop_delays,
    loop_devices,
    loop_drift,
    loop_effects,
    loop_periods,
    loop_rates,
    loop_rest,
)
from benchmarks.closed_loop import sample_rows
from cosim.design import load_design
from cosim.master import simulate
from gyro_model.errors import InputError

T = np.arange(0, 1, 1e-3)


def result_of(error_deg, valid=None, sigma_deg=0.1, walk_deg=0.0):
    """A result whose angle C errs by ``error_deg``, and of which the loop says a drift and a walk [deg/s^0.5]."""
    columns = {
        "t": T,
        "angle_C": np.deg2rad(error_deg),
        "angle_true": np.zeros_like(T),
        "converged": np.ones_like(T, dtype=bool) if valid is None else valid,
        "drift_sigma": np.deg2rad(np.full_like(T, sigma_deg)),
        "drift_sigma_now": np.deg2rad(np.full_like(T, sigma_deg)),
        "stray_sigma": np.deg2rad(walk_deg * np.sqrt(T)),
    }
    return SimpleNamespace(trace=pl.DataFrame(columns), bounds=None)


def test_drift_is_the_slope_over_the_second_half():
    error = np.where(T < 0.5, 100 * T, 3.0 + 0.2 * T)
    assert loop_drift.drift(result_of(error)) == pytest.approx(0.2)
    assert loop_drift.predicted(result_of(error)) == pytest.approx(0.1)
    assert loop_drift.drift(result_of(np.where(T < 0.6, np.nan, error))) == np.inf


def test_a_walk_is_predicted_to_drift_as_it_does():
    walk, count = 0.03, 4000
    steps = walk * np.sqrt(T[1]) * np.random.default_rng(1).standard_normal((count, len(T)))
    drifts = [loop_drift.slope(T[T >= 0.5], error[T >= 0.5]) for error in np.cumsum(steps, axis=1)]
    predicted = loop_drift.predicted(result_of(0 * T, sigma_deg=0.0, walk_deg=walk))
    # Five deviations of a root mean square of `count` numbers, and the one of 500 steps that a difference lacks.
    assert np.std(drifts) == pytest.approx(predicted, rel=5 / np.sqrt(2 * count) + 0.002)


def test_steps_at_edges_are_no_drift_between_edges():
    edges = np.arange(0.05, 1, 0.05)
    run = SimpleNamespace(
        duration=1.0, scenario=SimpleNamespace(edges_until=lambda until: edges), device=None, sample_rate=1e3
    )
    steps = np.cumsum(np.sin(np.arange(len(edges) + 1)))[np.searchsorted(edges, T + 5e-7, side="right")]
    found = loop_drift.drift_between_edges(result_of(0.3 * T + steps), run)
    assert found == pytest.approx(0.3)


def test_a_lie_is_a_valid_angle_that_drifts():
    fast = np.where((T >= 0.3) & (T < 0.5), 2.0 * (T - 0.3), np.where(T < 0.3, 0.0, 0.4))
    lie = loop_drift.lie(result_of(fast))
    assert lie is not None
    assert 0.3 <= lie.t < 0.41
    assert lie.drift == pytest.approx(2.0)
    # Where the loop predicts as much, or has withdrawn the flag, nothing was said that is not so.
    assert loop_drift.lie(result_of(fast, sigma_deg=1.0)) is None
    assert loop_drift.lie(result_of(fast, valid=(T < 0.3) | (T > 0.5))) is None
    # Less than half a degree a second is no lie however sure the loop is.
    assert loop_drift.lie(result_of(0.4 * T, sigma_deg=0.01)) is None


@pytest.mark.parametrize("number", range(1, 40))
def test_random_devices_are_what_they_should_be(number):
    device = loop_devices.random_device(number)
    p = device.all_parameters
    assert p == loop_devices.random_device(number).all_parameters
    frequency = np.sqrt(p["kxx"] / p["m"]) / 2 / np.pi
    assert 1.5e3 <= frequency <= 15e3
    assert 300 <= p["m"] * 2 * np.pi * frequency / p["dxx"] <= 1e5
    assert abs(p["kxy"]) <= 0.1 * p["kxx"]
    assert loop_devices.sample_rate(device) >= 25 * loop_devices.highest_mode(device)
    for name, (low, high) in loop_devices.scaled_intervals(device).items():
        assert low <= p[name] <= high
    rounding, jitter = p["adc_lsb"] / np.sqrt(12), p["sampling_jitter"] * 2 * np.pi * frequency / np.sqrt(2)
    flicker = p["flicker_noise"] * np.sqrt(np.log(0.5 * loop_devices.sample_rate(device)))
    assert np.hypot(np.hypot(rounding, jitter), flicker) <= p["sense_noise"] * (1 + 1e-12)


def test_scaled_intervals_are_those_that_a_design_makes():
    device = loop_devices.random_device(1)
    design = load_design("lab", device, 1)
    own = loop_devices.scaled_intervals(device.with_parameters({"kxx": design.values["kxx"]}))
    for name, (low, high) in own.items():
        assert design.deviations[name] == pytest.approx((high - low) / 2 / 1.959964)


def test_a_run_that_fails_is_a_row(monkeypatch):
    def fail(run):
        raise InputError("the plant broke")

    monkeypatch.setattr(loop_devices, "simulate", fail)
    outcome = loop_devices.measure((1, 2))
    assert outcome.aborted
    assert not loop_devices.meets(outcome.values)
    assert "the plant broke" in outcome.why
    [line] = loop_devices.run_rows([outcome])
    assert line.what == "device 1 seed 2"
    assert loop_devices.summary_rows([outcome])


def test_every_effect_is_drawn_from_an_interval_that_its_design_has():
    for case in loop_effects.cases():
        run = loop_effects.the_run(case, 3)
        assert set(case.intervals) <= set(run.design.deviations)
        assert all(low <= run.device.all_parameters[n] <= high for n, (low, high) in case.intervals.items())
    with pytest.raises(InputError, match="cubic_stiffness"):
        loop_effects.find_case("cubic_stifness")


def test_rest_gives_bias_and_allan_deviation():
    report = loop_rest.make_report(["plain"], [1], 4.0, 1)
    assert [table.title for table in report.tables] == [
        "bias over its bound, all windows but the first",
        "plain, seed 1: bias in windows of 2 s",
        "plain, seed 1: Allan deviation",
    ]
    assert all(value is not None for line in report.tables[1].rows for value in line.values.values())


def test_random_rates_take_all_pairs_and_kinds_in_turn():
    every = len(loop_rates.PAIRS) * len(loop_rates.KINDS)
    seen = {loop_rates.the_run(seed)[:2] for seed in range(every)}
    assert len(seen) == every


@pytest.mark.parametrize("kind", loop_rates.KINDS)
def test_a_random_rate_is_what_its_kind_says(kind):
    for seed in range(20):
        rate = loop_rates.courses(kind, np.random.default_rng(seed))
        again = loop_rates.courses(kind, np.random.default_rng(seed))
        values, same = (sum(c.limits(T)[1] for c in each) for each in (rate, again))
        assert (values == same).all()
        if kind == "steps":
            assert np.abs(values).max() <= loop_rates.AMPLITUDE[1]
            assert len(np.unique(values)) <= 21
        if kind == "slopes":
            inside = np.abs(np.diff(values)) / np.diff(T)
            assert inside.max() <= loop_rates.SLOPE * (1 + 1e-9)
        if kind == "noise":
            # Forty sines of a Rayleigh distribution add up to the size that was drawn, within chance.
            assert np.std(values) <= 2 * loop_rates.AMPLITUDE[1]


def test_runs_without_a_lie_are_a_report(monkeypatch):
    # 11 valid windows in which the angle drifts by a quarter of what is predicted.
    good = dict(zip(loop_rates.COLUMNS, (0.1, 0.9, 11.0, 0.0, np.nan, 1 / 16), strict=True))
    monkeypatch.setattr(loop_rates, "in_processes", lambda f, seeds, jobs: [
        loop_rates.Outcome(0, "reference, plain", "sines", good)
    ])  # fmt: skip
    report = loop_rates.make_report([0], 1)
    [line] = report.tables[0].rows
    assert (line.values["of valid windows"], line.values["squared drift over prediction"]) == (11.0, 1 / 16)
    assert line.met == "yes"
    assert all(table.rows for table in report.tables)


def test_a_delay_that_is_not_found_is_shown_beside_those_that_are(monkeypatch):
    found = {"valid from [s]": 0.1, "angle C [°]": 0.02, "drift [°/s]": 0.1, "bound [°/s]": 0.04}
    lost = found | {"drift [°/s]": 0.16}
    monkeypatch.setattr(loop_delays, "in_processes", lambda f, items, jobs: [
        loop_delays.Outcome(200e3, 5e-6, 6.0, 1, found | {"windows that lie": 0.0, "delay off [s]": 1e-12}),
        loop_delays.Outcome(200e3, 5e-6, 6.0, 2, lost | {"windows that lie": 3.0, "delay off [s]": 2e-6}),
        loop_delays.Outcome(200e3, 5e-6, 6.0, 3, {}, "InputError: no"),
    ])  # fmt: skip
    shares, _, wrong = loop_delays.make_report([1], 1).tables
    assert [row.values["share"] for row in shares.rows] == [1 / 3, 1 / 3, 1.0, 1.0]
    assert [row.note for row in wrong.rows] == ["", "InputError: no"]


def test_late_commands_are_late_by_whole_periods_that_the_design_allows_for():
    for number in range(1, 21):
        device = loop_periods.late_device(number)
        delay, rate = device.all_parameters["actuator_delay"], loop_devices.sample_rate(device)
        assert round(delay * rate, 9) in (1.0, 2.0)
        low, high = loop_devices.scaled_intervals(device)["actuator_delay"]
        assert low < delay <= high
        alike = loop_devices.random_device(number).all_parameters
        assert {n for n, v in device.all_parameters.items() if v != alike[n]} == {"actuator_delay"}


def test_hidden_effects_are_drawn_from_those_that_need_nothing_to_show():
    for seed in range(30):
        parameters = loop_circle.hidden(seed)
        assert parameters == loop_circle.hidden(seed)
        assert not any(name.startswith(("tc", "softening", "acceleration")) for name in parameters)


def test_shares_of_a_sample_add_up():
    for line in sample_rows(timed=400, settling=400, repeats=1):
        values = line.values
        assert values["whole"] == pytest.approx(values["plant"] + values["observer"] + values["controller"])


def test_a_start_finds_the_lag_among_several_at_which_it_would_fit(residual):
    """A feedthrough of -9.2 V/N and a delay just below a period: the loop that looked at one lag ended at 2.3 us."""
    run = replace(loop_devices.the_run(1045, 3), duration=0.1)
    trace, device = simulate(run).trace, run.device.all_parameters
    # A fit held 0.37 us off is 184 above the least sum of squares, so that half a microsecond is room enough.
    error = abs(trace["est_amplifier_time_constant"][-1] - device["amplifier_time_constant"])
    residual("lag [us]", 1e6 * error, 0.5)
    # What such a lag is taken for: tau^2/2 of the gain.
    residual("feedthrough [V/N]", abs(trace["est_feedthrough"][-1] - device["feedthrough"]), 1.0)
