"""The settled rate mode against hand formulas, and the packaged device against Liu et al. 2014."""

from dataclasses import replace
from math import pi, sqrt

import numpy as np
import pytest
from sympy import Expr, Symbol

from benchmarks.rate_device import solve
from cosim.rate.courses import ZERO_CELSIUS
from cosim.rate.settings import settings_of
from cosim.rate.steady_state import calibrate, left_out, output_at, parameters_at, settle, unsettled
from gyro_model.anatomy import Law
from gyro_model.device import Device, load_device
from gyro_model.effects.thermal_stiffness import EFFECT as THERMAL_STIFFNESS
from gyro_model.errors import InputError
from gyro_model.model import load_model
from gyro_model.quantities import size
from gyro_model.symbols import kxx, t, temperature_structure, v_bias

M, W_X, W_Y, Q_X, Q_Y, GAIN, AMPLITUDE = 2e-8, 2 * pi * 5000, 2 * pi * 5050, 5000.0, 600.0, 1e6, 4e-6
RANGE = np.array([-20.0, 0.0, 20.0, 40.0, 60.0])


def simple(**changes: float) -> Device:
    """Two uncoupled axes, 50 Hz apart."""
    axes = {"m": M, "kxx": M * W_X**2, "kyy": M * W_Y**2, "dxx": M * W_X / Q_X, "dyy": M * W_Y / Q_Y}
    none = {"kxy": 0.0, "dxy": 0.0, "sense_gain_x": GAIN, "sense_gain_y": GAIN}
    return Device("simple", axes | none | changes)


@pytest.mark.parametrize("gain", [1.0, 0.8])
def test_open_loop_responds_as_the_hand_formula_says(gain: float) -> None:
    scale = calibrate(simple(angular_gain=gain), AMPLITUDE, closed=False).scale
    # y = F/(m(w_y² - w_d² + i w_d w_y/Q)), F = -2mλΩ x', x' = i w_d A.
    by_hand = GAIN * -2 * M * gain * 1j * W_X * AMPLITUDE / (M * (W_Y**2 - W_X**2 + 1j * W_X * W_Y / Q_Y))
    # The drive frequency is right to rounding, 1e-16 of 5 kHz over the split of 50 Hz, and some of it in the sums.
    assert scale == pytest.approx(by_hand, rel=1e-11)


def test_closed_loop_takes_the_coriolis_force() -> None:
    scale = calibrate(simple(angular_gain=0.8), AMPLITUDE, closed=True).scale
    assert scale == pytest.approx(2j * M * 0.8 * W_X * AMPLITUDE, rel=1e-9)


@pytest.mark.parametrize("closed", [False, True])
def test_quadrature_and_damping_coupling_in_units_of_rate(closed: bool) -> None:
    device = simple(kxy=2e-4, dxy=4e-10)
    output = output_at(device, calibrate(device, AMPLITUDE, closed), 298.15)
    # Ω_q = kxy/(2mw), Ω_b = dxy/(2m). The motion of y acts back on x: relative (Y/A)² = (Ω_q/Δω)² = 3e-7 of either,
    # and Ω_b/Ω_q = 0.06.
    assert output.quadrature == pytest.approx(2e-4 / (2 * M * W_X), rel=1e-5)
    assert output.bias == pytest.approx(4e-10 / (2 * M), rel=1e-3)
    assert output.scale_factor == pytest.approx(1.0, rel=1e-9)


def test_phase_of_the_sense_mode_turns_quadrature_into_bias() -> None:
    device = simple(kxy=2e-4, tcd=0.01)
    output = output_at(device, calibrate(device, AMPLITUDE, closed=False), 308.15)
    # Damping rises by 10 %: the phase tan δ = w_d dyy/(kyy - m w_d²) from 0.0828 to 0.0911.
    stiffness = M * (W_Y**2 - W_X**2)
    before, after = (np.arctan(W_X * d * M * W_Y / Q_Y / stiffness) for d in (1.0, 1.1))
    shrunk = np.cos(after) / np.cos(before)
    assert output.bias == pytest.approx(-2e-4 / (2 * M * W_X) * shrunk * np.sin(after - before), rel=1e-4)


