"""Measured rate profiles: what is refused, and that the held rate keeps the angle."""

import gzip
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cosim.profiles import hand_motion
from cosim.rate_profile import packaged_profile, read_profile, true_angle
from gyro_model.errors import InputError

MEASURED = Path(__file__).parents[3] / "shared" / "data" / "motion" / "sensor_data.csv.gz"
PERIOD = 5e-6


@pytest.fixture
def table(tmp_path):
    """A table of a cubic rate on an uneven grid: time, rate [rad/s], and a column of words."""
    t = np.array([0.0, 0.1, 0.25, 0.3, 0.42, 0.5])
    rate = 1 + 2 * t - 3 * t**2 + 4 * t**3
    rows = [f"{a!r},{b!r},word" for a, b in zip(t.tolist(), rate.tolist(), strict=True)]
    path = tmp_path / "rate.csv"
    path.write_text("\n".join(["time,rate_z,note", *rows]) + "\n", encoding="utf-8")
    return path


def cubic_angle(t):
    return t + t**2 - t**3 + t**4


def test_held_rate_keeps_the_angle_of_the_curve(table):
    profile = read_profile(table, "rate_z", "rad/s")
    held = profile.held(0.0, 0, 100_000, PERIOD)
    t = np.arange(100_000) * PERIOD
    # A spline reproduces a cubic; 1e5 additions of 1e-5 rad round to 1e-12.
    np.testing.assert_allclose(true_angle(held, PERIOD), cubic_angle(t), atol=1e-11)


def test_start_moves_along_the_record(table):
    profile = read_profile(table, "rate_z", "rad/s")
    held = profile.held(0.2, 0, 1000, PERIOD)
    angle = cubic_angle(0.2 + 1000 * PERIOD) - cubic_angle(0.2)
    # Rounding of a difference of angles of 0.25 rad.
    assert held.sum() * PERIOD == pytest.approx(angle, abs=1e-14)


def test_degrees_and_gzip(table, tmp_path):
    packed = tmp_path / "rate.csv.gz"
    packed.write_bytes(gzip.compress(table.read_bytes()))
    in_radians = read_profile(table, "rate_z", "rad/s").held(0.0, 0, 100, PERIOD)
    in_degrees = read_profile(packed, "rate_z", "deg/s").held(0.0, 0, 100, PERIOD)
    # The held rate is a difference of angles over 5 us: 1e-16 rad of rounding is 2e-11 rad/s.
    np.testing.assert_allclose(in_degrees, np.deg2rad(in_radians), atol=1e-10)


def test_the_unit_is_that_of_the_heading_and_is_never_guessed(table, tmp_path):
    named = tmp_path / "named.csv"
    named.write_text(table.read_text(encoding="utf-8").replace("rate_z", "rate_z [rad/s]"), encoding="utf-8")
    stated = read_profile(named, "rate_z [rad/s]").held(0.0, 0, 100, PERIOD)
    np.testing.assert_array_equal(stated, read_profile(table, "rate_z", "rad/s").held(0.0, 0, 100, PERIOD))
    with pytest.raises(InputError, match="names no unit: give --rate-unit deg/s or rad/s"):
        read_profile(table, "rate_z")
    with pytest.raises(InputError, match="is in rad/s by its heading, not in deg/s"):
        read_profile(named, "rate_z [rad/s]", "deg/s")


@settings(max_examples=30)
@given(st.integers(0, 90_000), st.integers(1, 5000))
def test_blocks_change_no_bit(first, count):
    profile = packaged_profile()
    whole = profile.held(1.0, 0, 100_000, PERIOD)
    np.testing.assert_array_equal(profile.held(1.0, first, count, PERIOD), whole[first : first + count])


def test_packaged_profile_is_what_its_maker_writes():
    assert hand_motion.PATH.read_text(encoding="utf-8") == hand_motion.text(), (
        "stale: run python -m cosim.profiles.hand_motion"
    )


def test_packaged_profile_is_a_hand_turning():
    profile = packaged_profile()
    rate = np.rad2deg(profile.held(0.0, 0, 6000, 1e-3))
    assert profile.length == pytest.approx(6.0)
    assert 130 < np.abs(rate).max() < 170
    # No jump: tremor of 12 Hz and 4 deg/s in all changes by 0.3 deg/s in 1 ms, a turn by 1.
    assert np.abs(np.diff(rate)).max() < 2


