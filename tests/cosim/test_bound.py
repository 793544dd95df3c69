"""The bound against the table of SYSTEM.md section 2 and against a batch Fisher information."""

import numpy as np
import pytest
from plant import PERIOD, REFERENCE, matrix, sampled
from scipy.linalg import expm

from cosim.bound import Motion, Prior, parameter_bound
from cosim.controllers.foucault import CONTROLLER

NOISE = (2e-11, 2e-11)


def exact_motion(omega_z):
    """Close the loop with the truth as estimate."""
    settings = CONTROLLER.settings_array()
    memory = np.zeros(CONTROLLER.memory_size)
    CONTROLLER.init(memory, settings, PERIOD)
    n = len(omega_z)
    plants = {rate: sampled(REFERENCE, rate) for rate in set(omega_z)}
    estimate = np.zeros(17)
    estimate[5:12] = REFERENCE
    states, forces, output = np.zeros((n, 4)), np.zeros((n, 2)), np.zeros(9)
    state = np.array([1e-6, 0.0, 0.0, 0.0])
    for k in range(n):
        states[k] = state
        phi, gamma = plants[omega_z[k]]
        estimate[:4] = state
        estimate[4] = omega_z[k]
        CONTROLLER.step(memory, settings, k * PERIOD, estimate, np.zeros(17), output)
        forces[k] = output[:2]
        state = phi @ state + gamma @ forces[k]
    return Motion(states, forces, omega_z, REFERENCE, PERIOD)


def test_reproduces_the_table_of_the_specification():
    # SYSTEM.md section 2, in the columns' order here; k and d there are per mass.
    table = {
        0.05: [9e-8, 6e-7, 1.4e-6, 2e-4, 3.2e-3, 4.0e-3, 5e-7],
        0.1: [6e-8, 4e-7, 1e-6, 1.3e-4, 1.2e-3, 1.9e-3, 3e-7],
        0.3: [4e-8, 2e-7, 6e-7, 8e-5, 7e-4, 1.1e-3, 2e-7],
    }
    # It was made with omega_z unknown but constant in size: +5 rad/s, its sign changing every 0.1 s.
    motion = exact_motion(np.where(np.arange(60001) // 20000 % 2 == 0, 5.0, -5.0))
    prior = Prior(omega_walk=0.0)
    bounds, _ = parameter_bound(motion, NOISE, np.array(list(table)), prior, per_mass=True)
    for row, expected in zip(bounds, table.values(), strict=True):
        # Half of the last digit printed: up to 0.5 of 3 in the table's single digits.
        np.testing.assert_allclose(row, expected, rtol=0.17)


def test_is_the_inverse_of_the_fisher_information():
    # A second derivation: all samples at once, sensitivities from the exponential of [[A, dA], [0, A]].
    n = 120
    motion = exact_motion(np.full(n, 5.0))
    prior = Prior(omega_walk=0.0)
    scale = np.concatenate([[1e-6, 0.019, 1e-6, 0.019], [1.0], REFERENCE])
    steps = np.eye(12)
    information = np.zeros((12, 12))
    sensitivity = np.hstack([np.diag(scale[:4]), np.zeros((4, 8))])
    phi, _ = sampled(REFERENCE, 5.0)
    for k in range(n):
        if k > 0:
            drive = np.concatenate([motion.states[k - 1], motion.forces[k - 1]])
            moved = phi @ sensitivity
            for j in range(4, 12):
                moved[:, j] += _derivative(steps[j] * scale) @ drive
            sensitivity = moved
        h = sensitivity[::2] / NOISE[0]
        information += h.T @ h
    start = np.diag(1.0 / np.array([1.0, 0.019 / 0.019, 1.0, 1.0, 10.0] + [0.3] * 7) ** 2)
    start[1, 1] = start[3, 3] = (0.019 / (1e-6 * np.sqrt(REFERENCE[0] / REFERENCE[6]))) ** 2
    expected = np.sqrt(np.diag(np.linalg.inv(information + start)))
    bounds, omega = parameter_bound(motion, NOISE, np.array([(n - 1) * PERIOD]), prior)
    # The difference quotient of _derivative costs 1e-6, the inverse of cond 1e10 some 1e-6 more.
    np.testing.assert_allclose(bounds[0], expected[5:], rtol=1e-4)
    np.testing.assert_allclose(omega[0], expected[4], rtol=1e-4)


def _derivative(change):
    """Return d [phi gamma] for a change of omega_z and the parameters."""
    relative = 1e-4

    def at(sign):
        a, b = matrix(REFERENCE + sign * relative * change[5:], 5.0 + sign * relative * change[4])
        block = np.zeros((6, 6))
        block[:4, :4], block[:4, 4:] = a, b
        return expm(block * PERIOD)[:4]

    return (at(1.0) - at(-1.0)) / (2.0 * relative)


def test_refuses_a_time_beyond_the_motion():
    motion = exact_motion(np.zeros(10))
    with pytest.raises(ValueError, match="choose times from 0 to"):
        parameter_bound(motion, NOISE, np.array([1.0]), Prior(omega_walk=1.0))