def test_gain_and_lag_common_to_both_pickoffs_drop_out_of_the_open_loop_only() -> None:
    device = simple(kxy=2e-4, tcg=1e-3, amplifier_time_constant=1e-6, tcp=1e-8)
    open_loop = output_at(device, calibrate(device, AMPLITUDE, closed=False), 308.15)
    closed = output_at(device, calibrate(device, AMPLITUDE, closed=True), 308.15)
    late = np.arctan(W_X * 1.1e-6) - np.arctan(W_X * 1e-6)
    # The lag pulls the drive by w/(2Q) tan(late) = 1.6 mHz of a split of 50 Hz: 3e-5 of the scale factor.
    assert open_loop.scale_factor == pytest.approx(1.0, abs=5e-5)
    assert open_loop.bias == pytest.approx(0.0, abs=1e-4 * open_loop.quadrature)
    # A swing smaller by 1 % of gain, and larger by what the lag takes, needs a smaller force; a late reference turns
    # quadrature into bias. The pull of the drive frequency is 3e-7 of it.
    swing = sqrt((1 + (W_X * 1.1e-6) ** 2) / (1 + (W_X * 1e-6) ** 2)) / 1.01
    assert closed.scale_factor == pytest.approx(np.cos(late) * swing, rel=1e-6)
    assert closed.bias == pytest.approx(2e-4 / (2 * M * W_X) * np.sin(late) * swing, rel=1e-5)


def test_duffing_pulls_the_drive_frequency() -> None:
    k3 = 1e-4 * M * W_X**2 / AMPLITUDE**2
    known = calibrate(simple(k3_x=k3), AMPLITUDE, closed=True)
    # w² = w_x² + 3/4 k3 A²/m; the third harmonic A ε/32, ε = k3 A²/k, adds 3/128 ε² = 2e-10 to w².
    assert 2 * pi * known.frequency == pytest.approx(W_X * sqrt(1 + 0.75e-4 + 3e-8 / 128), rel=1e-12)


def test_a_parasitic_mode_pulls_the_drive_frequency_however_far() -> None:
    coupling = 0.3 * M * W_X**2
    device = simple(parasitic_coupling=coupling, parasitic_frequency=8000.0, parasitic_q=1e9)
    known = calibrate(device, AMPLITUDE, closed=True)
    # The lower root of (W_X² - w²)(W_P² - w²) = (κ/m)²; the damping of x moves it by 1/Q² of what it pulls.
    w_p = 2 * pi * 8000
    middle, half = (W_X**2 + w_p**2) / 2, (w_p**2 - W_X**2) / 2
    lower = middle - sqrt(half**2 + (coupling / M) ** 2)
    assert 2 * pi * known.frequency == pytest.approx(sqrt(lower), rel=1e-9)


def test_loops_make_the_force_a_quarter_period_ahead() -> None:
    device = load_device("rate-mode")
    known = calibrate(device, AMPLITUDE, closed=False)
    p = parameters_at(device, 320.0)
    settled = settle(device, known.drive, 320.0, 1.0)
    # Settled: x and y of a plain 2 x 2 system of linear equations, without the parasitic mode's elimination.
    w = 2 * pi * settled.frequency
    w_p = 2 * pi * p["parasitic_frequency"]
    cross, turn = p["kxy"] + 1j * w * p["dxy"], 2j * p["m"] * w
    matrix = np.array(
        [
            [p["kxx"] - p["m"] * w**2 + 1j * w * p["dxx"], cross - turn, p["parasitic_coupling"]],
            [cross + turn, p["kyy"] - p["m"] * w**2 + 1j * w * p["dyy"], 0],
            [p["parasitic_coupling"] / p["m"], 0, w_p**2 - w**2 + 1j * w * w_p / p["parasitic_q"]],
        ]
    )
    force = 1j * settled.force * np.array([1, p["actuator_misalignment"], 0])
    x, y, _ = np.linalg.solve(matrix, force)
    lag = known.drive.correction / (1 + 1j * w * p["amplifier_time_constant"])
    # Rounding of a resonance of Q = 5000: 1e-16 · 5000 · the condition of the frequency.
    assert p["sense_gain_x"] * x * lag == pytest.approx(known.drive.voltage, rel=1e-7)
    assert p["sense_gain_y"] * y * lag == pytest.approx(settled.sense, rel=1e-7)


