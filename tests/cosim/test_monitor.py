"""The flag tells the truth: never valid on a device that the loop does not know, and taken back when the device
changes."""

import numpy as np
import pytest
from runs import drift, simulated

UNKNOWN = {
    "delay": "actuator_delay=2e-8",
    "converter": f"adc_lsb={4 / 4096}",
    "feedthrough": "feedthrough=8",
    "long delay": "actuator_delay=2e-7",
}
"""What the device has and the design plain does not name: 20 ns; 12 bit over 4 V; 8 V/N."""


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("name", UNKNOWN)
def test_no_flag_while_the_angle_drifts(name: str, seed: int) -> None:
    _, result = simulated("constant", UNKNOWN[name], duration=0.3, seed=seed)
    assert result.validity.now == (not result.validity.reason)
    turned = drift(result, 0.2)
    sigma = np.rad2deg(result.trace["drift_sigma"][-1])
    # Valid for 10 ms of the last tenth of a second, and drifting by more than 0.5 deg/s and four times its own sigma:
    # a lie.
    assert np.isnan(turned) or abs(turned) <= max(0.5, 4 * sigma)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_step_of_the_damping_withdraws_the_flag_within_20_ms(seed: int) -> None:
    _, result = simulated("varying", duration=0.5, seed=seed)
    assert result.converged_at is not None and result.converged_at < 0.4
    # All damping doubles at 0.45 s and turns the pattern until it is found.
    [t] = [t for t, _ in result.validity.withdrawn if 0.45 <= t < 0.47]
    assert all(reason for _, reason in result.validity.withdrawn)
    valid = result.trace["converged"].to_numpy()
    times = result.trace["t"].to_numpy()
    # The verdict holds from the end of the block of 5 ms in which it is given.
    assert not valid[(times > t + 1e-9) & (times < t + 5e-3)].any()


@pytest.mark.parametrize("seed", [4, 5])
def test_the_flag_is_set_where_all_is_known(seed: int) -> None:
    _, result = simulated("constant", duration=0.3, seed=seed)
    assert result.validity.now and not result.validity.withdrawn
    # Four standard deviations of what the loop itself predicts: one run in 16,000.
    assert abs(drift(result, 0.2)) < 4 * np.rad2deg(result.trace["drift_sigma"][-1])


def test_limits_are_settings() -> None:
    _, strict = simulated("constant", "monitor.drift_limit=1e-9", duration=0.1)
    assert strict.converged_at is None
    assert "may drift" in strict.validity.reason
