"""The envelope form against what is known by hand: straight devices by linear algebra, curved ones by textbook."""

import re
import textwrap
from collections.abc import Callable
from math import exp, pi, sqrt
from typing import Any

import numpy as np
import pytest
from envelope_device import (
    F_X,
    F_Y,
    LOSSLESS,
    W_X,
    Complexes,
    Floats,
    M,
    answer,
    envelopes,
    matrices,
    rate_device,
    settled,
    start_at,
)
from gyro_runner import Runner
from scipy.linalg import expm

from gyro_model.build import CHECKOUT, build, default_folder
from gyro_model.envelope import envelope_model
from gyro_model.model import load_model

Residual = Callable[[str, float, float], None]
NO_FORCE = np.zeros(2, complex)
GAIN = 1e6  # V/m, of both axes


@pytest.mark.parametrize("frequency", [F_X, F_X + 2.5, F_Y, 2500.0])
@pytest.mark.parametrize("rate", [0.0, 10.0])
def test_steady_state_is_the_dynamic_stiffness(
    envelope: Runner, residual: Residual, frequency: float, rate: float
) -> None:
    p = rate_device(2000.0, dxy=1e-9)
    force = np.array([1e-7 + 2e-7j, -3e-8 + 5e-8j])
    wanted = answer(p, frequency, force, rate)
    found = settled(envelope, p, force, frequency, omega_z=rate)
    # S is a rounding of its size off, which counts against the decay of w/2Q: 2 Q roundings.
    residual("amplitude", np.max(np.abs(found[2:] / wanted - 1)), 10 * 2 * 2000 * 2.2e-16)
    residual("voltage", np.max(np.abs(found[:2] / (GAIN * found[2:]) - 1)), 1e-15)


def test_hand_formulae_of_bias_scale_factor_and_quadrature(envelope: Runner) -> None:
    # With x at amplitude A, phase 0, y sees -(kxy + i w dxy + 2 i m w rate) A; so say the signs that loops rely on.
    p = rate_device(1e4, dxy=2e-9)
    amplitude, rate = 5e-6, 0.1
    drive = np.array([1j * p["dxx"] * W_X * amplitude, 0.0])
    x, y = settled(envelope, p, drive, omega_z=rate)[2:]
    force_y = -(p["kxy"] + 1j * W_X * p["dxy"] + 2j * M * W_X * rate) * x
    assert y == pytest.approx(force_y / (p["kyy"] - M * W_X**2 + 1j * W_X * p["dyy"]), rel=1e-9)
    # y pulls back on x by |kxy|²/(2 m w 2π 50 Hz) against w dxx: 9 % here, a quarter turn ahead.
    assert abs(x - amplitude) < 0.1 * amplitude


def full_motion(p: dict[str, float], rate: float = 0.0) -> Floats:
    """A of s' = A s with s = x, y, x', y'."""
    _, damping, stiffness = matrices(p, rate)
    return np.block([[np.zeros((2, 2)), np.eye(2)], [-stiffness / M, -damping / M]])


def test_free_motion_is_that_of_the_full_plant(envelope: Runner, residual: Residual) -> None:
    p = rate_device(1000.0, kxy=0.5, dxy=5e-9)
    amplitude = np.array([3e-6 + 1e-6j, -2e-6j])
    motion = full_motion(p, rate=3.0)
    values, vectors = np.linalg.eig(motion)
    forward = values.imag > 0
    turned = vectors[:2, forward]
    velocity = vectors[2:, forward] @ np.linalg.solve(turned, amplitude)
    start = np.concatenate((amplitude, velocity)).real
    t = np.arange(0, 0.1, 7.3e-4)  # 5 beats, out of step with the carrier
    p |= {"internal_step": 1e-5} | start_at(*amplitude)
    z = envelopes(envelope, p, t, NO_FORCE, 2990.0, omega_z=3.0)[:, 2:]
    x = (z * np.exp(2j * pi * 2990.0 * t)[:, None]).real
    wanted = np.array([(expm(motion * instant) @ start)[:2] for instant in t])
    # 2e3 radians in steps of an internal step, each a rounding off.
    residual("x and y", np.max(np.abs(x - wanted)) / 3e-6, 1e-11)


