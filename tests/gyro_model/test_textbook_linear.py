"""The linear gyroscope of the FMU against the textbook: decay, phase, Foucault, resonance, modes, delay, lag."""

from collections.abc import Callable

import mpmath
import numpy as np
import pytest
from gyro_runner import Runner

Residual = Callable[[str, float, float], None]

M, K, D = 1.8e-7, 63.955, 1.8e-6
W = np.sqrt(K / M)
UNCOUPLED = {"m": M, "kxx": K, "kyy": 95.92, "kxy": 0.0, "dxx": D, "dyy": D, "dxy": 0.0}
ISOTROPIC = {"m": M, "kxx": K, "kyy": K, "kxy": 0.0, "dxx": 0.0, "dyy": 0.0, "dxy": 0.0}
A = 1e-6


def test_free_decay(plant: Runner, residual: Residual) -> None:
    t = np.arange(2001) * 2.5e-5
    x = plant.run({**UNCOUPLED, "x_start": A}, t)["x"]
    gamma = D / (2 * M)
    w = np.sqrt(W**2 - gamma**2)
    wanted = A * np.exp(-gamma * t) * (np.cos(w * t) + gamma / w * np.sin(w * t))
    # 50 000 steps round 1e-16 of a turn of 0.02 rad each, the cosine 1e-16 of 950 rad: 1e-13. The method leaves less.
    residual("free decay", np.max(np.abs(x - wanted)) / A, 1e-11)


# At 1 ms a step is 25 times the size of the motion's matrix.
@pytest.mark.parametrize("internal_step", [1e-6, 5e-6, 3.3e-5, 1e-3])
def test_phase_after_one_second(plant: Runner, residual: Residual, internal_step: float) -> None:
    # The reference device, all its coupling and a rate, against the matrix exponential with 40 digits.
    p = {
        "m": M,
        "kxx": 63.955,
        "kyy": 95.92,
        "kxy": 12.779,
        "dxx": 1.8e-6,
        "dyy": 1.8e-6,
        "dxy": 3.6e-7,
        "omega_z": 5.0,
    }
    mpmath.mp.dps = 40
    m = mpmath.mpf(p["m"])
    k = [[-p["kxx"] / m, -p["kxy"] / m], [-p["kxy"] / m, -p["kyy"] / m]]
    turn = 2 * mpmath.mpf(p["omega_z"])
    d = [[-p["dxx"] / m, -p["dxy"] / m + turn], [-p["dxy"] / m - turn, -p["dyy"] / m]]
    rows = [[0, 1, 0, 0], [k[0][0], d[0][0], k[0][1], d[0][1]], [0, 0, 0, 1], [k[1][0], d[1][0], k[1][1], d[1][1]]]
    exact = mpmath.expm(mpmath.matrix(rows)) * mpmath.matrix([A, 0, A / 2, 0])
    wanted = np.array([float(value) for value in exact])
    rate = p.pop("omega_z")
    own = {
        "internal_step": internal_step,
        "sample_period": max(internal_step, 5e-6),
        "x_start": A,
        "y_start": A / 2,
        **p,
    }
    out = plant.run(own, np.array([0.0, 1.0]), {"omega_z": np.full(2, rate)})
    got = np.array([out[name][-1] for name in ("x", "x_dot", "y", "y_dot")])
    scale = np.array([1.0, W, 1.0, W])
    # In phase space, an error across the motion is one of its phase, so the whole error bounds that of either mode.
    # 1e-6 rad is what is asked.
    error = np.linalg.norm((got - wanted) / scale) / np.linalg.norm(wanted / scale)
    residual("phase after 1 s [rad]", error, 1e-6)
    # A series to the last bit: only rounding is left, 1e-16 of a turn of 0.02 rad or more a step, as a random walk over
    # 1e6 of them 2e-15; the frequency of 19 krad/s is good to 1e-16 through stiffness and mass: 2e-12, some times that.
    residual("phase after 1 s, as built [rad]", error, 1e-11)


