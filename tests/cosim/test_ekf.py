"""The Kalman filters: factors against dense algebra, and short closed loops."""

import numpy as np
import pytest
from cosim.observers.ekf_extended import OBSERVER as EXTENDED
from cosim.observers.kalman import (
    add_variance,
    correct_factors,
    inflate,
    predict_factors,
    variance_of,
)
from plant import REFERENCE, close_loop

from cosim.controllers.foucault import CONTROLLER
from cosim.observers.ekf import OBSERVER as EKF
from cosim.propagation import PHI, WIDTH, WORK_SIZE

SIZE = 12


def factors(seed):
    rng = np.random.default_rng(seed)
    u = np.triu(rng.standard_normal((SIZE, SIZE)), 1) + np.eye(SIZE)
    d = rng.uniform(0.1, 2.0, SIZE)
    return u.T.ravel().copy(), d


def dense(u, d):
    matrix = u.reshape(SIZE, SIZE).T
    return (matrix * d) @ matrix.T


# Products of a dozen terms of order 10: some 100 roundings of 1e-16.
CLOSE = {"rtol": 1e-11, "atol": 1e-11}


def test_predicted_factors_are_those_of_f_p_f():
    u, d = factors(1)
    rng = np.random.default_rng(2)
    work = np.zeros(WORK_SIZE)
    f = np.eye(SIZE)
    f[:4, :4] = rng.standard_normal((4, 4))
    f[:4, 4:] = rng.standard_normal((4, 8))
    for i in range(4):
        work[i * WIDTH : i * WIDTH + 8] = f[i, 4:]
        work[i * WIDTH + PHI : i * WIDTH + PHI + 4] = f[i, :4]
    expected = f @ dense(u, d) @ f.T
    predict_factors(u, d, SIZE, work)
    np.testing.assert_allclose(dense(u, d), expected, **CLOSE)


def test_corrected_factors_are_those_of_the_kalman_filter():
    u, d = factors(3)
    p = dense(u, d)
    h = np.random.default_rng(4).standard_normal(SIZE)
    state, gain = np.zeros(SIZE), np.zeros(SIZE)
    f = u.reshape(SIZE, SIZE) @ h
    variance = correct_factors(state, u, d, SIZE, f, 0.3, 2.0, gain)
    expected = h @ p @ h + 0.3
    np.testing.assert_allclose(variance, expected, **CLOSE)
    np.testing.assert_allclose(state, p @ h * 2.0 / expected, **CLOSE)
    np.testing.assert_allclose(dense(u, d), p - np.outer(p @ h, p @ h) / expected, **CLOSE)


def test_added_and_inflated_variance():
    u, d = factors(5)
    p = dense(u, d)
    v = np.zeros(SIZE)
    v[:5] = [1.0, 2.0, -1.0, 0.5, 3.0]
    add_variance(u, d, SIZE, 4, 0.7, v.copy())
    p += 0.7 * np.outer(v, v)
    np.testing.assert_allclose(dense(u, d), p, **CLOSE)
    inflate(u, d, SIZE, 6, 3.0)
    scale = np.ones(SIZE)
    scale[6] = 3.0
    np.testing.assert_allclose(dense(u, d), p * np.outer(scale, scale), **CLOSE)
    assert variance_of(u, d, SIZE, 6) == pytest.approx(p[6, 6] * 9.0)


def relative(estimates):
    return estimates[:, 5:12] / REFERENCE - 1.0


@pytest.mark.parametrize("seed", [1, 2])
def test_constant_rate_converges_and_knows_how_well(seed):
    omega_z = np.full(14000, 5.0)
    omega_z[10000:] = -5.0
    estimates, deviations, outputs, _ = close_loop(EKF, CONTROLLER, omega_z, seed)
    assert np.abs(relative(estimates)[8000:]).max() < 0.01
    assert outputs[-1, 2] == 1.0
    error = np.abs(estimates[-1] - np.concatenate([estimates[-1, :4], [-5.0], REFERENCE, np.zeros(4), [1.0]]))
    # Eight estimates, correlated: 4.5 standard deviations are passed once in some 10,000 runs.
    assert (error[4:12] < 4.5 * deviations[-1, 4:12]).all()
    # The specification asks for 0.2 rad/s from 20 ms after an edge; here 5 ms after.
    assert np.abs(estimates[11000:, 4] + 5.0).max() < 0.2


def test_doubled_damping_is_followed():
    n, jump = 16000, 10000
    estimates, _, _, _ = close_loop(EKF, CONTROLLER, np.full(n, 5.0), 1, scale_damping=(jump, 2.0))
    damping = estimates[:, 8:11] / (2.0 * REFERENCE[3:6]) - 1.0
    # The specification asks for 5 % within 0.1 s, a trial had 31 ms; here 20 ms.
    assert np.abs(damping[jump + 4000 :]).max() < 0.05


def test_extended_finds_the_defects():
    defects = (4e4, 0.02, 0.03, 0.05, 0.01)
    estimates, _, _, _ = close_loop(EXTENDED, CONTROLLER, np.full(12000, 5.0), 2, defects=defects)
    last = estimates[-1]
    rates = last[5:11] / last[11] / (REFERENCE[:6] / REFERENCE[6]) - 1.0
    assert np.abs(rates[:3]).max() < 1e-5
    # Dampings are known to some 0.5 % after 60 ms (bound of SYSTEM.md section 2 at 50 ms: 0.4 %).
    assert np.abs(rates[3:]).max() < 0.03
    assert last[12] == pytest.approx(0.01, abs=1e-4)
    assert last[13] == pytest.approx(0.01, abs=1e-4)
    assert last[16] == pytest.approx(1.03, abs=1e-4)
    # The gauge: mass and common gain scale together.
    assert last[11] == pytest.approx(REFERENCE[6] * 1.05, rel=1e-4)


def test_plain_leaves_the_sensor_as_it_started():
    estimates, _, _, _ = close_loop(EKF, CONTROLLER, np.full(10, 0.0), 1)
    np.testing.assert_array_equal(estimates[-1, 12:17], [0.0, 0.0, 0.0, 0.0, 1.0])


def test_unknown_setting_is_refused():
    with pytest.raises(ValueError, match="no setting 'forgetting'"):
        EKF.settings_array(forgetting=1.0)