@pytest.mark.skipif(not MEASURED.exists(), reason="the measured motion is not on this machine")
def test_measured_motion():
    profile = read_profile(MEASURED, "Gyroscope Z (deg/s)", "deg/s")
    held = profile.held(60.0, 0, 10_000, 1e-3)
    assert profile.length == pytest.approx(135.3, abs=0.1)
    # The record peaks at 208.8 deg/s; the spline passes through that reading.
    assert np.abs(np.rad2deg(profile.held(0.0, 0, 135_000, 1e-3))).max() == pytest.approx(209, abs=1)
    assert np.abs(np.rad2deg(held)).max() > 100
    with pytest.raises(InputError, match="in deg/s by its heading, not in rad/s"):
        read_profile(MEASURED, "Gyroscope Z (deg/s)", "rad/s")


def write(path, *lines):
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("lines", "column", "unit", "message"),
    [
        (["t,rate"], "rate", "rad/s", "is too short: 0 rows"),
        (["t,rate", "0,1", "1,1", "2,1"], "rate", "rad/s", "is too short: 3 rows"),
        (["t,rate", "0,1", "1,1", "1,1", "2,1"], "rate", "rad/s", "not increase at row 3"),
        (["t,rate", "0,1", "2,1", "1,1", "3,1"], "rate", "rad/s", "not increase at row 3"),
        (["t,rate", "0,1", "1,nan", "2,1", "3,1"], "rate", "rad/s", "in row 2, not a finite"),
        (["t,rate", "0,1", "1,", "2,1", "3,1"], "rate", "rad/s", "is None in row 2, not a finite"),
        (["t,rate", "0,1", "1,x", "2,1", "3,1"], "rate", "rad/s", "is 'x' in row 2, not a finite"),
        (["t,rate_z"], "rate_y", "rad/s", "no column 'rate_y'; did you mean 'rate_z'"),
        (["t,rate", "0,1"], "rate", "rps", "rate unit 'rps' is not known: use deg/s or rad/s"),
        ([""], "rate", "rad/s", "no table with a header line"),
        (["time,rate", *(f"{20 * k},{k % 3}" for k in range(9))], "rate", "rad/s", "every 20 s: is 'time' in ms or µs"),
        (["t,rate", *(f"{k / 50 + (k > 5)},{k}" for k in range(9))], "rate", "rad/s", "1.02 s without .* after row 6"),
    ],
)
def test_bad_input_is_named_in_one_line(tmp_path, lines, column, unit, message):
    path = write(tmp_path / "bad.csv", *lines)
    with pytest.raises(InputError, match=message) as caught:
        read_profile(path, column, unit)
    assert "\n" not in str(caught.value)


def test_a_heading_is_found_without_its_unit(tmp_path):
    path = write(tmp_path / "slow.csv", "t [s],rate [deg/s],other", *(f"{20 * k},{k % 3},{k}" for k in range(9)))
    profile = read_profile(path, "rate")
    assert profile.length == 160.0
    np.testing.assert_array_equal(
        profile.held(0.0, 0, 16, 10.0), read_profile(path, "rate [deg/s]").held(0.0, 0, 16, 10.0)
    )
    both = write(tmp_path / "both.csv", "t [s],rate [deg/s],rate [rad/s]", *(f"{k},1,1" for k in range(9)))
    with pytest.raises(InputError, match="no column 'rate'"):
        read_profile(both, "rate")


def test_missing_file_and_bad_gzip(tmp_path):
    with pytest.raises(InputError, match="does not exist"):
        read_profile(tmp_path / "none.csv", "rate", "rad/s")
    with pytest.raises(InputError, match="can't be read"):
        read_profile(write(tmp_path / "plain.csv.gz", "t,rate"), "rate", "rad/s")


def test_record_must_cover_the_run(table):
    profile = read_profile(table, "rate_z", "rad/s")
    with pytest.raises(InputError, match=r"lasts 0\.5 s and the run needs 0\.4 s from 0\.2 s"):
        profile.check(0.2, 0.4)
    with pytest.raises(InputError, match=r"start 0\.5 s lies outside"):
        profile.check(0.5, 0.1)
    profile.check(0.1, 0.4)