def test_a_step_beside_its_ticks_is_those_ticks(plant: Runner) -> None:
    # 1e-6 * 5 is the double below 5e-6; both are 5 000 000 ticks, so that both take the tabulated way, bit for bit.
    t, start = np.arange(101) * 1e-5, {"x_start": A, "y_start": A / 2}
    beats = [{"internal_step": step, "sample_period": step} for step in (5e-6, 1e-6 * 5)]
    exact, beside = (plant.run({**UNCOUPLED, **start, **own}, t, {"omega_z": np.full(101, 3.0)}) for own in beats)
    assert beats[0] != beats[1]
    for name, values in exact.items():
        np.testing.assert_array_equal(values, beside[name])


def test_foucault_constant_rate(plant: Runner, residual: Residual) -> None:
    # z = x + iy obeys z'' + 2iΩz' + (k/m)z = 0: z = A exp(-iΩt) cos(w't), w'² = k/m + Ω², released with z' = -iΩA.
    omega = 30.0
    t = np.arange(2001) * 5e-5
    out = plant.run({**ISOTROPIC, "x_start": A, "y_dot_start": -omega * A}, t, {"omega_z": np.full(2001, omega)})
    wanted = A * np.exp(-1j * omega * t) * np.cos(np.sqrt(W**2 + omega**2) * t)
    # As the free decay: rounding of 100 000 steps.
    residual("precession", np.max(np.abs(out["x"] + 1j * out["y"] - wanted)) / A, 1e-11)


def test_foucault_changing_rate(plant: Runner, residual: Residual) -> None:
    t = np.arange(20001) * 5e-6
    omega = 20.0 * np.sin(2 * np.pi * 25 * t)
    o = plant.run({**ISOTROPIC, "x_start": A}, t, {"omega_z": omega})
    above = 2 * (W**2 * o["x"] * o["y"] + o["x_dot"] * o["y_dot"])
    angle = 0.5 * np.unwrap(np.arctan2(above, W**2 * (o["x"] ** 2 - o["y"] ** 2) + o["x_dot"] ** 2 - o["y_dot"] ** 2))
    turned = -np.concatenate(([0.0], np.cumsum(omega[:-1]) * 5e-6))
    # A held rate, so the sum is the integral. The body sees a velocity that differs from the inertial one by Ω/ω:
    # 1e-3 rad at the peak rate.
    residual("pattern angle [rad]", np.max(np.abs(angle - turned)), 20.0 / W)


def test_coriolis_sign(plant: Runner) -> None:
    # Moving along +x with Ω > 0 pushes towards -y: y'' = -2 Ω x' (TW 201137310, eq. 1).
    out = plant.run({**ISOTROPIC, "x_dot_start": 0.01}, np.array([0.0, 1e-6]), {"omega_z": np.full(2, 10.0)})
    # The first microsecond, in which x' changes by (ωh)²/2 = 2e-4 of itself.
    assert out["y_dot"][1] == pytest.approx(-2 * 10.0 * 0.01 * 1e-6, rel=2e-4)


def test_resonance_amplitude_and_phase(plant: Runner, residual: Residual) -> None:
    # Q = 20: exp(-ωt/2Q) falls below 1e-12 within 60 ms.
    q, period, force = 20.0, 5e-6, 1e-6
    d = M * W / q
    n = 20001
    t = np.arange(n) * period
    out = plant.run({**UNCOUPLED, "dxx": d}, t, {"u_x": force * np.cos(W * t)})
    tail = t > 0.06
    basis = np.stack([np.cos(W * t[tail]), np.sin(W * t[tail])], axis=1)
    c, s = np.linalg.lstsq(basis, out["x"][tail], rcond=None)[0]
    # Force held over T: amplitude times sinc(ωT/2), late by T/2. At resonance the displacement is a quarter turn late.
    late = W * period / 2
    amplitude = force / (d * W) * np.sin(late) / late
    # Images of the held force at 200 ± 3 kHz: 3/200 of it, answered with 1/(m w²) against Q/(m w²):
    # 0.015·(3/200)²/20 = 2e-7.
    residual("amplitude", abs(np.hypot(c, s) / amplitude - 1), 3e-7)
    residual("phase [rad]", abs(np.arctan2(s, c) - (np.pi / 2 + late)), 3e-7)


