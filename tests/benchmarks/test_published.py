"""Devices made from published data: files give what they were derived from; the benchmark compares as it claims."""

from math import degrees

import numpy as np
import pytest

from benchmarks.published import CLAIMS, DISK, DUAL, LARGE, PREDICTED, QUAD, STATES, Claim, left_of, line_of
from cosim.rate.allan import NoiseLimits, noise_limits
from cosim.rate.bench import Bench
from cosim.rate.metrics import PER_ROOT_HOUR
from gyro_model.device import load_device


def bench_of(name: str) -> Bench:
    state = STATES[name]
    return Bench(load_device(state.device).with_parameters(state.changes), closed=state.mode == "rate-closed")


def limits(name: str) -> NoiseLimits:
    """Angle random walks [°/√h]."""
    bench = bench_of(name)
    found = noise_limits(bench.typical.nominal, bench.reference_temperature, 1 / bench.sample_rate)
    return NoiseLimits(*(PER_ROOT_HOUR * part for part in found))


# Files and articles give three or four digits.
DIGITS = 2e-3


def test_derived_values_give_the_figures_that_they_were_derived_from() -> None:
    assert limits(DISK).total == pytest.approx(0.39, rel=DIGITS)
    assert limits(DISK).thermal == pytest.approx(0.074, rel=DIGITS)
    assert limits(LARGE).total == pytest.approx(0.037, rel=DIGITS)
    assert limits(f"{LARGE}, split of 4 Hz").total == pytest.approx(0.042, rel=DIGITS)
    assert limits(QUAD).total == pytest.approx(0.02, rel=DIGITS)
    scale = abs(bench_of(DISK).typical.nominal.calibration.scale) / degrees(1)
    assert scale == pytest.approx(800e-6, rel=DIGITS)


def test_modes_are_those_that_were_published() -> None:
    for name, frequency, split, q in ((DISK, 4.3e6, 0, 62e3), (LARGE, 976e3, 0.4, 1e6), (QUAD, 2e3, 0, 1e3)):
        device = load_device(name)
        low, high = device.frequencies
        assert low == pytest.approx(frequency, rel=1e-6)
        # Ten digits of the stiffness are 5e-10 of a frequency.
        assert high - low == pytest.approx(split, abs=1e-9 * frequency)
        assert device.quality_factors == pytest.approx((q, q), rel=1e-4)
    assert load_device(DUAL).frequencies == pytest.approx((3925.29, 3978.45), rel=1e-8)
    assert load_device(DUAL).quality_factors == pytest.approx((4673, 449), rel=1e-4)


def test_the_converter_is_fast_enough_for_the_drive() -> None:
    # Noise in the files is a sample at these rates.
    assert bench_of(DISK).sample_rate == 34.4e6
    assert bench_of(LARGE).sample_rate == 8e6
    assert bench_of(DUAL).sample_rate == 200e3
    assert not bench_of(DISK).can_run_full
    assert bench_of(DUAL).can_run_full


def test_claims_are_of_states_that_are_measured() -> None:
    assert {claim.state for claim in CLAIMS} <= set(STATES)
    assert {name for name, _ in PREDICTED} <= set(STATES)
    # Each device has a figure that did not make its file.
    for device in (DISK, LARGE, QUAD, DUAL):
        assert any(claim.state == device and not claim.used for claim in CLAIMS)


def test_a_line_says_by_how_much_a_figure_is_off() -> None:
    equal = Claim(DISK, "a", "1", 2.0, False, lambda sheets: 0.0)
    assert line_of(equal, 2.5).values["off"] == pytest.approx(0.25)
    assert line_of(equal, 2.5).met == "yes"
    assert line_of(equal, 1.0).met == "no"
    bound = equal._replace(how="at most")
    assert line_of(bound, 0.1).values["off"] == 0.0
    assert line_of(bound, 3.0).met == "no"
    # What made the file is no check.
    assert line_of(equal._replace(used=True), 9.0).met == ""


def test_a_law_that_is_linear_in_the_damping_is_taken_out_by_a_line() -> None:
    celsius = np.linspace(-40, 85, 7)
    damping = 1 + 5.534e-3 * (celsius - 25)
    assert left_of(celsius, 1 / damping, 1) == pytest.approx(0.0, abs=1e-12)
    # What the printed power law leaves, as the note of the claim says.
    celsius = np.linspace(-40, 85, 51)
    power = ((celsius + 273.15) / 298.15) ** -1.65
    assert left_of(celsius, power, 1) == pytest.approx(1.60, abs=0.005)
    assert left_of(celsius, power, 2) == pytest.approx(0.025, abs=0.0005)
