"""Angle units against a pattern whose angle is known in closed form."""

from dataclasses import fields, replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import signal

from cosim.angle import UNIT_NAMES, AngleUnit, Block, make_units, ripple, sine_lag, unwrapped
from cosim.angle_filters import Filter, band_pass, low_pass
from gyro_model.errors import InputError

SAMPLE_RATE = 200e3
FREQUENCY = 3000.0
OMEGA = 2 * np.pi * FREQUENCY
AMPLITUDE = 1e-6
TONES = ((450.0, 32e-6), (500.0, 32e-6))
STIFFNESS = 63.955
SETTLED = 0.03
"""The slowest pole lies at 200 Hz / 1.33: after 30 ms its memory has fallen to 5e-13."""


def pattern(theta, theta_dot, tones=True, minor=0.0, converged_from=SETTLED, lambda_=1.0):
    """Orbit of an isotropic lossless oscillator (TW 201137310, eq. 1, with k, d, u cancelled).

    x + j y = exp(-j lambda theta) (a cos wt + j b sin wt) plus the steady response to the tones;
    theta [rad] and its rate [rad/s], shape (n,); minor: b over a.
    """
    n = len(theta)
    t = np.arange(n) / SAMPLE_RATE
    body = AMPLITUDE * (np.cos(OMEGA * t) + 1j * minor * np.sin(OMEGA * t))
    body_dot = AMPLITUDE * OMEGA * (-np.sin(OMEGA * t) + 1j * minor * np.cos(OMEGA * t))
    turn = np.exp(-1j * lambda_ * theta)
    z, z_dot = turn * body, turn * (body_dot - 1j * lambda_ * theta_dot * body)
    forced = np.zeros((4, n))
    if tones:
        for axis, (frequency, force) in enumerate(TONES):
            w = 2 * np.pi * frequency
            reach = force / (STIFFNESS * (1 - (w / OMEGA) ** 2))
            forced[2 * axis] = reach * np.sin(w * t)
            forced[2 * axis + 1] = reach * w * np.cos(w * t)
    states = np.stack((z.real, z_dot.real, z.imag, z_dot.imag)) + forced
    converged = t >= converged_from - 1e-9
    squared = np.full(n, OMEGA**2)
    return Block(t, states, forced, np.zeros((4, n)), squared, converged, lambda_, np.zeros(n), lambda_ * theta_dot)


def steady(rate, duration, **options):
    theta = rate * np.arange(round(duration * SAMPLE_RATE)) / SAMPLE_RATE
    return pattern(theta, np.full_like(theta, rate), **options), theta


def swing(frequency, amplitude, duration, **options):
    phase = 2 * np.pi * frequency * np.arange(round(duration * SAMPLE_RATE)) / SAMPLE_RATE
    theta_dot = 2 * np.pi * frequency * amplitude * np.cos(phase)
    return pattern(amplitude * np.sin(phase), theta_dot, **options), amplitude * np.sin(phase)


def parts(block: Block, cuts: list[int]) -> list[Block]:
    """The block divided before each of the sample indexes."""
    edges = [0, *sorted(cuts), len(block.t)]
    arrays = {f.name: getattr(block, f.name) for f in fields(block) if f.name != "lambda_"}
    return [replace(block, **{name: a[..., low:high] for name, a in arrays.items()}) for low, high in pairwise(edges)]


# What the tones leave in a still angle [deg rms], measured 0.005 (A) and 0.011 (B); C subtracts
# the tones exactly here, and rounding is left.
LEFT_DEG = {"A": 0.01, "B": 0.02, "C": 1e-9}


def turning_ripple(name, rate):
    """Amplitude [rad] of what the turning itself adds to phi of unit B, at twice the oscillation frequency; the others
    take it out.

    x' holds rate * y beside the oscillation's velocity: by first-order expansion of eq. 9.
    """
    return abs(rate) / (2 * OMEGA) if name == "B" else 0.0


@pytest.mark.parametrize("name", UNIT_NAMES)
@pytest.mark.parametrize("rate", [5.0, -5.0, 40.0])
def test_steady_rate_is_followed_without_lag(name, rate):
    block, theta = steady(rate, 0.5)
    angle, _ = make_units(SAMPLE_RATE, FREQUENCY)[name].process(block)
    first = int(block.converged.argmax())
    error = np.rad2deg(angle[first:] - (theta - theta[first])[first:])
    ripple = np.rad2deg(turning_ripple(name, rate))
    assert np.sqrt(np.mean((error - error.mean()) ** 2)) < LEFT_DEG[name] + ripple
    # The zero is taken on one sample, so what ripples in that sample stays as an offset.
    assert abs(error.mean()) < 3 * LEFT_DEG[name] + ripple