def test_what_a_force_step_misses_and_the_beat_of_the_first_order_reduction(
    envelope: Runner, residual: Residual
) -> None:
    p = rate_device(2000.0, kxy=0.0)
    w, step, n = W_X, 1.1e-3, 60
    force = np.array([0.0, 1e-8 + 0j])
    found = envelopes(envelope, p | {"internal_step": step}, np.arange(n) * step, force)[:, 3]
    # The full plant in the frame of the carrier, without any reduction.
    turning = full_motion(p) - 1j * w * np.eye(4)
    push = np.linalg.solve(turning, np.concatenate((np.zeros(2), force / M)))
    exact = np.array([((expm(turning * k * step) - np.eye(4)) @ push)[1] for k in range(n)])
    split = 2 * pi * (F_Y - F_X)
    detuning = (p["kyy"] - M * w**2) / (2 * M * w)
    reduced = force[1] / (2 * M * w * detuning) * (np.exp((1j * detuning - p["dyy"] / 2 / M) * np.arange(n) * step) - 1)
    size = np.max(np.abs(exact))
    # Settled and free motion are F/(2 m w split) each, what is missed F/(4 m w²) of each; a tenth for w + w_y > 2 w.
    missed = 1.1 * split / (2 * w)
    residual("of the swing, this form", np.max(np.abs(found - exact)) / size, missed)
    # The reduced beat is split²/2w too fast: after 66 ms 0.17 rad of the free motion, half of the swing.
    assert np.max(np.abs(reduced - exact)) / size > 0.05


def phase_rate(z: Complexes, step: float) -> float:
    """Mean of dφ/dt [rad/s]."""
    return float(np.polyfit(np.arange(len(z)) * step, np.unwrap(np.angle(z)), 1)[0])


def test_duffing_backbone(envelope: Runner, residual: Residual) -> None:
    # w = w0 (1 + 3/8 e - 21/256 e²), e = k3 A²/k (Nayfeh and Mook, section 2.3, with A the first harmonic); to e³.
    amplitude, e = 5e-6, 0.02
    k3 = e * LOSSLESS["kxx"] / amplitude**2
    step = 1e-4
    t = np.arange(300) * step
    p = LOSSLESS | {"k3_x": k3, "internal_step": step} | start_at(amplitude, 0j)
    z = envelopes(envelope, p, t, NO_FORCE)[:, 2]
    # The third harmonic is e/32 A, of which the first harmonic is what A here means: w by A of the first alone is
    # 1 + 3/8 e - 15/256 e².
    wanted = W_X * (3 / 8 * e - 15 / 256 * e**2)
    residual("pull", abs(phase_rate(z, step) / wanted - 1), e**2)
    residual("loss of amplitude", float(np.ptp(np.abs(z))) / amplitude, 1e-6)


def test_quadratic_spring_shifts_mean_and_frequency(envelope: Runner, residual: Residual) -> None:
    # Mean -k2 A²/(2k), pull -5/12 (k2 A/k)² (Nayfeh and Mook, section 2.3).
    amplitude, e = 5e-6, 0.02
    p = LOSSLESS | {"k2_x": e * LOSSLESS["kxx"] / amplitude, "internal_step": 1e-4} | start_at(amplitude, 0j)
    t = np.arange(2000) * 1e-4
    z = envelopes(envelope, p, t, NO_FORCE)[:, 2]
    mean = envelope.run(p, t[:50], outputs=("x_mean",))["x_mean"][-1]
    residual("mean", abs(mean / (-0.5 * e * amplitude) - 1), 2 * e**2)
    residual("pull", abs(phase_rate(z[10:], 1e-4) / (-5 / 12 * e**2 * W_X) - 1), 10 * e**2)


