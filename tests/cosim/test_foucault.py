"""The controller on a plant of its own: isotropy, forced response, energy, convergence."""

import numpy as np
import pytest
from plant import PERIOD, REFERENCE, sampled

from cosim.controllers.foucault import CONTROLLER
from cosim.controllers.hold import HOLD_SIZE, feedback
from cosim.controllers.record import CONVERGED, CONVERGED_AT, FORCED, OMEGA_SQUARED

K = CONTROLLER.settings["k"]


def truth(omega_z=0.0):
    estimate = np.zeros(17)
    estimate[4] = omega_z
    estimate[5:12] = REFERENCE
    return estimate


def run(n, state, omega_z=0.0, observe=None, **changes):
    """Close the loop with the truth as estimate; return states (n, 4), outputs (n, 9)."""
    settings = CONTROLLER.settings_array(**changes)
    memory = np.zeros(CONTROLLER.memory_size)
    CONTROLLER.init(memory, settings, PERIOD)
    phi, gamma = sampled(REFERENCE, omega_z)
    states, outputs = np.zeros((n, 4)), np.zeros((n, 9))
    estimate = truth(omega_z)
    state = np.array(state, dtype=float)
    for k in range(n):
        states[k] = state
        estimate[:4] = state
        deviation = np.zeros(17)
        if observe is not None:
            observe(k, estimate, deviation)
        CONTROLLER.step(memory, settings, k * PERIOD, estimate, deviation, outputs[k])
        state = phi @ state + gamma @ outputs[k, :2]
    return states, outputs


@pytest.mark.parametrize("rate", [50e3, 100e3, 200e3])
@pytest.mark.parametrize("omega_z", [0.0, 20.0])
def test_sampled_loop_is_an_isotropic_lossless_foucault_pendulum(rate, omega_z):
    gain, mix = np.zeros(8), np.zeros(4)
    feedback(truth(), omega_z, K, 1 / rate, True, gain, mix, np.zeros(HOLD_SIZE))
    phi, gamma = sampled(REFERENCE, omega_z, 1 / rate)
    values = np.linalg.eigvals(phi + gamma @ gain.reshape(2, 4))
    turns = np.log(values[values.imag > 0]) * rate
    omega = np.sqrt(K / REFERENCE[6])
    expected = np.array([omega - omega_z, omega + omega_z])
    # Exact to rounding over T for omega_z = 0. The Coriolis force itself raises both by
    # omega_z^2 / (2 omega), 0.011 rad/s, and the gains treat omega_z to first order.
    tolerance = 1e-5 if omega_z == 0.0 else 0.02
    np.testing.assert_allclose(np.sort(turns.imag), expected, rtol=0, atol=tolerance)
    np.testing.assert_allclose(turns.real, 0.0, atol=tolerance)


def test_plain_hold_grows_as_the_specification_says():
    gain, mix = np.zeros(8), np.zeros(4)
    feedback(truth(), 0.0, K, 1e-5, False, gain, mix, np.zeros(HOLD_SIZE))
    phi, gamma = sampled(REFERENCE, 0.0, 1e-5)
    values = np.linalg.eigvals(phi + gamma @ gain.reshape(2, 4))
    # SYSTEM.md section 3, measured: +62 /s at 100 kHz.
    assert np.log(np.abs(values)).max() * 1e5 == pytest.approx(62.0, abs=0.5)


def test_forced_response_is_a_motion_of_the_loop():
    _, outputs = run(1, np.zeros(4))
    states, outputs = run(4000, outputs[0, FORCED : FORCED + 4])
    scale = np.abs(states).max(axis=0)
    # Exact but for rounding, which the lossless loop lets grow like the number of samples.
    assert (np.abs(states - outputs[:, FORCED : FORCED + 4]) / scale).max() < 1e-9


def test_change_of_rate_does_not_change_the_forced_response():
    _, outputs = run(1, np.zeros(4), omega_z=20.0)
    states, outputs = run(4000, outputs[0, FORCED : FORCED + 4], omega_z=20.0)
    # The Coriolis force is cancelled at t_k, not at mid-hold: 500 Hz * T / 2 * 2 pi = 0.8 % of a
    # part 2 omega_z omega_t / omega^2 = 4e-4 of the response.
    difference = np.abs(states - outputs[:, FORCED : FORCED + 4])[:, ::2].max()
    assert difference < 1e-4 * np.abs(states[:, ::2]).max()


def test_energy_loop_restores_the_amplitude_without_turning():
    angle = np.radians(30.0)
    start = 0.5e-6 * np.array([np.cos(angle), 0.0, np.sin(angle), 0.0])
    changes = {"tone_amplitude": 0.0, "energy_loop": 1.0, "energy_rate": 200.0}
    states, outputs = run(8000, start, **changes)
    last = states[-200:]
    amplitude = np.sqrt((last[:, 0] ** 2 + last[:, 2] ** 2).max())
    # Eight time constants of the logistic approach from a quarter of the energy.
    assert amplitude == pytest.approx(CONTROLLER.settings["amplitude"], rel=5e-3)
    biggest = last[np.argmax(last[:, 0] ** 2 + last[:, 2] ** 2)]
    # Isotropic damping turns nothing; 0.02 deg is the ripple of the sampled mode at 6 kHz.
    turned = np.degrees(np.arctan2(biggest[2], biggest[0])) % 180.0 - 30.0
    assert abs(turned) < 0.05
    assert outputs[-1, OMEGA_SQUARED] == K / REFERENCE[6]


def test_converges_once_the_constants_agree_and_are_known():
    def observe(k, estimate, deviation):
        estimate[5] *= 1.0 + (0.02 if k < 1000 else 0.0)
        deviation[9] = REFERENCE[4] * (0.02 if k < 5000 else 0.005)

    _, outputs = run(8001, [1e-6, 0, 0, 0], observe=observe)
    # U_n every 2000 samples: k = 2000 differs from k = 0, 4000 agrees but dyy is not known, 6000.
    assert outputs[5999, CONVERGED] == 0.0
    assert np.isnan(outputs[5999, CONVERGED_AT])
    assert outputs[6000, CONVERGED] == 1.0
    assert outputs[-1, CONVERGED_AT] == 6000 * PERIOD


def test_force_is_bounded_while_estimates_are_wrong():
    def observe(k, estimate, deviation):
        estimate[:4] *= 100.0

    _, outputs = run(10, [1e-6, 0, 0, 0], observe=observe)
    limit = CONTROLLER.settings["force_limit"] * K * CONTROLLER.settings["amplitude"]
    # Beside the feedback there are the two tones of 32 uN.
    assert np.hypot(outputs[:, 0], outputs[:, 1]).max() < limit + 2 * 32e-6


def test_unknown_setting_is_refused():
    with pytest.raises(ValueError, match="no setting 'stiffness'"):
        CONTROLLER.settings_array(stiffness=1.0)
