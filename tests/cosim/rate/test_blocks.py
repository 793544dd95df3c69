"""The blocks of rate mode, each alone: filters, phase loop, amplitude loop, rebalance."""

from math import pi

import numpy as np
import pytest
from scipy import signal

from cosim.rate.drive_loop import AmplitudeLoop, PhaseLoop, amplitude_loop, phase_loop
from cosim.rate.filters import LowPass, delay, demodulate, low_pass
from cosim.rate.loop import STATE
from cosim.rate.sense_loop import Rebalance, rebalance

PERIOD = 5e-6


def filtered(block: LowPass, samples: np.ndarray) -> np.ndarray:
    first = second = 0j
    out = np.empty(len(samples), dtype=complex)
    for k, sample in enumerate(samples):
        first, second = low_pass(block, first, second, sample)
        out[k] = second
    return out


def test_low_pass_is_two_equal_sections_with_the_bandwidth_asked_for() -> None:
    block = LowPass.design(400.0, PERIOD)
    section = [block.gain], [1.0, block.gain - 1]
    _, response = signal.freqz(*section, worN=[0.0, 400.0], fs=1 / PERIOD)
    assert abs(response[0]) == pytest.approx(1.0, rel=1e-12)
    # A held input's zero adds (2π f_1 T)²/24 = 2e-5 to the power of a continuous section.
    assert abs(response[1]) ** 4 == pytest.approx(0.5, rel=1e-3)
    step = filtered(block, np.ones(2000))
    expected = signal.lfilter(*section, signal.lfilter(*section, np.ones(2000)))
    np.testing.assert_allclose(step.real, expected, rtol=1e-12)


def test_delay_is_the_centroid_of_the_impulse_response() -> None:
    impulse = np.zeros(4000)
    impulse[0] = 1.0
    response = filtered(LowPass.design(400.0, PERIOD), impulse).real
    # Half a sample a section: the hold.
    assert (np.arange(4000) * PERIOD * response).sum() == pytest.approx(delay(400.0), abs=1.1 * PERIOD)


def test_demodulator_gives_amplitude_and_phase_without_ripple() -> None:
    block, envelope = LowPass.design(400.0, PERIOD), 3.0 * np.exp(0.3j)
    first = second = 0j
    last = []
    for k in range(8000):
        reference = np.exp(2j * pi * 5000.123 * k * PERIOD)
        first, second = demodulate(block, first, second, (envelope * reference).real, reference)
        last.append(second)
    # 40 ms are 100 time constants; what is left is rounding.
    np.testing.assert_allclose(last[-500:], envelope, rtol=1e-12)


def test_phase_loop_answers_as_the_second_order_loop_it_is_designed_for() -> None:
    natural, decay, period, jump = 2 * pi * 20.0, 3.0, 1e-5, 2 * pi * 0.5
    block = PhaseLoop.design(1e4, decay, 4.0, 20.0, period)
    state = np.zeros(1, STATE)[0]
    error, found = 0.0, []
    for _ in range(10_000):
        phase_loop(block, state, 4.0 * np.exp(1j * error))
        # Slow plant of the drive mode, whose resonance has jumped by 0.5 Hz.
        error += period * (1e4 + jump - state["omega"] - decay * error)
        found.append(error)
    t = np.arange(1, 10_001) * period
    transfer = signal.lti([jump, 0], [1, 2 * np.sqrt(0.5) * natural, natural**2])
    _, expected = signal.step(transfer, T=np.concatenate(([0.0], t)))
    # Euler's method at ω_n T = 1.3e-3, and sin ε for ε.
    np.testing.assert_allclose(found, expected[1:], atol=3e-3 * np.abs(expected).max())
    assert state["omega"] == pytest.approx(1e4 + jump, rel=1e-7)


def test_phase_loop_waits_for_a_signal() -> None:
    block = PhaseLoop.design(1e4, 3.0, 4.0, 20.0, PERIOD)
    state = np.zeros(1, STATE)[0]
    phase_loop(block, state, 0.39 * 1j)
    assert state["omega"] == 1e4
    phase_loop(block, state, 0.41 * 1j)
    assert state["omega"] > 1e4


def test_amplitude_loop_settles_at_the_set_voltage_without_winding_up() -> None:
    decay, force, period = 3.0, 2.5e-8, 1e-5
    block = AmplitudeLoop.design(4.0, force, decay, 10.0, period)
    state = np.zeros(1, STATE)[0]
    voltage, highest, largest = 0.0, 0.0, 0.0
    for _ in range(50_000):
        amplitude_loop(block, state, complex(voltage))
        voltage += period * decay * (4.0 * state["force"] / force - voltage)
        highest, largest = max(highest, voltage), max(largest, state["force"])
    assert largest == block.largest
    assert voltage == pytest.approx(4.0, rel=1e-6)
    assert state["force"] == pytest.approx(force, rel=1e-5)
    # ζ = 1/√2 alone overshoots by 21 % with this zero; a wound-up integral would by far more than it.
    assert highest < 1.21 * 4.0


def test_rebalance_leaves_one_real_pole() -> None:
    gain, mass, omega, period, bandwidth = 1e6, 2e-8, 2 * pi * 5000, 1e-3, 30.0
    pole = complex(-26.0, 2 * pi * 50)
    block = Rebalance.design(gain, mass, omega, pole, bandwidth, period)
    disturbance = 1e-8 - 3e-9j
    state = np.zeros(1, STATE)[0]
    # Exact step of z' = p z + G (D + U)/(2imω) under held forces.
    a = np.exp(pole * period)
    by_force = gain * (a - 1) / (2j * mass * omega * pole)
    z, forces = 0j, []
    for _ in range(1000):
        rebalance(block, state, z)
        forces.append(state["sense_force"])
        z = a * z + by_force * (disturbance + state["sense_force"])
    expected = -disturbance * (1 - np.exp(-2 * pi * bandwidth * period * np.arange(1000)))
    # Rounding only: the zero stands exactly on the pole.
    np.testing.assert_allclose(forces, expected, atol=1e-12 * abs(disturbance))
    # The cancelled pole still decays, at 26 /s: e^-26 after 1 s.
    assert abs(z) < 1e-9 * abs(by_force * disturbance)


def test_open_loop_gives_no_force() -> None:
    state = np.zeros(1, STATE)[0]
    rebalance(Rebalance.none(), state, 1 + 2j)
    assert state["sense_force"] == 0