@pytest.mark.parametrize("name", UNIT_NAMES)
def test_angle_goes_on_past_half_turns(name):
    block, _ = steady(-60.0, 0.4, tones=False)
    angle, _ = make_units(SAMPLE_RATE, FREQUENCY)[name].process(block)
    # 0.37 s of 60 rad/s are seven half turns. The ripple counts twice, at the zero and at the end.
    expected = -60.0 * (block.t[-1] - SETTLED)
    assert angle[-1] == pytest.approx(expected, abs=2 * turning_ripple(name, 60.0) + np.deg2rad(6 * LEFT_DEG[name]))
    assert np.abs(np.diff(angle[block.converged])).max() < 2 * 60.0 / SAMPLE_RATE


@pytest.mark.parametrize("name", UNIT_NAMES)
def test_zero_at_convergence_and_no_number_before(name):
    block, _ = steady(5.0, 0.1)
    angle, quality = make_units(SAMPLE_RATE, FREQUENCY)[name].process(block)
    first = int(block.converged.argmax())
    assert np.isnan(angle[:first]).all()
    assert angle[first] == 0.0
    assert np.isfinite(angle[first:]).all()
    assert ((quality >= 0) & (quality <= 1)).all()


def test_convergence_is_remembered():
    block, _ = steady(5.0, 0.1)
    late = replace(block, converged=(block.t >= SETTLED) & (block.t < 0.05))
    for name in UNIT_NAMES:
        expected, _ = make_units(SAMPLE_RATE, FREQUENCY)[name].process(block)
        angle, _ = make_units(SAMPLE_RATE, FREQUENCY)[name].process(late)
        np.testing.assert_array_equal(angle, expected)


def test_angular_gain_divides_the_angle():
    block, theta = steady(5.0, 0.2, tones=False, lambda_=0.7)
    angle, _ = make_units(SAMPLE_RATE, FREQUENCY)["C"].process(block)
    first = int(block.converged.argmax())
    # Rounding of an angle of 1 rad and of a phase of 4e3 rad.
    np.testing.assert_allclose(angle[first:], (theta - theta[first])[first:], atol=1e-11)


def test_what_the_controller_turned_is_taken_off():
    block, theta = steady(5.0, 0.2, tones=False)
    # A pattern that the rate turns by -5 rad/s, and the controller says that it did -7 rad/s of it.
    told = replace(block, turned=-7.0 * block.t)
    angle, _ = make_units(SAMPLE_RATE, FREQUENCY)["C"].process(told)
    first = int(block.converged.argmax())
    expected = (theta - 7.0 * block.t)[first:]
    np.testing.assert_allclose(angle[first:], expected - expected[0], atol=1e-11)


@pytest.mark.parametrize("name", UNIT_NAMES)
def test_tones_near_the_oscillation_are_taken_off_before_any_filter(name):
    plain, _ = steady(5.0, 0.1)
    w = 0.9 * OMEGA
    # 0.3 um at 2700 Hz, well inside the band-pass of unit A and the low-pass' image of it.
    near = 0.3e-6 * np.outer([1.0, 0.0, 0.5, 0.0], np.sin(w * plain.t)) + 0.3e-6 * w * np.outer(
        [0.0, 1.0, 0.0, 0.5], np.cos(w * plain.t)
    )
    toned = replace(plain, states=plain.states + near, near=near, forced=plain.forced + near)
    expected, quality = make_units(SAMPLE_RATE, FREQUENCY)[name].process(plain)
    angle, with_tones = make_units(SAMPLE_RATE, FREQUENCY)[name].process(toned)
    # Added and subtracted again: rounding of 1e-6 m in 1e-16, which the band-pass leaves as it is.
    np.testing.assert_allclose(angle, expected, atol=1e-9)
    np.testing.assert_allclose(with_tones, quality, atol=1e-9)