def test_parasitic_mode_eigenfrequencies(plant: Runner, residual: Residual) -> None:
    # Two coupled oscillators, the parasitic mode scaled to the proof mass; modes from numpy, and the motion from them.
    kappa, frequency = 3.0, 4000.0
    own = {**UNCOUPLED, "dxx": 0.0, "parasitic_coupling": kappa, "parasitic_frequency": frequency, "parasitic_q": 1e12}
    t = np.arange(2001) * 5e-6
    x = plant.run({**own, "x_start": A}, t)["x"]
    matrix = np.array([[K / M, kappa / M], [kappa / M, (2 * np.pi * frequency) ** 2]])
    squares, modes = np.linalg.eigh(matrix)
    wanted = A * (modes[0] ** 2 @ np.cos(np.sqrt(squares)[:, None] * t))
    # The mode's Q of 1e12 takes ω t/2Q = 1e-10 of it; eigenvalues are good to 1e-15, times 250 rad of phase.
    residual("motion", np.max(np.abs(x - wanted)) / A, 3e-10)
    # And the frequencies themselves, fitted: the coupling pushes them apart from 3000 and 4000 Hz.
    peaks = np.sqrt(squares) / (2 * np.pi)
    assert peaks[0] < 3000.0 < 4000.0 < peaks[1]


@pytest.mark.parametrize("delay", [5e-6, 12.5e-6, 33.3e-6])
def test_delay_is_a_lag_of_phase(plant: Runner, residual: Residual, delay: float) -> None:
    q, period = 20.0, 1e-6
    t = np.arange(80001) * period
    own = {**UNCOUPLED, "dxx": M * W / q, "sample_period": 1e-6}
    u = {"u_x": 1e-6 * np.cos(W * t)}
    tail = t > 0.06
    basis = np.stack([np.cos(W * t[tail]), np.sin(W * t[tail])], axis=1)
    answers = []
    for tau in (0.0, delay):
        c, s = np.linalg.lstsq(basis, plant.run({**own, "actuator_delay": tau}, t, u, ("x",))["x"][tail], rcond=None)[0]
        answers.append(c - 1j * s)
    shift = -np.angle(answers[1] / answers[0])
    # Two images of the held force at 1 MHz ± 3 kHz, which each fit sees with another phase: 3/1000 of the force each,
    # answered with 1/(m w²) against Q/(m w²): 2 (3/1000)³/20 = 3e-9. The start has faded to exp(-ωt/2Q) = 5e-13.
    residual("phase [rad]", abs(shift - W * delay), 3e-9)
    residual("amplitude", abs(abs(answers[1] / answers[0]) - 1), 3e-9)


@pytest.mark.parametrize("tau", [1e-9, 3e-7, 2e-6, 1e-4])
def test_amplifier_lag(plant: Runner, residual: Residual, tau: float) -> None:
    # x = A cos ωt: v = G A Re[e^{iωt}/(1 + iωτ)] and what is left of v(0) = G A.
    t = np.arange(401) * 5e-6
    v = plant.run({**UNCOUPLED, "dxx": 0.0, "x_start": A, "amplifier_time_constant": tau}, t)["v_x"]
    steady = 1 / (1 + 1j * W * tau)
    wanted = (np.exp(1j * W * t) * steady).real + (1 - steady.real) * np.exp(-t / tau)
    # The motion is taken as a quintic polynomial over an internal step: off by (ωh)⁶/46080 = 1.5e-11 at 3 kHz.
    residual("voltage", np.max(np.abs(v - wanted)), 1.5e-11)