def test_softening_moves_the_resonance(envelope: Runner, residual: Residual) -> None:
    # k - a V² at small amplitude, whatever the step: 30 Hz at 1 ms would be far too much for a force held in a step.
    k = LOSSLESS["kxx"]
    p = LOSSLESS | {"softening": 0.02 * k, "internal_step": 1e-3} | start_at(1e-9 + 0j, 0j)
    t = np.arange(100) * 1e-3
    z = envelopes(envelope, p, t, NO_FORCE, v_bias=1.0)[:, 2]
    # (A/g)² = 1e-8 of the softening.
    residual("shift", abs(phase_rate(z, 1e-3) - W_X * (sqrt(0.98) - 1)) / W_X, 1e-9)


def test_nonlinear_damping_decays_as_its_closed_form(envelope: Runner, residual: Residual) -> None:
    # A' = -(d/2m) A - (d2/8m) A³, so that 1/A² grows as an exponential.
    q, amplitude = 500.0, 5e-6
    p = rate_device(q, kxy=0.0)
    a, b = p["dxx"] / (2 * M), 4 * p["dxx"] / (2 * M) / amplitude**2
    p |= {"d2_x": 8 * M * b, "internal_step": 1e-4} | start_at(amplitude, 0j)
    t = np.arange(500) * 1e-4
    z = envelopes(envelope, p, t, NO_FORCE)[:, 2]
    wanted = amplitude / np.sqrt(np.exp(2 * a * t) * (1 + b / a * amplitude**2) - b / a * amplitude**2)
    # Averaging leaves out squares of the decay in a cycle: (1/Q)²; the midpoint rule (h rate)²/24 with the rate 13 a.
    residual("amplitude", np.max(np.abs(np.abs(z) / wanted - 1)), 1 / q**2 * 20 + (13 * a * 1e-4) ** 2)


def test_delay_and_lag_turn_the_phase(envelope: Runner, residual: Residual) -> None:
    p, delay, tau = rate_device(500.0), 4e-6, 3e-6
    force = np.array([2e-7j, 0.0])
    plain, late = settled(envelope, p, force), settled(envelope, p | {"actuator_delay": delay}, force)
    lagging = settled(envelope, p | {"amplifier_time_constant": tau}, force)
    residual("delay", np.max(np.abs(late / plain - np.exp(-1j * W_X * delay))), 1e-14)
    residual("lag", np.max(np.abs(lagging[:2] / plain[:2] - 1 / (1 + 1j * W_X * tau))), 1e-14)
    assert np.array_equal(lagging[2:], plain[2:])


def test_thermal_phase_and_lag(envelope: Runner, residual: Residual) -> None:
    p = rate_device(500.0, amplifier_time_constant=1e-6, tcp=2e-8, circuit_lag=30.0, internal_step=0.1) | {
        "t_ref": 300.0
    }
    t = np.arange(401) * 0.1
    names = ("temperature_circuit", "temperature_structure", "v_x_i", "v_x_q", "x_i", "x_q")
    ambient = np.where(t < 10.0, 300.0, 340.0)
    rows = envelope.run(p, t, {"u_x_q": np.full(len(t), 1e-7), "temperature": ambient}, names)
    warmed = 300.0 + 40.0 * (1 - np.exp(-np.maximum(t - 10.0, 0.0) / 30.0))
    residual("circuit", np.max(np.abs(rows["temperature_circuit"] - warmed)), 1e-10)
    assert np.array_equal(rows["temperature_structure"][1:], ambient[:-1])
    last = complex(rows["v_x_i"][-1], rows["v_x_q"][-1]) / complex(rows["x_i"][-1], rows["x_q"][-1]) / GAIN
    tau = 1e-6 + 2e-8 * (warmed[-1] - 300.0)
    residual("phase", abs(last - 1 / (1 + 1j * W_X * tau)), 1e-13)


