"""As built and as designed in rate mode: what the loops get follows from the design alone."""

from dataclasses import replace
from math import isclose

import pytest

from cosim.rate.courses import constant, constant_temperature
from cosim.rate.master import simulate
from cosim.rate.metrics import summarise
from cosim.rate.run import RateRun
from cosim.rate.settings import design_for
from cosim.rate.steady_state import output_at
from gyro_model.device import load_device
from gyro_model.errors import InputError

DEVICE = load_device("rate-mode")
NOMINAL = {name: DEVICE.parameters[name] for name in ("m", "kxx", "kyy", "dxx", "dyy")}
GIVEN = replace(DEVICE, name="nominal", parameters=NOMINAL, rate_mode={})


def run_of(device, duration=1.0, closed=False) -> RateRun:
    rest = constant(0.0, "at rest"), constant_temperature(25.0)
    return RateRun(device, *rest, closed, duration, envelope=True, design=design_for(GIVEN, device))


@pytest.mark.parametrize("closed", [False, True])
def test_no_value_of_the_plant_beyond_gains_and_noise_reaches_the_loops(closed: bool) -> None:
    before = run_of(DEVICE, closed=closed)
    stated = {"sense_gain_x", "sense_gain_y", "sense_noise", "thermal_force", "x_start"}
    for name, value in DEVICE.parameters.items():
        if name not in stated:
            after = run_of(DEVICE.with_parameters({name: value * 1.01}), closed=closed)
            assert after.blocks() == before.blocks(), name
            assert after.nominal == before.nominal, name


def test_gains_and_noise_are_those_stated_and_effects_neutral() -> None:
    known = design_for(GIVEN, DEVICE).all_parameters
    assert known["sense_noise"] == DEVICE.parameters["sense_noise"]
    assert known["sense_gain_x"] == DEVICE.parameters["sense_gain_x"]
    for name in ("actuator_misalignment", "parasitic_coupling", "tck", "kxy", "dxy", "amplifier_time_constant"):
        assert known[name] == 0.0


def test_what_the_design_does_not_know_shows_in_the_output() -> None:
    designed = run_of(DEVICE, 10.0)
    summary = summarise(designed, simulate(designed))
    told = RateRun(DEVICE, *(designed.rate, designed.temperature), False, 1.0, envelope=True)
    as_designed = output_at(DEVICE, designed.nominal.calibration, 298.15)
    as_known = output_at(DEVICE, told.nominal.calibration, 298.15)
    # The package mode pulls the drive frequency by 0.3 Hz of a split of 50 Hz: 0.6 % of the scale factor.
    assert as_known.scale_factor == pytest.approx(1.0, abs=1e-9)
    assert as_designed.scale_factor == pytest.approx(0.994, abs=0.001)
    # White noise over 10 s, five standard errors, beside what the loops leave of their start.
    error = max(5 * summary["bias_error_deg_s"], 2e-3)
    assert summary["bias_deg_s"] == pytest.approx(summary["harmonic_balance"]["bias_deg_s"], abs=error)
    assert summary["design"] == "nominal"


def test_a_design_equal_to_the_device_changes_nothing() -> None:
    same = RateRun(DEVICE, constant(0.0, "at rest"), constant_temperature(25.0), False, 1.0, envelope=True,
                   design=design_for(DEVICE, DEVICE))  # fmt: skip
    bare = RateRun(DEVICE, constant(0.0, "at rest"), constant_temperature(25.0), False, 1.0, envelope=True)
    assert same.blocks() == bare.blocks()
    assert isclose(same.settling, bare.settling)


def test_a_design_without_frequencies_is_refused() -> None:
    given = replace(DEVICE, name="bare", parameters={"m": 2e-8})
    with pytest.raises(InputError, match="says nothing of kxx, kyy, dxx, dyy"):
        design_for(given, DEVICE)
