"""The temperature sensors: the bridge of Liu et al. 2014 by hand, noise and rounding."""

import numpy as np
import pytest

from cosim.rate.courses import ZERO_CELSIUS
from cosim.rate.temperature_sensor import BoardSensor, Bridge


def test_bridge_by_hand() -> None:
    # R_T = 500 (1 + 2.183e-3 · 60) = 565.49 Ω: 16 · 5 V · (565.49/5565.49 - 525/5525).
    volts = Bridge().voltage(np.array([60 + ZERO_CELSIUS]))
    assert volts[0] == pytest.approx(80 * (565.49 / 5565.49 - 525 / 5525), rel=1e-12)
    # Balanced where R_T = 525 Ω: at 0.05/2.183e-3 °C.
    assert Bridge().voltage(np.array([ZERO_CELSIUS + 0.05 / 2.183e-3]))[0] == pytest.approx(0.0, abs=1e-14)


def test_reading_is_the_temperature_within_noise_and_rounding() -> None:
    true = np.linspace(233.15, 358.15, 20_000)
    bridge = Bridge()
    np.testing.assert_allclose(bridge.temperature(bridge.voltage(true)), true, atol=1e-9)
    error = bridge.read(true, np.random.default_rng(1)) - true
    slope = np.gradient(bridge.voltage(true), true)
    expected = np.sqrt(np.mean((bridge.noise**2 + bridge.lsb**2 / 12) / slope**2))
    # 20,000 readings: 0.5 % of statistical error.
    assert error.std() == pytest.approx(expected, rel=0.02)
    assert abs(bridge.voltage(true)).max() < 2.5


def test_board_sensor_rounds_to_a_sixteenth() -> None:
    true = np.full(20_000, 298.17)
    read = BoardSensor().read(true, np.random.default_rng(1))
    np.testing.assert_allclose((read - ZERO_CELSIUS) * 16 % 1, 0.0, atol=1e-9)
    assert read.mean() == pytest.approx(298.17, abs=0.02)
