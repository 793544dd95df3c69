"""Scenarios: the held rate by hand, and its integral at any sample rate."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cosim.rate_profile import packaged_profile, true_angle
from cosim.scenarios import (
    DESCRIPTIONS,
    INPUT_NAMES,
    load_scenario,
    scenario,
    scenario_names,
)
from gyro_model.errors import InputError

PERIOD = 5e-6


def square_angle(t):
    """Integral of the square wave: a triangle of 0.25 rad."""
    return 0.25 - np.abs(np.mod(t, 0.1) - 0.05) * 5


def test_square_wave_by_hand():
    rate = scenario("constant").omega_z(0, 200_000, PERIOD)
    assert (rate[:10_000] == 5.0).all()
    assert (rate[10_000:20_000] == -5.0).all()
    assert (rate[190_000:] == -5.0).all()
    assert set(np.unique(rate)) == {-5.0, 5.0}


def test_varying_by_hand():
    rate = scenario("varying").omega_z(0, 200_000, PERIOD)
    square = scenario("constant").omega_z(0, 110_000, PERIOD)
    np.testing.assert_array_equal(rate[:110_000], square)
    middle = (np.arange(110_000, 200_000) + 0.5) * PERIOD
    # Mean over a hold against its middle: (pi f T)^2 / 6 = 4e-9, of 5 rad/s.
    np.testing.assert_allclose(rate[110_000:], 5 * np.sin(20 * np.pi * middle), atol=1e-7)


@given(st.floats(20e3, 400e3))
def test_angle_does_not_depend_on_the_sample_rate(sample_rate):
    period = 1 / sample_rate
    count = int(0.3 * sample_rate)
    held = scenario("constant").omega_z(0, count, period)
    angle = true_angle(held, period)
    # A hold across an edge has the mean rate, so every instant is exact: 1e5 additions round
    # to 1e-12; a boundary within 1e-9 of an edge (5e-11 s) is moved onto it: 5e-10 rad at each of five edges.
    np.testing.assert_allclose(angle, square_angle(np.arange(count) * period), atol=2.5e-9)


@settings(max_examples=30)
@given(st.sampled_from(sorted(DESCRIPTIONS)), st.integers(0, 190_000), st.integers(1, 10_000))
def test_blocks_change_no_bit(name, first, count):
    chosen = scenario(name)
    whole = chosen.omega_z(0, 200_000, PERIOD)
    np.testing.assert_array_equal(chosen.omega_z(first, count, PERIOD), whole[first : first + count])


def test_edges():
    constant, varying = scenario("constant"), scenario("varying")
    np.testing.assert_allclose(constant.edges_until(0.21), [0.05, 0.1, 0.15, 0.2])
    assert len(constant.edges_until(1.0)) == 19
    np.testing.assert_allclose(varying.edges_until(1.0), np.arange(1, 12) * 0.05)
    assert len(varying.edges_until(0.1)) == 1
    assert scenario("motion").edges_until(6.0).size == 0


def test_device_changes_and_units():
    assert scenario("constant").parameters == {"x_start": 1e-6}
    assert scenario("varying").parameters == {
        "x_start": 1e-6,
        "damping_step_factor": 2.0,
        "damping_step_time": 0.45,
    }
    assert [scenario(name).angle_unit for name in ("constant", "varying", "motion")] == ["A", "B", "C"]


# The formulas that the two embodiments had before they were files: they gave every committed measure.


def former_square(first, count, period):
    edge = np.arange(first, first + count + 1) * period / 0.05
    nearest_edge = np.rint(edge)
    edge = np.where(np.abs(edge - nearest_edge) < 1e-9 * np.maximum(1, edge), nearest_edge, edge)
    begin, end = edge[:-1], edge[1:]
    index = np.floor(begin)
    sign = 1 - 2 * np.mod(index, 2)
    after = np.maximum(end - (index + 1), 0.0) / (end - begin)
    return 5.0 * sign * (1 - 2 * after)


def former_sine(first, count, period):
    middle = (np.arange(first, first + count) + 0.5) * period
    return 5.0 * float(np.sinc(10.0 * period)) * np.sin(2 * np.pi * 10.0 * middle)


def former_varying(first, count, period):
    starts_sine = (np.arange(first, first + count) + 0.5) * period > 0.55
    return np.where(starts_sine, former_sine(first, count, period), former_square(first, count, period))


@pytest.mark.parametrize("sample_rate", [1e3, 20e3, 44.1e3, 48e3, 1e5, 2e5, 4e5, 1e6, 123456.7])
def test_constant_has_the_bits_it_had(sample_rate):
    period, count = 1 / sample_rate, int(1.2 * min(sample_rate, 4e5))
    held = scenario("constant").omega_z(0, count, period)
    assert held.tobytes() == former_square(0, count, period).tobytes()


@pytest.mark.parametrize("sample_rate", [1e3, 20e3, 48e3, 1e5, 2e5, 4e5, 1e6])
def test_varying_has_the_bits_it_had(sample_rate):
    period, count = 1 / sample_rate, int(1.2 * sample_rate)
    held = scenario("varying").omega_z(0, count, period)
    assert held.tobytes() == former_varying(0, count, period).tobytes()


def test_varying_off_the_grid_has_the_mean_of_the_hold_that_was_all_one_or_the_other():
    sample_rate = 123456.7
    period, count = 1 / sample_rate, int(1.2 * sample_rate)
    held, former = scenario("varying").omega_z(0, count, period), former_varying(0, count, period)
    [row] = np.flatnonzero(held != former)
    share = 0.55 * sample_rate - row
    # The square is at +5 until then; the sine begins at 0 and in one hold falls to 5 sin(5e-4) = 2.5e-3.
    assert held[row] == pytest.approx(5 * share, abs=2.5e-3)


def test_packaged_scenarios_bear_their_names_and_run_to_their_end():
    assert scenario_names() == ["constant", "motion", "rest", "spin", "staircase", "varying"]
    for name in scenario_names():
        chosen = load_scenario(name)
        assert chosen.name == name
        assert chosen.description == DESCRIPTIONS[name]
        last = chosen.inputs(round(chosen.duration / 1e-3) - 1, 1, 1e-3)
        assert last.shape == (1, len(INPUT_NAMES))


def test_rest_and_spin():
    rest = load_scenario("rest").inputs(5, 4, PERIOD)
    np.testing.assert_array_equal(rest, np.tile([0.0, 298.15, 0.0, 0.0, 0.0], (4, 1)))
    assert rest.flags.c_contiguous
    assert load_scenario("rest").edges_until(20.0).size == 0
    np.testing.assert_array_equal(load_scenario("spin").omega_z(0, 3, PERIOD), [2.0, 2.0, 2.0])


def test_staircase_goes_through_both_full_scales_in_plateaus_of_a_second():
    chosen = load_scenario("staircase")
    wave = chosen.omega_z(0, 1000, 1e-3).reshape(20, 50)
    np.testing.assert_array_equal(wave, np.tile([[5.0], [-5.0]], (10, 50)))
    held = chosen.omega_z(1000, 37_000, 1e-3).reshape(37, 1000)
    assert (held == held[:, :1]).all()
    levels = held[:, 0]
    assert levels[0] == levels[18] == levels[36] == 0.0
    np.testing.assert_array_equal(levels[18:], -levels[:19])
    np.testing.assert_array_equal(levels[:19], levels[18::-1])
    assert levels.max() == 5.0
    edges = chosen.edges_until(chosen.duration)
    np.testing.assert_array_equal(edges[edges > 1.0], np.arange(2.0, 38.0))


def test_the_rate_alone_is_the_first_column():
    for name in scenario_names():
        chosen = load_scenario(name)
        np.testing.assert_array_equal(chosen.omega_z(70, 9, PERIOD), chosen.inputs(70, 9, PERIOD)[:, 0])


def test_the_packaged_motion_is_the_file_that_motion_takes():
    np.testing.assert_array_equal(
        load_scenario("motion").omega_z(0, 1000, 1e-3), scenario("motion").omega_z(0, 1000, 1e-3)
    )


def test_motion_follows_the_profile():
    chosen = scenario("motion", packaged_profile(), start=2.0)
    assert chosen.duration == pytest.approx(4.0)
    np.testing.assert_array_equal(chosen.omega_z(100, 50, PERIOD), packaged_profile().held(2.0, 100, 50, PERIOD))


def test_bad_choices_are_named():
    with pytest.raises(InputError, match="'constnat' is not known; did you mean 'constant'"):
        scenario("constnat")
    with pytest.raises(InputError, match="run 'motion' with it"):
        scenario("constant", packaged_profile())
    with pytest.raises(InputError, match="start 7 s lies outside"):
        scenario("motion", start=7.0)
