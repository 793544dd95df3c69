"""The traces in tests/traces: what each shows, how it is made, and how it is read.

A file says all that is needed to make it again: its first line is JSON with parameters, seed and maker, then come the
columns t, inputs and outputs, in SI and to the last bit. ``pytest --update`` writes them anew.
"""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
from gyro_runner import OUTPUTS, Floats
from philox_oracle import drawn

from gyro_model.device import Device
from gyro_model.reference import simulate

FOLDER = Path(__file__).parents[1] / "traces"
ROWS, PERIOD, SEED = 161, 2e-5, 4


class Trace(NamedTuple):
    """A trace as it is in its file."""

    parameters: dict[str, float]
    t: Floats
    inputs: dict[str, Floats]
    outputs: dict[str, Floats]


# By name of the file: what acts, beside the reference device.
CASES: Mapping[str, dict[str, float]] = {
    "plain": {},
    "cubic_and_nonlinear_damping": {"k3_x": 8e12, "k3_y": -3e12, "d2_x": 8e5, "d2_y": 4e5},
    "damping_step_off_the_grid": {"damping_step_factor": 25.0, "damping_step_time": 1.2343217e-3},
    "parasitic_mode": {"parasitic_coupling": 8.0, "parasitic_frequency": 4100.0, "parasitic_q": 300.0},
    "delay": {"actuator_delay": 47.3e-6},
    "pickoff_chain_and_lag": {
        "pickoff_inverse_gap": 2e5,
        "pickoff_mismatch": 0.02,
        "pickoff_gain_mismatch": 0.03,
        "parasitic_ratio": 0.05,
        "amplifier_time_constant": 3e-6,
        "offset_x": 0.01,
        "offset_y": -0.02,
        "offset_drift": 0.5,
        "sense_noise": 1e-4,
        "adc_limit": 0.9,
    },
    "noise": {"thermal_force": 1e3, "sense_noise": 2e-5},
}


def inputs_of(t: Floats) -> dict[str, Floats]:
    """Two tones and a rate that changes its sign, in few digits."""
    tones = {axis: 2e-6 * np.sin(2 * np.pi * f * t) for axis, f in (("u_x", 2300.0), ("u_y", 3100.0))}
    rounded = {axis: np.round(values, 9) for axis, values in tones.items()}
    return {**rounded, "omega_z": np.where(np.arange(len(t)) // 40 % 2 == 0, 50.0, -50.0)}


def simulated(parameters: dict[str, float], t: Floats, inputs: Mapping[str, Floats]) -> dict[str, Floats]:
    """The outputs by the reference simulation, noise by the oracle."""
    out = simulate(Device("trace", parameters), t, inputs, drawn(int(parameters["seed"]), len(t)))
    return {name: out[name] for name in OUTPUTS}


def make(name: str) -> Trace:
    """The trace of that name, by the reference simulation."""
    t = np.arange(ROWS) * PERIOD
    parameters = {"x_start": 8e-7, "y_start": -3e-7, "sample_period": PERIOD, "seed": SEED, **CASES[name]}
    inputs = inputs_of(t)
    return Trace(parameters, t, inputs, simulated(parameters, t, inputs))


def write(name: str, trace: Trace) -> None:
    """Writes the file of that name."""
    made = "scipy DOP853 at 1e-12 by gyro_model.reference, noise by tests/gyro_model/philox_oracle.py; pytest --update"
    about = {"made": made, "device": "start values of the FMU", "parameters": trace.parameters}
    columns = {"t": trace.t, **trace.inputs, **trace.outputs}
    rows = [",".join(repr(float(value)) for value in row) for row in zip(*columns.values(), strict=True)]
    text = "\n".join([f"# {json.dumps(about)}", ",".join(columns), *rows]) + "\n"
    (FOLDER / f"{name}.csv").write_text(text, encoding="utf-8")


def read(name: str) -> Trace:
    """The trace in the file of that name."""
    first, header, *rows = (FOLDER / f"{name}.csv").read_text(encoding="utf-8").splitlines()
    about = json.loads(first.removeprefix("# "))
    table = np.array([[float(value) for value in row.split(",")] for row in rows]).T
    columns = dict(zip(header.split(","), table, strict=True))
    outputs = {name: columns.pop(name) for name in OUTPUTS}
    return Trace(about["parameters"], columns.pop("t"), columns, outputs)
