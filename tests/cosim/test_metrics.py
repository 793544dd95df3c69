"""Metrics against traces whose numbers are known beforehand."""

import json

import numpy as np
import polars as pl
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cosim.angle import sine_lag
from cosim.layout import PARAMETER_NAMES
from cosim.metrics import (
    ANGLE_NAMES,
    Bounds,
    angle_metrics,
    omega_metrics,
    parameter_metrics,
    run_lag,
    summarise,
)
from cosim.rate_profile import packaged_profile, true_angle
from cosim.recorder import Validity
from cosim.scenarios import scenario

PERIOD = 5e-5
NO_EDGES = np.empty(0)
VALIDITY = Validity(0.9, ((0.2, "dyy is not steady"),), True, "", "")
TRUE = dict(zip(PARAMETER_NAMES, (64.0, 96.0, 13.0, 1.8e-6, 1.8e-6, 3.6e-7, 1.8e-7), strict=True))


def trace(error=0.0, count=20_000, converged_from=2000):
    """A run of 1 s at 20 kHz; `error`: relative, of every parameter, number or shape (n,)."""
    t = np.arange(count) * PERIOD
    omega = scenario("constant").omega_z(0, count, PERIOD)
    theta = true_angle(omega, PERIOD)
    converged = np.arange(count) >= converged_from
    theta_valid = np.where(converged, theta - theta[min(converged_from, count - 1)], np.nan)
    columns = {"t": t, "omega_true": omega, "est_omega_z": omega + 0.1, "angle_true": theta_valid}
    columns |= {f"angle_{unit}": theta_valid + 0.01 for unit in "ABC"}
    columns |= {"drift_sigma": np.full(count, np.deg2rad(0.2)), "drift_sigma_now": np.full(count, np.deg2rad(0.1))}
    columns |= {"angle_sigma": np.full(count, np.deg2rad(0.05))}
    for name, value in TRUE.items():
        columns[f"true_{name}"] = np.full(count, value)
        columns[f"est_{name}"] = value * (1 + error) * np.ones(count)
    return pl.DataFrame(columns)


def test_within_1_percent_for_good():
    error = np.full(20_000, 0.3)
    error[4000:] = 0.005
    error[6000:6001] = -0.02
    found = parameter_metrics(trace(error), None)["kxx"]
    assert found["within_1_percent_at"] == pytest.approx(6001 * PERIOD)
    # One product and one quotient: rounding.
    assert found["relative_error"] == pytest.approx(0.005, abs=1e-15)
    assert found["true"] == 64.0
    assert found["estimate"] == pytest.approx(64.32)
    assert found["over_bound"] is None


@pytest.mark.parametrize(("error", "expected"), [(0.0, 0.0), (0.02, None)])
def test_within_1_percent_always_and_never(error, expected):
    assert parameter_metrics(trace(error), None)["m"]["within_1_percent_at"] == expected


def test_over_bound_interpolates_the_logarithm():
    t = np.array([0.01, 0.1, 2.0])
    relative = np.outer([1.0, 1e-2, 1e-4], np.arange(1, 8))
    bounds = Bounds(t, relative, np.ones(3), np.ones(3))
    np.testing.assert_allclose(
        bounds.relative_at(np.array([0.001, 0.055, 0.1, 5.0]))[:, 0], [np.nan, 0.1, 1e-2, np.nan]
    )
    late = Bounds(t[:2], relative[:2], np.ones(2), np.ones(2))
    found = parameter_metrics(trace(-3e-2), late)
    # The last known bound, at 0.1 s: 3 % over 1 % times the rank; rounding of 1 - 0.03.
    assert found["kxx"]["over_bound"] == pytest.approx(3.0)
    assert found["m"]["over_bound"] == pytest.approx(3.0 / 7)


