"""The settled rate mode against hand formulas, and the packaged device against Liu et al. 2014."""

from dataclasses import replace
from math import pi, sqrt

import numpy as np
import pytest
from sympy import Expr, Symbol

from benchmarks.rate_device import solve
from cosim.rate.courses import ZERO_CELSIUS
from cosim.rate.settings import settings_of
from cosim.rate.steady_state import (
    RATE_STEP,
    calibrate,
    covers,
    output_at,
    parameters_at,
    settle,
    shown_swing,
    swing_shown_as,
)
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
    # The rate of 1e-3 rad/s at which the slope is taken pulls the drive frequency by (Ω/Δω)² of 50 Hz at most, 1e-11.
    assert scale == pytest.approx(by_hand, rel=1e-8)


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
    # w² = w_x² + 3/4 k3 A²/m.
    assert 2 * pi * known.frequency == pytest.approx(W_X * sqrt(1 + 0.75e-4), rel=1e-12)


def test_no_drive_frequency_is_said() -> None:
    # A parasitic mode so strong that it moves the x mode by more than the search reaches.
    device = simple(parasitic_coupling=0.3 * M * W_X**2, parasitic_frequency=8000.0)
    with pytest.raises(InputError, match="no drive frequency within 2 %"):
        calibrate(device, AMPLITUDE, closed=False)


def test_loops_make_the_force_a_quarter_period_ahead() -> None:
    device = load_device("rate-mode")
    known = calibrate(device, AMPLITUDE, closed=False)
    p = parameters_at(device, 320.0)
    settled = settle(p, known.drive, 1.0)
    # Settled: x and y of a plain 2 x 2 system of linear equations, without the parasitic mode's elimination.
    w = 2 * pi * settled.frequency
    w_p = 2 * pi * p["parasitic_frequency"]
    cross, turn = p["kxy"] + 1j * w * p["dxy"], 2j * p["m"] * w * RATE_STEP * 1e3
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


def test_the_balance_knows_the_effects_that_its_equations_read() -> None:
    known = {effect.id for effect in load_model().effects if covers(effect) and not effect.nominal}
    laws = {"thermal_stiffness", "thermal_damping", "thermal_gain", "thermal_phase"}
    chain = {
        "actuator_misalignment",
        "actuator_gain_mismatch",
        "pickoff_gain_mismatch",
        "pickoff_nonlinearity",
        "amplifier_bandwidth",
    }
    assert known == laws | chain | {"cubic_stiffness", "angular_gain", "parasitic_mode"}


def test_a_law_of_ones_own_is_known_where_it_settles() -> None:
    rise = size("rise", "1/K", "rise of the drive stiffness")

    def law(target: Symbol, expr: Expr) -> Law:
        return replace(THERMAL_STIFFNESS, id="own", parameters=(rise,), changes={target: expr})

    assert covers(law(kxx, kxx * (1 + rise.symbol * temperature_structure)))
    assert not covers(law(kxx, kxx * (1 + rise.symbol * t)))  # never settles
    assert not covers(law(v_bias, v_bias * (1 + rise.symbol)))  # no equation reads it


@pytest.mark.parametrize("share", [1e-9, 1e-3, 0.4, 0.99])
def test_a_gap_closing_pickoff_shows_the_first_harmonic(share: float) -> None:
    gap = 1e-5
    phase = 2 * pi * np.arange(4096) / 4096
    q = share * gap * np.cos(phase)
    by_sum = 2 * float(np.mean(np.cos(phase) * q / (1 - (q / gap) ** 2)))
    assert shown_swing(share * gap, 1 / gap) == pytest.approx(by_sum, rel=1e-12)
    assert swing_shown_as(by_sum, 1 / gap) == pytest.approx(share * gap, rel=1e-12)
    assert swing_shown_as(4e-6, 0.0) == shown_swing(4e-6, 0.0) == 4e-6


def test_a_swing_up_to_the_plates_is_refused() -> None:
    with pytest.raises(InputError, match="plates of the pickoff are 3e-06 m away"):
        calibrate(simple(pickoff_inverse_gap=1 / 3e-6), AMPLITUDE, closed=False)


def test_a_sense_mass_at_its_plates_is_refused() -> None:
    # 6e4 °/s of quadrature at a split of 50 Hz swing y by 13 µm, over three gaps.
    with pytest.raises(InputError, match="sense mass swings up to the plates"):
        calibrate(simple(pickoff_inverse_gap=1 / 4.1e-6, kxy=1.3), AMPLITUDE, closed=False)
