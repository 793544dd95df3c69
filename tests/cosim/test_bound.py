"""The bound against a table that was made before it and against a batch Fisher information."""

from dataclasses import replace

import numpy as np
import pytest
from plant import MEASURED, NOISE, PERIOD, REFERENCE, begin, device_with, matrix, sampled, told
from scipy.linalg import expm

from cosim.bound import Motion, at_the_truth, bound
from cosim.design import load_design
from cosim.layout import PARAMETER_NAMES

WIDE = {name: 0.3 * value for name, value in zip(PARAMETER_NAMES, REFERENCE, strict=True)}


def design():
    """The reference device told as it is, each constant within 30 %."""
    return replace(told(device_with(sense_noise=NOISE)), deviations=WIDE)


def exact_motion(omega_z):
    """Close the loop with the truth as estimate."""
    loop = begin(design(), quadrature_loop=0.0)
    n = len(omega_z)
    plants = {rate: sampled(REFERENCE, rate) for rate in set(omega_z)}
    estimate, deviation = np.zeros(12), np.zeros(12)
    estimate[5:] = REFERENCE
    states, forces = np.zeros((n, 4)), np.zeros((n, 2))
    state = np.array([1e-6, 0.0, 0.0, 0.0])
    for k in range(n):
        states[k] = state
        phi, gamma = plants[omega_z[k]]
        estimate[:4] = state
        estimate[4] = omega_z[k]
        forces[k] = loop.control(k, estimate, deviation)
        state = phi @ state + gamma @ forces[k]
    return Motion(states, forces, np.asarray(omega_z, dtype=float), np.tile(MEASURED[:4], (n, 1)), PERIOD)