@pytest.mark.parametrize("minor", [0.0, 0.3, 0.8, 1.0])
def test_quality_by_hand(minor):
    block, _ = steady(0.0, 0.1, tones=False, minor=minor)
    expected = (1 - minor**2) / (1 + minor**2)
    for name in UNIT_NAMES:
        _, quality = make_units(SAMPLE_RATE, FREQUENCY)[name].process(block)
        # The band-pass starts from rest: its memory after 30 ms is below 1e-9.
        np.testing.assert_allclose(quality[block.converged], expected, atol=1e-8)


@settings(max_examples=25)
@given(st.lists(st.integers(0, 12000), max_size=8))
def test_blocks_change_no_bit(cuts):
    block, _ = swing(20.0, 0.3, 0.06)
    for name in UNIT_NAMES:
        whole = np.stack(make_units(SAMPLE_RATE, FREQUENCY)[name].process(block))
        unit: AngleUnit = make_units(SAMPLE_RATE, FREQUENCY)[name]
        pieces = [np.stack(unit.process(part)) for part in parts(block, cuts) if len(part.t)]
        np.testing.assert_array_equal(np.concatenate(pieces, axis=1), whole)


@pytest.mark.parametrize("shape", ["lag_free", "butterworth"])
@pytest.mark.parametrize("name", ["A", "B"])
def test_lag_of_a_run_is_that_of_the_filter(name, shape):
    block, theta = swing(20.0, 0.04, 0.5)
    unit = make_units(SAMPLE_RATE, FREQUENCY, shape)[name]
    angle, _ = unit.process(block)
    # Two derivations: side bands of the frequency response, and a fit to the unit's output. The
    # tones' ripple of 0.011 deg = 2e-4 rad averages over 9e4 samples to 1e-6 of 0.04 rad.
    assert sine_lag(block.t, angle, theta) == pytest.approx(unit.filter.swing_lag(20.0), abs=1e-6)


@pytest.mark.parametrize(("minor", "error_deg"), [(0.3, 0.5), (0.5, 6.3)])
def test_tones_larger_than_the_pattern_cost_no_half_turns(minor, error_deg):
    block, theta = steady(5.0, 1.0, minor=minor)
    angle, _ = make_units(SAMPLE_RATE, FREQUENCY)["B"].process(block)
    first = int(block.converged.argmax())
    # The tones reach 0.73 um, a - b is 0.7 and 0.5 um: whenever they peak together phi goes round
    # the other way. The errors are as measured, with half as much again; a half turn would be 180.
    error = np.rad2deg(angle[first:] - (theta - theta[first])[first:])
    assert np.abs(error).max() < 1.5 * error_deg


def test_lag_of_the_unfiltered_unit_is_nothing():
    block, theta = swing(20.0, 0.04, 0.3)
    angle, _ = make_units(SAMPLE_RATE, FREQUENCY)["C"].process(block)
    # The goal is 50 us; what is left is the rounding of the fit.
    assert abs(sine_lag(block.t, angle, theta)) < 1e-8


@given(st.floats(-5e-3, 5e-3), st.floats(-1, 1), st.floats(-1, 1))
def test_sine_lag_sees_through_offset_and_drift(lag, offset, drift):
    t = np.arange(6000) / 20e3
    truth = 0.04 * np.sin(2 * np.pi * 20 * t + 0.4)
    angle = 0.04 * np.sin(2 * np.pi * 20 * (t - lag) + 0.4) + offset + drift * t
    angle[:700] = np.nan
    # A linear fit of an exact model: rounding only.
    assert sine_lag(t, angle, truth) == pytest.approx(lag, abs=1e-12)


@pytest.mark.parametrize("frequency", [1000.0, 3000.0, 14000.0])
@pytest.mark.parametrize("shape", ["lag_free", "butterworth"])
@pytest.mark.parametrize("make", [band_pass, low_pass])
def test_filter_bands_scale_with_the_oscillation(make, shape, frequency):
    design: Filter = make(SAMPLE_RATE, frequency, shape)
    scale = frequency / FREQUENCY
    printed = (2541.4, 3541.4) if make is band_pass else (0.0, 200.0)
    # The printed edges to their last digit.
    np.testing.assert_allclose(design.band_hz, np.multiply(printed, scale), rtol=1e-5)
    edge_db, _ = design.response(np.array([design.band_hz[1]]))
    # Half power by construction; only rounding.
    assert edge_db[0] == pytest.approx(10 * np.log10(0.5), abs=1e-6)
    if make is band_pass:
        low_db, _ = design.response(np.array([design.band_hz[0]]))
        # The bilinear map bends the low edge by a part in (pi f/fs)^2 = 0.05 at 14 kHz.
        assert low_db[0] == pytest.approx(10 * np.log10(0.5), abs=0.2)
        assert design.response(np.array([frequency]))[0][0] == pytest.approx(0, abs=1e-6)