def test_damping_step_off_the_grid(envelope: Runner, residual: Residual) -> None:
    p = rate_device(500.0, kxy=0.0, damping_step_factor=3.0, damping_step_time=0.0123, internal_step=0.01)
    z = envelopes(envelope, p | start_at(1e-6 + 0j, 0j), np.arange(5) * 0.01, NO_FORCE)[:, 2]
    before, after = full_motion(p), full_motion(p | {"dxx": 3 * p["dxx"], "dyy": 3 * p["dyy"]})
    decay = p["dxx"] / (2 * M)
    speed = (-decay + 1j * sqrt(W_X**2 - decay**2)) * 1e-6
    wanted = expm(after * (0.04 - 0.0123)) @ expm(before * 0.0123) @ [1e-6, 0.0, speed.real, 0.0]
    # At 0.04 s the carrier has turned 120 times; 2 Q roundings.
    residual("x", abs(z[-1].real - wanted[0]) / abs(wanted[0]), 1e-11)
    # The phase at which it steps counts for the change of the decay over 2 w: 1/Q.
    residual("amplitude", abs(abs(z[-1]) / 1e-6 / exp(-decay * (0.0123 + 3 * (0.04 - 0.0123))) - 1), 1 / 500)


def test_offset_falls_out_and_clipping_is_projected(envelope: Runner, residual: Residual) -> None:
    p = rate_device(500.0, kxy=0.0)
    force = np.array([1j * p["dxx"] * W_X * 1e-6, 0.0])
    plain = settled(envelope, p, force)
    assert np.array_equal(settled(envelope, p | {"offset_x": 0.3, "offset_drift": 0.01}, force), plain)
    limit = 0.8 * abs(plain[0])
    # A clipped sine's first harmonic: 2/π (asin c + c √(1 - c²)), c = limit/amplitude.
    share = 2 / pi * (np.arcsin(0.8) + 0.8 * 0.6)
    # Corners between two of 32 phases: their squared spacing.
    residual(
        "clip", abs(settled(envelope, p | {"adc_limit": limit}, force)[0] / plain[0] - share), (2 * pi / 32) ** 2 / 4
    )


def test_pickoff_gap_is_projected(envelope: Runner, residual: Residual) -> None:
    p = rate_device(500.0, kxy=0.0)
    force = np.array([1j * p["dxx"] * W_X * 2e-6, 0.0])
    z = settled(envelope, p | {"pickoff_inverse_gap": 1e5}, force)
    # First harmonic of c/(1 - r² c²), c = cos φ, r = 0.2: 2 (1/√(1 - r²) - 1)/r².
    r = 1e5 * abs(z[2])
    residual("gain", abs(z[0] / z[2] / GAIN - 2 * (1 / sqrt(1 - r**2) - 1) / r**2), 1e-12)


def test_parasitic_mode_pulls_at_the_carrier(envelope: Runner, residual: Residual) -> None:
    p = rate_device(2000.0, kxy=0.0, parasitic_coupling=0.5, parasitic_frequency=4000.0, parasitic_q=300.0)
    force = np.array([1e-7j, 0.0])
    w, own = 2 * pi * 2999.0, 2 * pi * 4000.0
    pull = 0.5**2 / M / (own**2 - w**2 + 1j * w * own / 300.0)
    wanted = force[0] / (p["kxx"] - pull - M * w**2 + 1j * w * p["dxx"])
    residual("x", abs(settled(envelope, p, force, 2999.0)[2] / wanted - 1), 1e-10)


def test_mean_follows_acceleration(envelope: Runner) -> None:
    p = rate_device(500.0, acceleration_gain_x=-1.0)
    t = np.arange(3) * 1e-3
    rows = envelope.run(p, t, {"a_x": np.full(3, 10.0)}, ("x_mean", "y_mean", "x_i"))
    mass, _, stiffness = matrices(p)
    wanted = np.linalg.solve(stiffness, -10.0 * mass @ np.array([1.0, 0.0]))
    assert [rows["x_mean"][-1], rows["y_mean"][-1]] == pytest.approx(wanted, rel=1e-12)
    assert rows["x_i"][-1] == 0.0


