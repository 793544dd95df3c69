"""Propagation over one sample against the matrix exponential."""

import numpy as np
import pytest
from scipy.linalg import expm

from cosim.propagation import (
    PHI,
    STATE,
    THETA_SIZE,
    WIDTH,
    WORK_SIZE,
    linearise,
    parameters_of,
    propagate,
    taylor_order,
    theta_of,
)

MASS = 1.8e-7
THETA = np.array([5.0, 63.955 / MASS, 95.92 / MASS, 12.779 / MASS, 10.0, 12.0, 2.0, 1.0 / MASS])
STATES = np.array([1e-6, 0.01, -0.5e-6, 0.02])
FORCE = (1e-5, -2e-5)


def system(theta):
    omega, kxx, kyy, kxy, dxx, dyy, dxy, inverse_mass = theta
    a = np.zeros((5, 5))
    a[0, 1] = a[2, 3] = 1.0
    a[1] = [-kxx, -dxx, -kxy, 2 * omega - dxy, inverse_mass * FORCE[0]]
    a[3] = [-kxy, -2 * omega - dxy, -kyy, -dyy, inverse_mass * FORCE[1]]
    return a


def run(period):
    work = np.zeros(WORK_SIZE)
    linearise(STATES, THETA, *FORCE, period, taylor_order(THETA, period), work)
    return work[: 4 * WIDTH].reshape(4, WIDTH)


@pytest.mark.parametrize("rate", [50e3, 100e3, 200e3, 1e6])
def test_state_and_transition_are_the_matrix_exponential(rate):
    exact = expm(system(THETA) / rate)
    rows = run(1.0 / rate)
    expected = exact @ np.append(STATES, 1.0)
    # The remainder is held below 1e-13; expm itself is good to some 1e-13 of the largest entry.
    np.testing.assert_allclose(rows[:, STATE], expected[:4], rtol=1e-11)
    phi = rows[:, PHI : PHI + 4]
    scale = np.array([1.0, 2e4, 1.0, 2e4])
    difference = (phi - exact[:4, :4]) / scale[:, None] * scale[None, :]
    assert np.abs(difference).max() < 1e-11


@pytest.mark.parametrize("rate", [50e3, 200e3])
@pytest.mark.parametrize("index", range(THETA_SIZE))
def test_sensitivity_is_that_of_the_exponential(rate, index):
    # d expm(A T) along dA is the corner of expm([[A, dA], [0, A]] T); A is linear in theta.
    step = np.zeros(THETA_SIZE)
    step[index] = 1.0
    block = np.zeros((10, 10))
    block[:5, :5] = block[5:, 5:] = system(THETA)
    block[:5, 5:] = system(THETA + step) - system(THETA)
    expected = (expm(block / rate)[:5, 5:] @ np.append(STATES, 1.0))[:4]
    # system(theta + 1) - system(theta) loses up to 1e-7 of its digits where theta is 5e8.
    np.testing.assert_allclose(run(1.0 / rate)[:, index], expected, rtol=1e-6, atol=1e-30)


def test_propagate_agrees_with_linearise():
    period = 5e-6
    result = propagate(*STATES, THETA, *FORCE, period, taylor_order(THETA, period))
    # The same series, summed in the same order but for the grouping of one term.
    np.testing.assert_allclose(result, run(period)[:, STATE], rtol=1e-14)


def test_theta_and_parameters_are_inverse():
    estimate = np.zeros(17)
    estimate[4:12] = [5.0, 63.955, 95.92, 12.779, 1.8e-6, 1.9e-6, 3.6e-7, MASS]
    theta = np.zeros(THETA_SIZE)
    back = np.zeros(17)
    theta_of(estimate, theta)
    parameters_of(theta, back)
    # Three roundings.
    np.testing.assert_allclose(back[4:12], estimate[4:12], rtol=1e-15)
