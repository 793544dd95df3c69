"""The record of the sense voltage: the same from both plants, and the split in it where the device has it."""

import numpy as np
import pytest

from calibration.mode_split import Question, VoltageRecord, find_split
from cosim.rate.courses import constant, constant_temperature
from cosim.rate.master import Result, simulate
from cosim.rate.run import RateRun
from gyro_model.device import load_device
from gyro_model.errors import InputError

DEVICE = load_device("rate-mode")
QUIET = DEVICE.with_parameters({"sense_noise": 0.0, "thermal_force": 0.0})
TURN = np.deg2rad(50.0)


def run_of(device=DEVICE, duration: float = 6.0, **rest) -> RateRun:
    course = constant(rest.pop("rate", 0.0), "steady")
    return RateRun(device, course, constant_temperature(25), False, duration, **rest)


def last(result: Result) -> complex:
    assert result.sense is not None
    return complex(result.sense["v_y_i"][-1], result.sense["v_y_q"][-1])


def test_both_plants_record_the_same_voltage(residual) -> None:
    # The phase of the sense channel holds Coriolis force and quadrature a quarter period apart.
    full, slow = (
        last(simulate(run_of(QUIET, 1.0, rate=TURN, envelope=envelope, sense_rate=1000.0)))
        for envelope in (False, True)
    )
    # Start-up and the step of the rate are left by e^-12 = 6e-6.
    residual("relative", abs(full / slow - 1), 1e-5)
    known = run_of(QUIET, 1.0).nominal
    volts = abs(known.calibration.scale) * np.hypot(np.deg2rad(300.02), TURN + np.deg2rad(2.0))
    # 300 °/s of quadrature and 50 °/s of rate with 2 °/s of bias, both through the sense mode; 2 °/s to 1e-2.
    residual("volts", abs(abs(slow) / volts - 1), 1e-3)


def test_split_is_found_in_a_record_of_the_full_plant() -> None:
    result = simulate(run_of(duration=5.0, sense_rate=1000.0, sample_rate=5e4, seed=2))
    assert result.sense is not None
    sense = result.sense
    voltage = sense["v_y_i"].to_numpy() + 1j * sense["v_y_q"].to_numpy()
    carrier = float(sense["carrier_frequency"].to_numpy().mean())
    split = find_split(VoltageRecord(voltage, 1000.0, carrier), Question(q=600.0)).split
    # Eigenvalues of the device (benchmarks/rate_mode.py, beat of the open loop): 50.698 Hz above the drive.
    assert abs(split.split - 50.698) < 4 * split.deviation
    # σ = √(26.4/5)/2π = 0.37 Hz with a quarter for floor, line and taper.
    assert split.deviation < 0.46


def test_time_is_that_of_the_samples() -> None:
    result = simulate(run_of(QUIET, 1.0, envelope=True, sense_rate=500.0))
    assert result.sense is not None
    t = result.sense["t"].to_numpy()
    np.testing.assert_allclose(np.diff(t), 2e-3, rtol=1e-9)
    # Half a filter of 79 steps at either end.
    assert t[0] == pytest.approx(1.0 - t[-1], abs=3e-3)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"sense_rate": 100.0}, r"--sense-record 100: give 17[0-9.]+ to 1000 Hz"),
        ({"sense_rate": 2000.0}, r"to 1000 Hz"),
        ({"sense_rate": -1.0}, r"--sense-record -1: give"),
        ({"sense_rate": float("nan")}, r"--sense-record nan: give"),
        ({"sense_rate": 300.0}, r"whole part of the loop's 1000 Hz, such as 333"),
    ],
)
def test_records_that_could_not_show_the_split_are_refused(change, message) -> None:
    with pytest.raises(InputError, match=message):
        run_of(envelope=True, **{"duration": 6.0, **change})


def test_a_closed_loop_is_refused() -> None:
    rest = constant(0.0, "at rest"), constant_temperature(25)
    with pytest.raises(InputError, match="give --sense open"):
        RateRun(DEVICE, *rest, True, 6.0, envelope=True, sense_rate=500.0)