def drift(closed: bool, celsius: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Settled bias [°/h] and scale factor of the packaged device at temperatures [°C]."""
    device = load_device("rate-mode")
    known = calibrate(device, settings_of(device).drive_amplitude, closed)
    settled = [output_at(device, known, float(t) + ZERO_CELSIUS) for t in celsius]
    return np.rad2deg([s.bias for s in settled]) * 3600, np.array([s.scale_factor for s in settled])


def test_packaged_device_drifts_as_source_003_measured() -> None:
    bias, scale = drift(False, RANGE)
    # Printed with five digits; the parameters of the device file are solved to six.
    assert np.ptp(scale) / 80 == pytest.approx(316.66e-6, rel=1e-4)
    assert np.ptp(bias) / 80 == pytest.approx(366.22, rel=1e-4)


def test_device_file_holds_what_the_solver_finds() -> None:
    device = load_device("rate-mode")
    coarse = {"actuator_misalignment": -0.025, "tck_split": -8.5e-6, "dxy": -4e-9}
    for name, value in solve(device.with_parameters(coarse)).items():
        # Written with six digits.
        assert device.parameters[name] == pytest.approx(value, rel=2e-6)


@pytest.mark.parametrize("celsius", [RANGE, np.linspace(-20, 60, 81)])
def test_at_least_a_third_of_the_bias_is_not_linear(celsius: np.ndarray) -> None:
    bias, _ = drift(False, celsius)
    straight = np.polyval(np.polyfit(celsius, bias, 1), celsius)
    # What is left after the least-squares line, over the whole span.
    assert np.ptp(bias - straight) / np.ptp(bias) > 0.33


def test_packaged_device_is_of_its_class() -> None:
    p = load_device("rate-mode").all_parameters
    w = sqrt(p["kxx"] / p["m"])
    assert 3e3 < w / 2 / pi < 1e4
    assert 100 < np.rad2deg(p["kxy"] / (2 * p["m"] * w)) < 500
    assert 40 < (sqrt(p["kyy"] / p["m"]) - w) / 2 / pi < 60
    assert abs(p["dxy"]) < 0.01 * p["dyy"]


def test_only_what_moves_with_time_is_left_out() -> None:
    model = load_model()
    reasons = {effect.id: why for effect in model.effects if (why := unsettled(effect)) and not effect.noise}
    moving = dict.fromkeys(("ageing", "amplifier_drift", "damping_step", "dielectric_charging", "stress_relaxation"))
    assert reasons == {
        **dict.fromkeys(moving, "changes with time"),
        "thermal_hysteresis": "depends on how the temperature came to where it is",
    }
    assert {e.id for e in model.effects if unsettled(e) == "draws random numbers"} == {
        e.id for e in model.effects if e.noise
    }


def test_what_is_left_out_is_named_where_it_acts() -> None:
    assert left_out(simple(parasitic_ratio=1e-2, offset_x=1e-3, play=1e-9, sense_noise=1e-5)) == {}
    assert left_out(simple(ageing=1e-4)) == {"ageing": "changes with time"}


def test_a_law_of_ones_own_is_known_where_it_settles() -> None:
    rise = size("rise", "1/K", "rise of the drive stiffness")

    def law(target: Symbol, expr: Expr) -> Law:
        return replace(THERMAL_STIFFNESS, id="own", parameters=(rise,), changes={target: expr})

    assert unsettled(law(kxx, kxx * (1 + rise.symbol * temperature_structure))) is None
    assert unsettled(law(v_bias, v_bias * (1 + rise.symbol))) is None
    assert unsettled(law(kxx, kxx * (1 + rise.symbol * t))) == "changes with time"


@pytest.mark.parametrize("share", [1e-9, 1e-3, 0.4, 0.9])
def test_a_gap_closing_pickoff_shows_the_first_harmonic(share: float) -> None:
    gap = AMPLITUDE / share
    known = calibrate(simple(pickoff_inverse_gap=1 / gap), AMPLITUDE, closed=True)
    phase = 2 * pi * np.arange(4096) / 4096
    q = AMPLITUDE * np.cos(phase)
    by_sum = 2 * float(np.mean(np.cos(phase) * q / (1 - (q / gap) ** 2)))
    assert known.drive.voltage == pytest.approx(GAIN * by_sum, rel=1e-9)
    assert known.amplitude == pytest.approx(AMPLITUDE, rel=1e-12)


def test_a_swing_up_to_the_plates_is_refused() -> None:
    with pytest.raises(InputError, match=r"swings up to the plates at drive_amplitude 4e-06 m.*pickoff_inverse_gap"):
        calibrate(simple(pickoff_inverse_gap=1 / 3e-6), AMPLITUDE, closed=False)


def test_a_sense_mass_at_its_plates_is_refused() -> None:
    # A force of 1e-4 N on 20 N/m holds y 5 µm away.
    with pytest.raises(InputError, match=r"swings up to the plates.*kxy"):
        calibrate(simple(pickoff_inverse_gap=1 / 4.1e-6, force_y=1e-4), AMPLITUDE, closed=False)