def test_reproduces_a_table_made_before_it():
    # Relative bounds of k/m, d/m in the order of the seven, and of 1/m, at 0.05, 0.1 and 0.3 s: printed to one digit.
    table = {
        0.05: [9e-8, 6e-7, 1.4e-6, 2e-4, 3.2e-3, 4.0e-3, 5e-7],
        0.1: [6e-8, 4e-7, 1e-6, 1.3e-4, 1.2e-3, 1.9e-3, 3e-7],
        0.3: [4e-8, 2e-7, 6e-7, 8e-5, 7e-4, 1.1e-3, 2e-7],
    }
    # It was made with omega_z unknown but constant in size: +5 rad/s, its sign changing every 0.1 s.
    motion = exact_motion(np.where(np.arange(60001) // 20000 % 2 == 0, 5.0, -5.0))
    found = bound(motion, design(), np.array(list(table)), omega_walk=0.0)
    # k, d and m share the error of m; per mass it is taken off where it is not the larger part (k and kxy).
    mass = found.values[:, 6] / REFERENCE[6]
    relative = found.values[:, :7] / np.abs(REFERENCE)
    for row, sure, expected in zip(relative, mass, table.values(), strict=True):
        dampings = row[3:6]
        # Half of the last digit printed: up to 0.5 of 3 in the table's single digits.
        np.testing.assert_allclose(dampings, expected[3:6], rtol=0.17)
        np.testing.assert_allclose(sure, expected[6], rtol=0.17)
        # That of k/m is at most the sum of both, and at least their difference.
        assert (np.abs(row[:3] - sure) <= np.array(expected[:3]) * 1.17).all()
        assert (np.array(expected[:3]) * 0.83 <= row[:3] + sure).all()


def test_is_the_inverse_of_the_fisher_information():
    # A second derivation: all samples at once, sensitivities from the exponential of [[A, dA], [0, A]].
    n = 129
    motion = exact_motion(np.full(n, 5.0))
    scale = np.concatenate([[1e-6, 0.019, 1e-6, 0.019], [1.0], REFERENCE])
    steps = np.eye(12)
    information = np.zeros((12, 12))
    sensitivity = np.hstack([np.diag(scale[:4]), np.zeros((4, 8))])
    derivatives = [_derivative(steps[j] * scale) for j in range(4, 12)]
    phi, _ = sampled(REFERENCE, 5.0)
    # The filter folds its blocks after samples 3, 19, 35, ...: the last at or before a time tells the constants then.
    last = (n - 4) // 16 * 16 + 3
    for k in range(last + 1):
        if k > 0:
            drive = np.concatenate([motion.states[k - 1], motion.forces[k - 1]])
            moved = phi @ sensitivity
            for j, derivative in enumerate(derivatives):
                moved[:, 4 + j] += derivative @ drive
            sensitivity = moved
        h = sensitivity[::2] / (NOISE / 1e6)
        information += h.T @ h
    speed = 1e-6 * np.sqrt(REFERENCE[0] / REFERENCE[6])
    start = np.diag(1.0 / np.array([1.0, speed / 0.019, 1.0, speed / 0.019, 10.0] + [0.3] * 7) ** 2)
    expected = np.sqrt(np.diag(np.linalg.inv(information + start)))
    found = bound(motion, design(), np.array([last * PERIOD]), omega_walk=0.0)
    # The difference quotient of _derivative costs 1e-6, the inverse of cond 1e10 some 1e-6 more; Simpson's rule for
    # the filter's sensitivities (omega T)^4/2880 = 1e-7.
    np.testing.assert_allclose(found.values[0] / REFERENCE, expected[5:], rtol=1e-4)
    np.testing.assert_allclose(found.omega[0], expected[4], rtol=1e-4)


def _derivative(change):
    """Return d [phi gamma] for a change of omega_z and the parameters."""
    relative = 1e-4

    def at(sign):
        a, b = matrix(REFERENCE + sign * relative * change[5:], 5.0 + sign * relative * change[4])
        block = np.zeros((6, 6))
        block[:4, :4], block[:4, 4:] = a, b
        return expm(block * PERIOD)[:4]

    return (at(1.0) - at(-1.0)) / (2.0 * relative)


def test_falls_with_time_and_rises_with_what_is_unknown():
    motion = exact_motion(np.full(2000, 5.0))
    times = np.array([2e-3, 5e-3, 9.9e-3])
    plain = bound(motion, design(), times)
    more = replace(design(), deviations={**WIDE, "k3_x": 1e9, "pickoff_gain_mismatch": 0.01})
    extended = bound(motion, more, times)
    assert extended.names == (*PARAMETER_NAMES, "k3_x", "pickoff_gain_mismatch")
    # Information only adds up; the constants of a block are told at its end.
    assert (np.diff(plain.values, axis=0) <= 0).all()
    # What is estimated besides can only take from what is known of the seven; rounding of sums of 4000 rows.
    assert (extended.values[:, :7] >= plain.values * (1 - 1e-9)).all()
    assert (extended.drift >= plain.drift * (1 - 1e-9)).all()


def test_drift_is_that_of_the_oscillator_that_the_loop_makes():
    motion, times = exact_motion(np.full(40, 5.0)), np.array([1.9e-4])
    sure = {name: 1e-6 * value for name, value in WIDE.items()}
    late = replace(
        told(device_with(sense_noise=NOISE, amplifier_time_constant=4e-6)),
        deviations={**sure, "amplifier_time_constant": 1e-9},
    )
    usual, same, other = (bound(motion, late, times, stiffness=k) for k in (None, late.stiffness, 4 * late.stiffness))
    assert usual.drift == same.drift
    # Seen through 1/(1 + i omega tau), tau turns the motion's phase by omega/(1 + (omega tau)^2), here at twice the
    # frequency. The dampings are not quite sure: 5e-5.
    square = (4e-6) ** 2 * late.stiffness / REFERENCE[6]
    assert other.drift[0] / usual.drift[0] == pytest.approx((1 + square) / (1 + 4 * square), rel=1e-3)
    np.testing.assert_array_equal(other.values, usual.values)


def test_is_taken_at_the_true_values_with_the_deviations_of_the_design():
    device = device_with(sense_noise=NOISE)
    drawn = load_design("lab", device, 3)
    made = at_the_truth(drawn, device.all_parameters)
    assert made.deviations == drawn.deviations
    assert all(made.values[name] == device.all_parameters[name] for name in made.values)


def test_a_free_vibration_tells_nothing_of_a_lag_that_has_settled():
    lag, before = 1.3e-6, 1e-6
    unknown = replace(
        told(device_with(sense_noise=NOISE, amplifier_time_constant=lag)),
        deviations={**WIDE, "amplifier_time_constant": before},
    )
    free = exact_motion(np.zeros(401))
    motion = replace(free, states=_free_vibration(401), forces=np.zeros((401, 2)))
    found = bound(motion, unknown, np.array([2e-3]))
    sigma = found.values[0, found.names.index("amplifier_time_constant")]
    # It is a phase and a gain of the vibration, which nobody knows, but for terms of (w tau)^2 = 6e-4. Taken for at
    # rest at the first sample, the lag would show to 0.043 us. The filter leaves open what w^2 (tau + its deviation)^2
    # does to the position of the first sample, in place of how tau^2 moves it: that tells this little.
    told_falsely = 2 * lag * before / (lag + before) ** 2
    assert sigma == pytest.approx(before / np.hypot(1.0, told_falsely), rel=0.05)


def _free_vibration(n):
    """From 1 um at rest, shape (n, 4)."""
    phi, _ = sampled(REFERENCE, 0.0)
    states = [np.array([1e-6, 0.0, 0.0, 0.0])]
    for _ in range(n - 1):
        states.append(phi @ states[-1])
    return np.array(states)


def test_refuses_a_time_beyond_the_motion():
    motion = exact_motion(np.zeros(10))
    with pytest.raises(ValueError, match="choose times from 0 to"):
        bound(motion, design(), np.array([1.0]))
