"""A lag that follows the temperature of the circuit, and one that ends: no lag from some temperature on."""

from pathlib import Path

import numpy as np
import pytest
from runs import simulated

from cosim.design import packaged_designs
from cosim.metrics import Bounds
from cosim.recorder import Result

SCENARIO = """format = 1
name = "warm"
description = "10 K up and down, twice a second"
duration = 0.6
angle_unit = "C"

[omega_z]
kind = "square"
amplitude = 10.0
frequency = 10.0

[[temperature]]
kind = "constant"
value = 298.15

[[temperature]]
kind = "sine"
amplitude = 10.0
frequency = 2.0
"""


def warmed(tmp_path: Path, lag: float, by_kelvin: float, seed: int) -> Result:
    """The run of a device with that lag [s], which changes by ``by_kelvin`` [s/K], both unknown to the loop."""
    design, scenario = tmp_path / "design.toml", tmp_path / "warm.toml"
    text = packaged_designs()["lab"].read_text(encoding="utf-8")
    design.write_text(text.replace("[intervals]\n", "[intervals]\ntcp = [-1e-8, 1e-8]\n", 1), encoding="utf-8")
    scenario.write_text(SCENARIO, encoding="utf-8")
    values = (f"amplifier_time_constant={lag}", f"tcp={by_kelvin}")
    _, result = simulated(str(scenario), *values, design=str(design), seed=seed)
    return result


def error_of(result: Result) -> float:
    """Of angle C where it is valid, rms [deg]."""
    kept = result.trace.filter(result.trace["converged"])
    error = (kept["angle_C"] - kept["angle_true"]).to_numpy()
    return float(np.rad2deg(np.sqrt(np.mean(error**2))))


def over_bound(bounds: Bounds | None, result: Result, name: str, value: float) -> float:
    """Error of a constant at the end over its bound."""
    assert bounds is not None
    return abs(float(result.trace[f"est_{name}"][-1]) - value) / float(bounds.effects[name][-1])


@pytest.mark.parametrize(("lag", "by_kelvin", "seed"), [(25.4e-9, 1.73e-9, 8), (86.2e-9, -3.04e-9, 1)])
def test_a_lag_that_may_end_and_does_not_leaves_the_angle_alone(tmp_path, residual, lag, by_kelvin, seed) -> None:
    # Voltages do not tell such a lag from a delay: by the estimates it may end. With slopes of one side taken for those
    # of the other the angle was lost, or never valid.
    result = warmed(tmp_path, lag, by_kelvin, seed)
    assert result.converged_at is not None and result.converged_at < 0.2
    # What the loop is to have in the median of any device; these have 0.01 to 0.03.
    residual("error of the angle [deg]", error_of(result), 0.1)


@pytest.mark.parametrize(("lag", "by_kelvin", "seed"), [(52.5e-9, 8.47e-9, 10), (24.3e-9, 6.944e-9, 1862)])
def test_a_lag_that_ends_is_found_by_where_it_does(tmp_path, residual, lag, by_kelvin, seed) -> None:
    result = warmed(tmp_path, lag, by_kelvin, seed)
    residual("error of the angle [deg]", error_of(result), 0.1)
    # Three deviations; it was up to 46 off.
    residual("of the lag over its bound", over_bound(result.bounds, result, "amplifier_time_constant", lag), 3.0)
    residual("of its slope over its bound", over_bound(result.bounds, result, "tcp", by_kelvin), 3.0)