def test_rate_error_leaves_out_edges_and_the_time_before_convergence():
    edges = scenario("constant").edges_until(1.0)
    table = trace()
    t = table["t"].to_numpy()
    wild = np.zeros(len(t), dtype=bool)
    for edge in edges:
        wild |= (t >= edge - 1e-9) & (t < edge + 0.02 - 1e-9)
    wild |= t < 0.1
    table = table.with_columns(est_omega_z=pl.col("omega_true") + np.where(wild, 50.0, -0.1))
    # All that is left is off by 0.1; rounding.
    assert omega_metrics(table, 0.1, edges)["rms_error"] == pytest.approx(0.1)
    assert omega_metrics(table, None, edges)["rms_error"] is None


def test_angle_numbers_by_hand():
    t = np.arange(20_001) * PERIOD
    truth = np.sin(t)
    drift = np.deg2rad(3.0)
    angle = truth + 0.2 + drift * t
    found = angle_metrics(t, angle, truth, np.zeros_like(t), 0.0, NO_EDGES)
    # Mean over the first 10 ms of a 3 deg/s drift: 0.015 deg less half a sample.
    start = 3.0 * (0.005 - PERIOD / 2)
    assert found["drift_deg_per_s"] == pytest.approx(3.0)
    assert found["max_deg"] == pytest.approx(3.0 - start)
    # rms of a ramp from -start to 3 - start; the sum over 2e4 samples is 5e-5 of the integral off.
    ramp = ((3 - start) ** 3 + start**3) / 9
    assert found["rms_deg"] == pytest.approx(np.sqrt(ramp), rel=1e-4)
    # The raw error keeps the 0.2 rad that it began with: a ramp from there to 3 deg more.
    begin = np.rad2deg(0.2)
    assert found["raw_max_deg"] == pytest.approx(begin + 3.0)
    assert found["raw_rms_deg"] == pytest.approx(np.sqrt(((begin + 3) ** 3 - begin**3) / 9), rel=1e-4)
    assert found["lag_s"] is None


def test_nothing_without_convergence():
    t = np.arange(100) * PERIOD
    found = angle_metrics(t, np.full(100, np.nan), t, t, None, NO_EDGES)
    assert found == dict.fromkeys(ANGLE_NAMES)


def test_reference_leaves_out_what_follows_an_edge():
    t = np.arange(2_000) * PERIOD
    edge = 0.04
    error = np.deg2rad(np.where((t >= edge) & (t < edge + 0.01), 1.0, 0.2))
    # Valid 5 ms before the edge, the 10 ms would be half of each; valid with it, there is nothing else.
    for begin, expected in ((edge - 0.005, 0.2), (edge, 1.0)):
        found = angle_metrics(t, error, np.zeros_like(t), np.zeros_like(t), begin, np.array([edge]))
        assert found["reference_deg"] == pytest.approx(expected)


@given(st.floats(-1e-3, 1e-3), st.floats(-0.1, 0.1))
def test_run_lag_agrees_with_the_sine_definition(lag, drift):
    t = np.arange(20_000) * PERIOD
    w = 2 * np.pi * 20
    truth, omega = 5 / w * np.sin(w * t), 5 * np.cos(w * t)
    angle = 5 / w * np.sin(w * (t - lag)) + 0.3 + drift * t
    found = run_lag(t, angle - truth, omega)
    by_sine = sine_lag(t, angle, truth)
    assert by_sine == pytest.approx(lag, abs=1e-12)
    # The regression returns sin(w lag)/w, (w lag)^2/6 = 0.3 % off at 1 ms, and as much again for
    # the slope of the rate, which the trends of the windows leave nearly orthogonal to it.
    assert found == pytest.approx(by_sine, rel=6e-3, abs=1e-9)


@pytest.mark.parametrize("name", ["constant", "varying"])
def test_run_lag_of_a_delay_in_both_embodiments(name):
    chosen = scenario(name)
    count = round(chosen.duration / PERIOD)
    t = np.arange(count) * PERIOD
    omega = chosen.omega_z(0, count, PERIOD)
    theta = true_angle(omega, PERIOD)
    late = np.interp(t - 4e-4, t, theta)
    found = angle_metrics(t, late, theta, omega, 0.1, chosen.edges_until(chosen.duration))
    # Edges are left out. Next in the series is lag^2/2 times the slope of the rate, w lag/2 = 1.3 %
    # of the lag's own term; without the trends of the windows the two are no longer orthogonal.
    assert found["lag_s"] == pytest.approx(4e-4, rel=1.3e-2)


