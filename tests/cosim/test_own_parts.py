"""An observer and a controller of one's own, compiled with numba, run through the bridge."""

from pathlib import Path

import numpy as np
from runs import simulated

OWN = """
import numpy as np
from numba import njit
from cosim.{folder}.record import INIT_SIGNATURE, STEP_SIGNATURE, {kind}

@njit(INIT_SIGNATURE)
def init({init}):
    memory[0] = 1.0

@njit(STEP_SIGNATURE)
def step({step}):
    memory[0] += 1.0
{body}

{name} = {kind}("mine", 1, {{"factor": 2.0}}, init, step)
"""

OBSERVER = OWN.format(
    folder="observers",
    kind="Observer",
    name="OBSERVER",
    init="memory, settings, start, start_deviation, sensor, period",
    step="memory, settings, u_x, u_y, v_x, v_y, estimate, deviation",
    body="    estimate[5:12] = np.array([64.0, 96.0, 12.8, 1.8e-6, 1.8e-6, 3.6e-7, 1.8e-7])\n"
    "    estimate[0] = v_x / 1e6\n    estimate[4] = settings[0] * memory[0]\n    deviation[4] = u_x\n",
)
CONTROLLER = OWN.format(
    folder="controllers",
    kind="Controller",
    name="CONTROLLER",
    init="memory, settings, period",
    step="memory, settings, t, estimate, deviation, output",
    body="    output[0] = 1e-6 * settings[0]\n    output[1] = t * 1e-6\n    output[8] = 3.5e8\n",
)


def test_own_parts_by_file_with_settings(tmp_path: Path) -> None:
    (tmp_path / "seer.py").write_text(OBSERVER)
    (tmp_path / "pusher.py").write_text(CONTROLLER)
    run, result = simulated(
        *("constant", "observer.factor=3"),
        observer=str(tmp_path / "seer.py"),
        controller=str(tmp_path / "pusher.py"),
        duration=0.02,
        trace_rate=200e3,
    )
    trace = result.trace
    assert (run.observer.name, run.controller.name) == ("mine", "mine")
    # The memory begins at 1 and counts from the first step on; the setting is the one that was asked for.
    np.testing.assert_array_equal(trace["est_omega_z"], 3.0 * np.arange(2.0, len(trace) + 2))
    np.testing.assert_array_equal(trace["u_x"], 2e-6)
    # t_k = k period, rounded once, times 1e-6.
    np.testing.assert_allclose(trace["u_y"], trace["t"].to_numpy() * 1e-6, rtol=1e-15)
    # The sample in metres: a division and, on its way through what is known of the pickoff, a Newton step.
    np.testing.assert_allclose(trace["est_x"], trace["v_x"].to_numpy() / 1e6, rtol=1e-12)
    assert not result.validity.now
