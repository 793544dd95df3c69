"""Allan deviation of an angle: made-up noises come back, within the errors that are stated."""

import numpy as np
import pytest
from scipy.signal import lfilter

from calibration.analysis.allan import AngleAllan, angle_allan, rate_allan
from cosim.rate.allan import DECAYS, overlapping
from gyro_model.errors import InputError

INTERVAL = 0.01
ROWS = 20_000


def angle(seed: int, q: float, n: float, k: float) -> np.ndarray:
    """White angle noise ``q`` [rad], angle random walk ``n`` [rad/sqrt(s)], rate random walk ``k`` [rad/s/sqrt(s)]."""
    rng = np.random.default_rng(seed)
    walk = k * np.sqrt(INTERVAL) * np.cumsum(rng.standard_normal(ROWS))
    rate = n / np.sqrt(INTERVAL) * rng.standard_normal(ROWS) + walk
    return np.append(0.0, np.cumsum(rate) * INTERVAL) + q * rng.standard_normal(ROWS + 1)


def test_a_steady_drift_by_hand() -> None:
    # A rate that grows by D a second changes by D tau from one average to the next: D tau/sqrt(2).
    t = np.arange(500) * 0.1
    found = angle_allan(0.5 * 3e-4 * t**2, 0.1)
    # Differences of angles up to 0.4 rad, divided by 0.1 s: 1e-15 of 3e-5 rad/s.
    np.testing.assert_allclose(found.deviation, 3e-4 * found.tau / np.sqrt(2), rtol=1e-9)


def test_an_angle_has_the_deviation_of_its_rate() -> None:
    record = angle(1, 0.0, 3e-5, 0.0)
    tau, deviation = overlapping(np.diff(record) / INTERVAL, INTERVAL)
    found = angle_allan(record, INTERVAL)
    np.testing.assert_array_equal(found.tau, tau)
    np.testing.assert_array_equal(found.deviation, deviation)


@pytest.mark.parametrize(
    ("q", "n", "k"), [(0.0, 3e-5, 0.0), (1e-5, 3e-5, 0.0), (1e-5, 3e-5, 1e-5), (1e-4, 3e-5, 0.0), (0.0, 3e-5, 3e-5)]
)
def test_terms_come_back_within_their_errors(q: float, n: float, k: float) -> None:
    found = angle_allan(angle(2, q, n, k), INTERVAL)
    for term, true in ((found.angle_noise, q), (found.angle_random_walk, n), (found.rate_random_walk, k)):
        # Three standard errors: of 150 records of each mixture, none of whose seeds were chosen.
        assert abs(term.value - true) < 3 * term.error
    assert found.instability.value < 3 * found.instability.error + 1e-12
    # Most of the noise that rules is known well.
    assert min(found.angle_noise.error / max(q, 1e-12), found.angle_random_walk.error / n) < 0.05


def ringing(rng: np.random.Generator, decay: float, split: float, step: float) -> np.ndarray:
    """2000 s of the rate of an open loop in white noise of N = 1, means over 0.1 s: r = Im(-p y), y' = p y + w.

    decay [1/s]; split [rad/s]; step: of the motion, which is exact at its ends [s].
    """
    pole = complex(-decay, split)
    # 20 decays: 2e-9 of the start is left.
    first = int(20 / decay / step)
    w = rng.standard_normal((int(2000 / step) + first, 2)) @ [1, 1j]
    y = lfilter([1.0], [1.0, -np.exp(pole * step)], w * np.sqrt((1 - np.exp(-2 * decay * step)) / (2 * decay)))
    return (-pole * y).imag[first:].reshape(20_000, -1).mean(axis=1)


@pytest.mark.parametrize(
    # Fifty steps or more in a turn: the sum over a row is its integral to 1e-3 of what rings, far from N.
    ("decay", "split", "step", "most"),
    [(21.1, 395.0, 2.5e-4, 0.01), (0.33, 61.0, 2e-3, 0.06)],
)
def test_an_open_loop_that_rings_shows_its_random_walk(decay: float, split: float, step: float, most: float) -> None:
    rng = np.random.default_rng(4)
    rates = np.stack([ringing(rng, decay, split, step) for _ in range(5)])
    found = rate_allan(rates, 0.1, max(0.2, DECAYS / decay)).angle_random_walk
    # Three standard errors: 0.8 % and 5 %. Read from 0.2 s on, the second would be 78 % too large.
    assert abs(found.value - 1) < 3 * found.error
    assert found.error < most


