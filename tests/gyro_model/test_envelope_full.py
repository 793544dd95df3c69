"""The envelope form beside the full plant in steady state: what a rate gyroscope reads, over temperature and rate."""

from collections.abc import Callable

import numpy as np
import pytest
from envelope_device import F_X, W_X, W_Y, Complexes, M, demodulated, rate_device, settled
from gyro_runner import Runner

Residual = Callable[[str, float, float], None]
AMPLITUDE, GAIN = 5e-6, 1e6
RANGE = np.radians(300.0)  # rad/s, full range
Q = 300.0
# Time constant of the amplitude 2 Q/w = 32 ms. The full plant starts at the envelope's amplitudes; what that start
# lacks, harmonics and mean above all, is 1e-2 at most and has faded by e^-9 when the last 0.1 s begin.
SECONDS = 0.4

THERMAL = {
    **{"tck": -6e-5, "tck_split": 4e-5, "tcd": 3e-3, "tcg": 2e-4, "tcp": 2e-8, "amplifier_time_constant": 3e-6},
    **{"dxy": 3e-9, "angular_gain": 0.8},
}


def drive(p: dict[str, float]) -> Complexes:
    return np.array([1j * p["dxx"] * W_X * AMPLITUDE, 0.0])


def both(envelope: Runner, plant: Runner, p: dict[str, float], **inputs: float) -> tuple[Complexes, Complexes]:
    """v_x, v_y [V] of the envelope form and of the full plant."""
    slow = settled(envelope, p, drive(p), **inputs)
    # Where a lag below the step counts, the full plant's own interpolation does: 1 µs.
    step = 1e-6 if "amplifier_time_constant" in p else 5e-6
    fast = demodulated(plant, p | {"internal_step": step}, slow[2:], drive(p), F_X, SECONDS, **inputs)
    return slow[:2], fast


def reading(v: Complexes) -> tuple[float, float]:
    """Rate and quadrature [rad/s] by the nominal response: y over x, Coriolis along -i, quadrature along -1."""
    response = 2 * M * W_X / (M * (W_Y**2 - W_X**2 + 1j * W_X * W_Y / Q))
    turned = -v[1] / v[0] / response
    return float(turned.imag), float(turned.real)


def test_bias_scale_factor_and_quadrature_over_temperature(envelope: Runner, plant: Runner, residual: Residual) -> None:
    p = rate_device(Q, **THERMAL)
    for temperature in (233.15, 298.15, 358.15):
        rates = (0.0, RANGE)
        pairs = [both(envelope, plant, p, temperature=temperature, omega_z=rate) for rate in rates]
        (slow_0, quad_slow), (slow_1, _) = (reading(slow) for slow, _ in pairs)
        (fast_0, quad_fast), (fast_1, _) = (reading(fast) for _, fast in pairs)
        # Of full range; asked is 1e-2. The lag's interpolation in the full plant leaves 1e-8.
        residual(f"bias at {temperature} K", abs(slow_0 - fast_0) / RANGE, 1e-7)
        residual(f"quadrature at {temperature} K", abs(quad_slow - quad_fast) / RANGE, 1e-7)
        residual(f"scale factor at {temperature} K", abs((slow_1 - slow_0) - (fast_1 - fast_0)) / RANGE, 1e-7)
        assert abs((slow_1 - slow_0) / RANGE - 0.8) < 0.2, "the device reads rate, at about its angular gain"


CURVED = {
    "cubic_stiffness": {"k3_x": 1e9, "k3_y": 1e9},
    "quadratic_stiffness": {"k2_x": 1e5, "k2_y": 1e5},
    "nonlinear_damping": {"d2_x": 4e4 * M * W_X / Q * 1e6},
    "electrostatic_softening": {"softening": 0.5},
    "actuator_nonlinearity": {"actuator_a2": 1e4, "actuator_a3": 1e10},
    "pickoff_mismatch": {"pickoff_inverse_gap": 4e4, "pickoff_mismatch": 0.1},
    "parasitic_mode": {"parasitic_coupling": 0.5},
    "actuator_delay": {"actuator_delay": 1e-5},
    "pickoff_misalignment": {"pickoff_misalignment": 1e-2},
    "actuator_misalignment": {"actuator_misalignment": 1e-2, "actuator_gain_mismatch": 0.02},
    "adc_clipping": {"adc_limit": 4.0},
    "constant_force": {"force_x": 2e-5, "force_y": -1e-5, "k3_x": 1e10},
    "cross_cubic_stiffness": {"k22": 5e10},
    "dry_friction": {"friction_x": 1e-7, "friction_y": 2e-9, "friction_speed": 3e-2},
    "squeeze_film": {"squeeze_x": 2e-7, "squeeze_y": 2e-7, "squeeze_gap": 9e-6},
    "comb_fringe": {"comb_fringe": 1e4, "k2_x": 1e5},
    "contact_stop": {"stop_stiffness": 2.0, "stop_gap": 4e-6},
}
# What is left: corners of clipping and of a stop that fall between 32 phases, with the friction's harmonics above the
# third; the actuator's curve acts before the hold, which takes
# 4e-4 of the amplitude, on a cubic part of 1 %; else the transient of the full plant.
LIMITS = {"adc_clipping": 2e-3, "actuator_nonlinearity": 1e-5, "dry_friction": 1e-6, "contact_stop": 5e-3} | {
    # Displaced by x0, a cubic spring shakes at twice the frequency, and that comes back: 9 (k3 x0 A)²/k² of it, 2e-6.
    "constant_force": 5e-6,
}


@pytest.mark.parametrize("effect", CURVED)
def test_each_effect_in_steady_state(effect: str, envelope: Runner, plant: Runner, residual: Residual) -> None:
    p = rate_device(Q, **CURVED[effect])
    slow, fast = both(envelope, plant, p, omega_z=0.5, v_bias=1.0)
    residual("v_x", abs(slow[0] / fast[0] - 1), LIMITS.get(effect, 1e-7))
    residual("v_y", abs(slow[1] / fast[1] - 1), LIMITS.get(effect, 1e-7))
    plain = settled(envelope, rate_device(Q), drive(p), omega_z=0.5)[:2]
    assert np.max(np.abs(slow / plain - 1)) > 1e-4, "large enough to be seen"


# With k22 the forces join the axes, and none of them is followed as a stiffness of its own axis alone.
@pytest.mark.parametrize(("stiffness", "k22"), [(20.0, 0.0), (200.0, 0.0), (1e5, 0.0), (200.0, 1e9)])
def test_a_hard_stop_holds_the_amplitude(
    stiffness: float, k22: float, envelope: Runner, plant: Runner, residual: Residual
) -> None:
    # Q 5000: slow enough that the drive of both stays on the stop, at 0.3 to 1,600 times the suspension's stiffness.
    p = rate_device(5000.0, kxy=0.0, stop_stiffness=stiffness, stop_gap=3.5e-6, k22=k22)
    force = drive(p)
    slow = settled(envelope, p, force)
    fast = demodulated(plant, p, slow[2:], force, F_X, SECONDS)
    # Harmonics above the third, and the corner between 32 phases: the gap's entry is 1/64 of it.
    residual("amplitude", abs(abs(slow[0]) / abs(fast[0]) - 1), 2e-3)
    residual("phase", abs(np.angle(slow[0] / fast[0])), 1e-2)
    assert abs(slow[0]) < 1.02 * 3.5e-6 * GAIN, "the stop holds it: unbounded, it would be 5 µm"
    finer = settled(envelope, p | {"internal_step": 1e-4}, force)
    residual("shorter steps", abs(finer[0] / slow[0] - 1), 1e-9)