def test_jolt_of_a_rate_step(envelope: Runner, residual: Residual) -> None:
    p = rate_device(1e6, kxy=0.0, frame_rotation=1.0, angular_gain=0.0, internal_step=1e-4) | start_at(1e-6 + 0j, 0j)
    t = np.arange(3) * 1e-4
    rows = envelope.run(p, t, {"omega_z": np.array([0.0, 5.0, 5.0])}, ("y_i", "y_q", "x_i", "x_q"))
    # y' jumps by -ΔΩ x, of x as it is at that phase; then y swings freely, the centrifugal force of 25 m x far below.
    phase = np.exp(2j * pi * F_X * t)
    x, y = ((rows[f"{axis}_i"] + 1j * rows[f"{axis}_q"]) * phase for axis in "xy")
    wanted = -5.0 * x[1].real / (2 * pi * F_Y) * np.sin(2 * pi * F_Y * 1e-4)
    # Damping takes ωt/2Q = 1e-6 of it.
    residual("y", abs(y[2].real / wanted - 1), 2e-6)


@pytest.mark.parametrize("instant", [0.02, 0.02 + 0.25 / F_X, 0.02 + 0.13 / F_X])
def test_a_step_at_any_phase_is_that_of_the_full_plant(envelope: Runner, residual: Residual, instant: float) -> None:
    # Rate and force step at once, with the drive on; what the plant hears is its force as amplitudes of the carrier.
    p = rate_device(1000.0, kxy=0.5, dxy=5e-9)
    forces = np.array([[1j * p["dxx"] * W_X * 1e-6, 0.0], [1.3j * p["dxx"] * W_X * 1e-6, -2e-8 + 1e-8j]])
    start = answer(p, F_X, forces[0])
    after = instant + np.arange(1, 400) * 7.3e-5
    t = np.array([0.0, instant, *after])
    stepped = np.arange(len(t)) >= 1
    inputs = {
        f"u_{axis}_{part}": np.where(stepped, *(getattr(forces[k][i], of) for k in (1, 0)))
        for i, axis in enumerate("xy")
        for part, of in (("i", "real"), ("q", "imag"))
    }
    p |= start_at(*start)
    names = ("x_i", "x_q", "y_i", "y_q")
    rows = envelope.run(p, t, inputs | {"omega_z": np.where(stepped, 1.0, 0.0)}, names)
    motion = np.zeros((6, 6))
    motion[:4, :4] = full_motion(p, rate=1.0)
    motion[2:4, 4], motion[2:4, 5] = forces[1].real / M, -forces[1].imag / M
    motion[4, 5], motion[5, 4] = -W_X, W_X
    turn = np.exp(1j * W_X * instant)
    begin = [*(start * turn).real, *(1j * W_X * start * turn).real, turn.real, turn.imag]
    wanted = np.array([(expm(motion * (s - instant)) @ begin)[:2] for s in after])
    for i, axis in enumerate("xy"):
        found = ((rows[f"{axis}_i"] + 1j * rows[f"{axis}_q"]) * np.exp(1j * W_X * t)).real[2:]
        # Phases of 4e2 to 1e3 radians, and 2 Q roundings a cycle apart. Amplitudes alone would be 1e-2 off.
        residual(axis, np.max(np.abs(found - wanted[:, i])) / np.max(np.abs(wanted[:, i])), 3e-10)


def test_the_example_of_the_documentation(monkeypatch: pytest.MonkeyPatch) -> None:
    section = (CHECKOUT / "docs/reference/fmu.md").read_text(encoding="utf-8").split("## The envelope")[1]
    code = section[section.index("    import numpy as np\n") :].split("\n\n")[0]
    monkeypatch.chdir(default_folder(load_model()).parent)
    build(envelope_model())
    said: dict[str, Any] = {}
    exec(textwrap.dedent(code), said)
    last = said["result"][-1]
    numbers = [float(n) for n in re.findall(r"-?\d+\.\d+(?= mV)", code)]
    assert len(numbers) == 2
    assert [1e3 * last["v_y_i"], 1e3 * last["v_y_q"]] == pytest.approx(numbers, abs=0.005)
    assert said["result"]["v_x_i"] == pytest.approx(4.0, rel=1e-3)
    assert np.all(said["result"]["v_y_q"][:500] == 0.0)