def test_slow_rate_has_no_lag():
    t = np.arange(20_000) * PERIOD
    assert run_lag(t, 0.1 * t, 1 + 3 * t) is None
    assert run_lag(t[:0], t[:0], t[:0]) is None


def test_drift_that_depends_on_the_angle_is_no_lag():
    t = np.arange(20_000) * PERIOD
    omega = scenario("constant").omega_z(0, 20_000, PERIOD)
    theta = true_angle(omega, PERIOD)
    error = np.cumsum(0.01 * theta) * PERIOD
    found = angle_metrics(t, theta + error, theta, omega, 0.0, scenario("constant").edges_until(1.0))
    # The mimicked lag at 10 Hz: 0.01/(20 pi)^2 = 2.5 us.
    assert abs(found["lag_s"]) < 5e-6


def test_hand_motion_is_too_slow_for_a_lag():
    omega = packaged_profile().held(0.0, 0, 60_000, 1e-4)
    t = np.arange(60_000) * 1e-4
    assert omega.std() > 0.5
    assert run_lag(t, -4e-4 * omega, omega) is None


def test_summary_is_strict_json_with_the_agreed_names():
    table = trace(1e-3).with_columns(est_k3_x=pl.lit(1.9e9))
    found = summarise(
        table,
        scenario="constant",
        seed=3,
        unit="A",
        converged_at=0.1,
        edges=scenario("constant").edges_until(1.0),
        bounds=None,
        validity=VALIDITY,
        extra={"k3_x": 2e9},
        real_time_factor=np.float64(2.0),
        run={"device": "reference"},
    )
    again = json.loads(json.dumps(found, allow_nan=False))
    assert again == found
    assert list(found)[:9] == [
        "scenario",
        "seed",
        "converged_at",
        "valid",
        "predicted",
        "effects",
        "parameters",
        "omega",
        "angle",
    ]
    assert found["valid"] == {
        "share": 0.9,
        "withdrawn": [{"t": 0.2, "reason": "dyy is not steady"}],
        "now": True,
        "reason": "",
        "stopped": "",
    }
    assert found["effects"] == {"k3_x": {"true": 2e9, "estimate": 1.9e9}}
    # Degrees to radians and back: two roundings.
    assert found["predicted"]["drift_sigma_deg_per_s"] == pytest.approx(0.2, rel=1e-15)
    assert found["predicted"]["drift_sigma_now_deg_per_s"] == pytest.approx(0.1, rel=1e-15)
    assert found["predicted"]["angle_sigma_deg"] == pytest.approx(0.05, rel=1e-15)
    assert found["predicted"]["drift_bound_deg_per_s"] is None
    assert list(found["parameters"]) == list(PARAMETER_NAMES)
    assert found["angle"] == {"unit": "A", **found["angle_units"]["A"]}
    # A constant offset is no error: rounding of 0.01 rad in degrees.
    assert found["angle"]["rms_deg"] == pytest.approx(0.0, abs=1e-12)


def test_summary_of_a_run_that_never_converged():
    table = trace(np.nan, converged_from=10**9).with_columns(
        drift_sigma=pl.lit(np.inf), drift_sigma_now=pl.lit(np.inf), angle_sigma=pl.lit(np.inf)
    )
    found = summarise(
        table,
        scenario="motion",
        seed=0,
        unit="C",
        converged_at=float("nan"),
        edges=NO_EDGES,
        bounds=None,
        validity=Validity(0.0, (), False, "dyy is not sure", ""),
        extra={},
        real_time_factor=float("inf"),
        run={},
    )
    json.dumps(found, allow_nan=False)
    assert found["converged_at"] is None
    assert found["predicted"]["drift_sigma_deg_per_s"] is None
    assert found["valid"]["now"] is False
    assert found["angle"]["rms_deg"] is None
    assert found["parameters"]["kxx"]["within_1_percent_at"] is None
    assert found["real_time_factor"] is None