def test_the_interval_covers_the_truth() -> None:
    n, k = 3e-5, 1e-5
    inside = []
    for seed in range(30):
        found = angle_allan(angle(seed, 0.0, n, k), INTERVAL)
        true = np.sqrt(n**2 / found.tau + k**2 * found.tau / 3)
        inside.append((found.low < true) & (true < found.high))
    # 95 %; 30 records with some ten independent deviations each leave 1.3 % of scatter.
    assert 0.91 < np.mean(inside) <= 0.995


def test_a_bottom_is_read_where_the_deviation_rises_again() -> None:
    walk, drift = 3e-5, 3e-5
    found = angle_allan(angle(2, 0.0, walk, drift), INTERVAL)
    assert found.bias_instability is not None
    # Lowest at tau = sqrt(3) N/K with 2NK/sqrt(3); 20 % of statistical error.
    assert found.bias_instability == pytest.approx(np.sqrt(2 * walk * drift / np.sqrt(3)) / 0.664, rel=0.2)
    assert angle_allan(angle(2, 0.0, walk, 0.0), INTERVAL).bias_instability is None


@pytest.mark.parametrize(
    ("record", "message"),
    [
        (np.zeros(50), "50 rows of the angle: an Allan deviation needs 101"),
        (np.append(np.nan, np.arange(500.0)), "without a number: give the rows from convergence on"),
        (np.zeros(500), "angle does not change"),
    ],
)
def test_what_gives_no_deviation_is_said(record: np.ndarray, message: str) -> None:
    with pytest.raises(InputError, match=message):
        angle_allan(record, INTERVAL)


def test_result_is_complete() -> None:
    found = angle_allan(angle(3, 1e-5, 3e-5, 0.0), INTERVAL)
    assert isinstance(found, AngleAllan)
    assert (found.low < found.deviation).all()
    assert (found.deviation < found.high).all()


def test_a_ramp_of_the_rate_comes_back_beside_white_noise() -> None:
    ramp, walk = 2e-6, 3e-5
    t = INTERVAL * np.arange(ROWS)
    noise = np.random.default_rng(5).standard_normal((3, ROWS)) * walk / np.sqrt(INTERVAL)
    found = rate_allan(noise + ramp * t, INTERVAL)
    assert abs(found.rate_ramp.value - ramp) < 3 * found.rate_ramp.error
    assert found.rate_ramp.error < 0.2 * ramp
    assert abs(found.angle_random_walk.value - walk) < 3 * found.angle_random_walk.error


def test_records_together_are_as_good_as_their_number_says() -> None:
    rng = np.random.default_rng(6)
    walk = 3e-5
    rates = walk / np.sqrt(INTERVAL) * rng.standard_normal((4, ROWS))
    one, four = rate_allan(rates[:1], INTERVAL), rate_allan(rates, INTERVAL)
    # Four times the degrees of freedom: half the interval, but for its asymmetry at the longest times.
    width = [np.log(found.high / found.low)[:20].mean() for found in (one, four)]
    assert width[1] == pytest.approx(width[0] / 2, rel=0.05)
    assert abs(four.angle_random_walk.value - walk) < 3 * four.angle_random_walk.error


def test_the_deviation_is_that_of_allantools() -> None:
    allantools = pytest.importorskip("allantools")
    rate = np.random.default_rng(7).standard_normal(5000)
    found = rate_allan(rate[None], 0.1)
    tau, deviation, *_ = allantools.oadev(rate, rate=10.0, data_type="freq", taus=found.tau)
    np.testing.assert_allclose(tau, found.tau)
    np.testing.assert_allclose(deviation, found.deviation, rtol=1e-9)


def test_a_record_that_only_shows_the_filter_is_refused() -> None:
    with pytest.raises(InputError, match=r"from 0\.5 s on needs 36 s"):
        rate_allan(np.random.default_rng(1).standard_normal((1, 300)), 0.1, 0.5)
