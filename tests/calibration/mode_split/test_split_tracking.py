"""The split through time: tracker, tuning by the bias, whole records."""

from dataclasses import replace

import numpy as np
import pytest
import sympy
from scipy.integrate import quad

from benchmarks.split_records import SenseAxis, complex_normal, make_envelope, ornstein_uhlenbeck
from calibration.mode_split import (
    BiasTuner,
    Envelope,
    NothingFoundError,
    Question,
    SplitTracker,
    Tracked,
    VoltageRecord,
    find_split,
    follow_split,
    split_slope,
    track,
)
from calibration.mode_split.follow import likely_wander
from gyro_model.effects import electrostatic_softening
from gyro_model.errors import InputError
from gyro_model.symbols import v_bias, x

NARROW = SenseAxis(q=5000.0, f_y=3003.0)
NARROW_DURATION = 150 / NARROW.decay


def test_track_follows_a_ramp_within_its_deviation():
    rate, block, slope = 200.0, 30.0, 2e-3
    count = round(20 * block * rate)
    offset = 20 + slope * np.arange(count) / rate
    rng = np.random.default_rng(11)
    decay = np.pi * 3000 / 1885
    pull = np.exp(2j * np.pi * np.cumsum(offset) / rate)
    noise = (rng.standard_normal((count, 2)) @ [1, 1j]) * np.sqrt(0.5 * -np.expm1(-2 * decay / rate))
    z = np.zeros(count, complex)
    for k in range(1, count):
        z[k] = np.exp(-decay / rate) * z[k - 1] + noise[k] / pull[k]
    z = z * pull + 0.05 * (rng.standard_normal((count, 2)) @ [1, 1j]) + 300
    steps = list(track(Envelope(z, rate, 3000.0, 80.0), Question(q=1885.0), block, 1e-5))
    assert len(steps) == 20
    truth = np.array([20 + slope * step.t for step in steps])
    error = np.array([step.split for step in steps]) - truth
    # Each within four deviations; the last blocks know the slope and beat a block alone.
    assert np.all(np.abs(error) < 4 * np.array([step.deviation for step in steps]))
    assert steps[-1].deviation < 0.7 * steps[-1].block.deviation


def test_a_track_needs_q():
    with pytest.raises(InputError, match="needs Q"):
        list(track(Envelope(np.ones(1000, complex), 200.0, 3000.0, 80.0), Question(), 1.0, 1e-5))


def test_tracker_of_a_constant_averages():
    tracker = SplitTracker(wander=0.0)
    for value in (1.0, 2.0, 3.0):
        tracker.predict(0.0)
        tracker.update(value, 0.5, 1.0)
    assert tracker.mean[0] == pytest.approx(2.0)
    assert tracker.deviation == pytest.approx(0.5 / np.sqrt(3))


def test_slope_is_the_describing_function_of_the_effect():
    softening, gap, amplitude, mass, f_y, bias = 0.02, 1e-5, 4e-6, 1.8e-7, 3000.0, 15.0
    at = {"softening": softening, "electrode_gap": gap, v_bias.name: bias}
    force = electrostatic_softening.EFFECT.force[0]
    force = force.subs({symbol: at[symbol.name] for symbol in force.free_symbols if symbol.name in at})
    pull = sympy.lambdify(x, force)
    swing, _ = quad(lambda phi: pull(amplitude * np.cos(phi)) * np.cos(phi) / np.pi, 0, 2 * np.pi)
    small = float(force.diff(x).subs(x, 0))
    hand = (swing / amplitude - small) / (8 * np.pi**2 * mass * f_y) / bias**2
    assert split_slope(softening, gap, amplitude, mass, f_y) == pytest.approx(hand, rel=1e-8)
    # Without the swing equal electrodes move both axes alike.
    assert split_slope(softening, gap, 0.0, mass, f_y) == 0


def test_tuner_takes_its_share_and_waits_where_nothing_was_found():
    tuner = BiasTuner(slope=0.01, gain=0.5, highest=40.0)
    # -2 Hz: 0.5 · 2/0.01 = 100 V² more.
    assert tuner.next_bias(10.0, -2.0) == pytest.approx(np.sqrt(200))
    assert tuner.next_bias(10.0, None) == 10.0
    assert tuner.next_bias(10.0, -1e9) == 40.0
    assert tuner.next_bias(10.0, 1e9) == 0.0


def drifting(slope, blocks, seed, block=30.0, rate=200.0):
    """A record whose split runs from 20 Hz with ``slope`` [Hz/s], Q 1885, 20 dB and more over the floor."""
    count = round(blocks * block * rate)
    offset = 20 + slope * np.arange(count) / rate
    rng = np.random.default_rng(seed)
    z = ornstein_uhlenbeck(offset, np.pi * 3000 / 1885, rate, rng) + 0.05 * complex_normal(count, rng) + 300
    return VoltageRecord(z, rate, 3000.0), offset


@pytest.mark.parametrize("slope", [0.0, 3e-3])
def test_track_finds_q_and_how_much_the_split_wanders(slope):
    record, offset = drifting(slope, 12, 12)
    track = follow_split(record, Question(), 30.0)
    assert track.blocks == len(track.steps) == 12
    # ln Q of a block of 150 decay times scatters by 12 %, a median of 12 by 4 %.
    assert track.q == pytest.approx(1885, rel=0.12)
    truth = np.array([offset[round(step.t * record.rate)] for step in track.steps])
    error = np.array([step.split for step in track.steps]) - truth
    assert np.all(np.abs(error) < 4 * np.array([step.deviation for step in track.steps]))
    # The end of a straight line through 12 blocks is known to 2/√12 = 0.58 of one; a little wander is never excluded.
    assert track.steps[-1].deviation < 0.8 * track.steps[-1].block.deviation


def test_a_track_of_humps_that_are_not_thermal_is_refused():
    record, _ = drifting(0.0, 12, 12)
    with pytest.raises(InputError, match="not thermal"):
        follow_split(record, Question(mass=1e-3, sense_gain=1.0), 30.0)


def test_likely_wander_is_that_of_the_walk():
    rng, block, wander, noise = np.random.default_rng(13), 10.0, 3e-4, 0.1
    at = np.zeros(2)
    template = find_split(make_envelope(NARROW, NARROW_DURATION, 5), Question(q=NARROW.q)).split
    steps = []
    for index in range(400):
        kick = wander * np.linalg.cholesky([[block**3 / 3, block**2 / 2], [block**2 / 2, block]])
        at = np.array([[1, block], [0, 1]]) @ at + kick @ rng.standard_normal(2)
        seen = replace(template, f_y=template.f_x + at[0] + noise * rng.standard_normal(), deviation=noise)
        steps.append(Tracked((index + 0.5) * block, 0.0, 0.0, seen))
    # The logarithm of a walk's strength from 400 noisy steps is known to about a fifth; a factor 2 is over three of it.
    assert 0.5 < likely_wander(steps, block, 1.0, 0.1) / wander < 2.0


def test_a_record_of_noise_alone_has_no_track():
    rng = np.random.default_rng(14)
    record = VoltageRecord(complex_normal(20_000, rng) + 300, 200.0, 3000.0)
    with pytest.raises(NothingFoundError, match=r"no thermal hump found in any block of 20 s"):
        follow_split(record, Question(), 20.0)