@pytest.mark.parametrize("make", [band_pass, low_pass])
def test_lag_free_filters_have_no_group_delay(make):
    # Rounding against the delays of the single sections, about 1 ms.
    assert abs(make(SAMPLE_RATE, FREQUENCY).group_delay) < 1e-12


def test_butterworth_equals_scipy():
    design = low_pass(SAMPLE_RATE, FREQUENCY, "butterworth")
    expected = signal.butter(4, 200.0, fs=SAMPLE_RATE, output="sos")
    frequency = np.array([20.0, 200.0, 2000.0])
    _, response = signal.sosfreqz(expected, worN=frequency, fs=SAMPLE_RATE)
    # Two orders of the same roots: rounding, seen in dB.
    np.testing.assert_allclose(design.response(frequency)[0], 20 * np.log10(np.abs(response)), atol=1e-6)
    # Group delay of an analogue Butterworth of order 4 at zero: 2.613 / (2 pi 200 Hz).
    assert design.group_delay == pytest.approx(2.6131 / (2 * np.pi * 200), rel=1e-4)


def test_filter_that_does_not_fit_is_refused():
    with pytest.raises(InputError, match="sample rate 6000 Hz is too low"):
        make_units(6000.0, FREQUENCY)


@pytest.mark.parametrize(("name", "off"), [("A", 1.025), ("B", 1.025), ("B", 0.7)])
def test_filters_follow_the_oscillation_that_the_observer_found(name, off):
    # 2.5 % beside the nominal frequency, as where unknown sensors make the mass seem 5 % larger; 30 % as a first
    # estimate may be.
    block, theta = swing(20.0, 0.05, 0.3)
    unit = make_units(SAMPLE_RATE, FREQUENCY * off)[name]
    angle, _ = unit.process(block)
    assert unit.filter is not None
    # Centre and band are those of the frequency found, to rounding.
    found = make_units(SAMPLE_RATE, FREQUENCY)[name].filter
    assert unit.filter.centre_hz == pytest.approx(found.centre_hz, rel=1e-12)
    assert unit.filter.band_hz == pytest.approx(found.band_hz, rel=1e-12)
    settled = block.t > 2 * SETTLED
    lag = sine_lag(block.t[settled], angle[settled], theta[settled])
    # As for the filter designed there at once; away from its centre the same filter is 0.6 ms off.
    assert lag == pytest.approx(unit.filter.swing_lag(20.0), abs=2e-6)


@given(st.integers(0, 2**32 - 1))
def test_an_angle_is_unwrapped_as_numpy_does_whatever_is_no_number(seed: int) -> None:
    rng = np.random.default_rng(seed)
    phi = np.cumsum(rng.normal(0.0, 0.2, 400))
    raw = np.mod(phi + np.pi / 2, np.pi) - np.pi / 2
    lost = rng.random(400) < 0.1
    begins = np.flatnonzero(lost[:-1]) + 1
    found = unwrapped(np.where(lost, np.nan, raw))
    assert (np.isnan(found) == lost).all()
    for stretch in np.split(np.arange(400), begins):
        kept = stretch[~lost[stretch]]
        if len(kept):
            expected = np.unwrap(raw[kept], period=np.pi)
            np.testing.assert_allclose(found[kept] - found[kept[0]], expected - expected[0], atol=1e-12)


def test_the_ripple_is_what_goes_with_twice_the_oscillation() -> None:
    t = np.arange(2000) / SAMPLE_RATE
    cycle = round(SAMPLE_RATE / FREQUENCY)
    # A turn is none, and neither is an angle however large: 1e6 rad leave 1e-10 of rounding.
    assert ripple(1e6 + 100.0 * t, cycle) < 1e-9
    found = ripple(10.0 * t + 3e-4 * np.sin(2 * OMEGA * t), cycle)
    # 67 samples are 1.005 cycles, over which the sine has a mean of 0.005 of its amplitude; the record begins and ends
    # at some phase of 58 of its cycles.
    assert found == pytest.approx(3e-4 / np.sqrt(2), rel=0.02)
    assert np.isnan(ripple(np.zeros(cycle - 1), cycle))
