"""Where the reference simulation does not come to the end, it says what failed."""

import numpy as np
import pytest

from gyro_model.device import Device
from gyro_model.errors import InputError
from gyro_model.reference import _solved, simulate


def test_a_state_that_runs_away_in_finite_time_is_named() -> None:
    # s' = s² from 1 is 1/(1 - t).
    with pytest.raises(InputError, match=r"from 0 s to 2 s: DOP853 stopped at 1 s with z = .*which changes fastest"):
        _solved(lambda t, s: [-s[0], s[1] ** 2], 0.0, 2.0, np.array([1.0, 1.0]), 1e-20, ("x", "z"))


def test_what_ends_is_handed_back() -> None:
    end = _solved(lambda t, s: [-s[0]], 0.0, 1.0, np.array([1.0]), 1e-20, ("x",))
    assert end == pytest.approx([np.exp(-1.0)], rel=1e-11)


def test_a_device_that_is_pulled_in_says_so() -> None:
    t = np.arange(200) * 5e-6
    still = {"u_x": np.zeros(200), "v_bias": np.full(200, 300.0)}
    device = Device("pulled in", {"softening": 2e-3, "electrode_gap": 3e-6, "x_start": 1e-6})
    with pytest.raises(InputError, match=r"^reference .*(stopped|diverged) at"):
        simulate(device, t, still)
