"""The pattern is read at samples that lie between two changes of the force."""

from pathlib import Path

import numpy as np

from cosim.master import simulate
from gyrotwin.tasks.run import Request, prepare

SPIN = """
format = 1
name = "fast"
description = "a constant rate"
duration = 0.7
angle_unit = "C"

[omega_z]
kind = "constant"
value = 9.0
"""


def test_held_forces_do_not_bend_the_reading_of_the_angle(tmp_path: Path, residual):
    """Stiffnesses 9 % apart, 22 samples a period, commands late by 0.3 of one: the force that makes them alike, held,
    bends the motion between its changes. Read there as it is, the angle errs by 0.011 deg with twice itself."""
    scenario = tmp_path / "fast.toml"
    scenario.write_text(SPIN, encoding="utf-8")
    trace = simulate(prepare(Request(str(scenario), "tuning_fork_as_built", "lab", seed=1))).trace
    late = trace["t"].to_numpy() > 0.25
    angle = trace["angle_true"].to_numpy()[late]
    error = np.rad2deg(trace["angle_C"].to_numpy()[late] - angle)
    since = trace["t"].to_numpy()[late] - 0.25
    shapes = np.stack((np.ones_like(since), since, np.cos(2 * angle), np.sin(2 * angle)), axis=1)
    found, *_ = np.linalg.lstsq(shapes, error)
    # Half of what it was; from 0.25 to 0.9 s seeds 1 and 2 leave 0.0014 and 0.0024 deg.
    residual("harmonic of the angle [deg]", float(np.hypot(*found[2:])), 0.005)
