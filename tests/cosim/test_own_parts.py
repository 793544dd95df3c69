"""An observer and a controller of one's own, compiled with numba, run through the bridge."""

import os
import subprocess
import sys
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


CACHED = """
from gain import GAIN
from numba import njit

from cosim.observers.record import INIT_SIGNATURE, STEP_SIGNATURE, Observer


@njit(INIT_SIGNATURE, cache=True)
def init(memory, settings, start, start_deviation, sensor, period):
    memory[0] = GAIN


@njit(STEP_SIGNATURE, cache=True)
def step(memory, settings, u_x, u_y, v_x, v_y, estimate, deviation):
    estimate[0] = memory[0] * v_x


OBSERVER = Observer("cached", 1, {}, init, step)
"""
LOADED = """
import sys
import numpy as np
from cosim.registry import find_observer
sys.path.insert(0, "beside")
found = find_observer("beside/mine.py")
memory = np.zeros(1)
found.init(memory, *[np.zeros(32)] * 4, 0.0)
print(sum(found.init.stats.cache_hits.values()), sum(found.step.stats.cache_hits.values()), memory[0])
"""


def test_what_a_file_caches_is_found_again_until_a_file_beside_it_changes(tmp_path: Path) -> None:
    (tmp_path / "beside").mkdir()
    (tmp_path / "beside" / "mine.py").write_text(CACHED)
    said = []
    for gain in (2.0, 2.0, 3.0):
        (tmp_path / "beside" / "gain.py").write_text(f"GAIN = {gain}\n")
        environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "cache"), "PYTHONDONTWRITEBYTECODE": "1"}
        environment["PYTHONPATH"] = str(Path(__file__).parents[2])
        done = subprocess.run(
            [sys.executable, "-c", LOADED], cwd=tmp_path, env=environment, check=True, capture_output=True, text=True
        )
        said.append(done.stdout.split())
    assert said == [["0", "0", "2.0"], ["1", "1", "2.0"], ["0", "0", "3.0"]]
