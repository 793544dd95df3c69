"""The traces in tests/traces: what each shows and how it is made, without the C. ``pytest --update`` writes them anew.

Those of the full FMU come from the reference simulation (DOP853 at 1e-12) and the noise oracle; those of the envelope
form from the roots of the linear device; those of the sensor from sensor_traces.
"""

from collections.abc import Mapping
from functools import cache
from math import pi
from pathlib import Path

import numpy as np
from gyro_runner import OUTPUTS, Floats
from philox_oracle import drawn
from sensor_traces import CASES as SENSOR_CASES
from sensor_traces import NAME as SENSOR
from sensor_traces import make_sensor

from gyro_model.device import Device
from gyro_model.envelope import DEVICE, DRIVE_AMPLITUDE, RESONANCE
from gyro_model.experiments import EXPERIMENTS, Experiment, Tolerance, experiment_files, read_experiments
from gyro_model.quantities import PARAMETERS
from gyro_model.reference import simulate

FOLDER = Path(__file__).parents[1] / "traces"
FULL, ENVELOPE = "Gyroscope", "GyroscopeEnvelope"
ROWS, PERIOD, SEED = 161, 2e-5, 4

ROUNDING = Tolerance(1e-11, "reference integrated to 1e-12 a sample, the FMU rounds 1e-16 a step")
LAG = Tolerance(6e-11, "the lag takes the motion as a quintic over an internal step: (w h)^6/46080 at 3.8 kHz")
ROOTS = Tolerance(
    1e-10, "the roots of the motion are a rounding off, which counts against its decay: 2 Q of the amplitude"
)

# By name: what acts, beside the reference device.
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


def simulated(parameters: Mapping[str, float], t: Floats, inputs: Mapping[str, Floats]) -> dict[str, Floats]:
    """The outputs by the reference simulation, noise by the oracle."""
    own = {name: float(value) for name, value in parameters.items()}
    out = simulate(Device("trace", own), t, inputs, drawn(int(own["seed"]), len(t)))
    return {name: out[name] for name in OUTPUTS}


def parameters_of(name: str) -> dict[str, float]:
    """All that is nominal, written out, and what the case adds."""
    nominal = {q.name: int(q.start) if q.integer else q.start for q in PARAMETERS}
    return {**nominal, "x_start": 8e-7, "y_start": -3e-7, "sample_period": PERIOD, "seed": SEED, **CASES[name]}


def make(name: str) -> Experiment:
    """The trace of the full FMU of that name, by the reference simulation."""
    t = np.arange(ROWS) * PERIOD
    parameters, inputs = parameters_of(name), inputs_of(t)
    tolerance = LAG if "amplifier_time_constant" in CASES[name] else ROUNDING
    outputs = simulated(parameters, t, inputs)
    tolerances = dict.fromkeys(OUTPUTS, tolerance)
    return Experiment(name, name.replace("_", " "), parameters, t, inputs, outputs, tolerances)


# By name: parameters beside the envelope's default device; carrier [Hz]; by row: force amplitudes [N] and rate [rad/s].
_DRIVE = 2j * pi * RESONANCE * DEVICE["dxx"] * DRIVE_AMPLITUDE
Course = tuple[dict[str, float], float, tuple[tuple[int, complex, complex, float], ...]]
ENVELOPE_CASES: Mapping[str, Course] = {
    "rate_and_force_steps": (
        {},
        RESONANCE,
        ((0, _DRIVE, 0.0, 0.0), (20, _DRIVE, 0.0, 1.0), (60, 1.2 * _DRIVE, 3e-9 + 1e-9j, -2.0)),
    ),
    "off_resonance": (
        {"kxy": 6.58e-3, "dxy": -4e-9, "angular_gain": 0.8},
        RESONANCE - 40.0,
        ((0, 2e-8 + 1e-8j, 0.0, 0.5), (30, -1e-8j, 2e-8, 0.5), (77, 0.0, 0.0, 5.0)),
    ),
}
ENVELOPE_PERIOD = 1.3e-3


def make_envelope(name: str) -> Experiment:
    """The trace of the envelope FMU of that name: q' = (S - i w) q + B f, with S of the roots of s² + C s + K; where
    force or rate jump, displacement and velocity go on."""
    changes, carrier, course = ENVELOPE_CASES[name]
    p = {**DEVICE, "sense_gain_x": 1e6, "sense_gain_y": 1e6, **changes}
    t, w = np.arange(ROWS) * ENVELOPE_PERIOD, 2 * pi * carrier
    row = np.searchsorted([k for k, *_ in course], np.arange(ROWS), side="right") - 1
    force = np.array([course[i][1:3] for i in row])
    rate = np.array([course[i][3] for i in row])
    q, rows = np.array([DRIVE_AMPLITUDE, 0j]), []
    velocity = None
    for k in range(ROWS):
        rows.append(q)
        damping = np.array([[p["dxx"], p["dxy"]], [p["dxy"], p["dyy"]]]) / p["m"]
        damping = damping + 2 * p.get("angular_gain", 1.0) * rate[k] * np.array([[0.0, -1.0], [1.0, 0.0]])
        stiffness = np.array([[p["kxx"], p["kxy"]], [p["kxy"], p["kyy"]]]) / p["m"]
        roots, vectors = np.linalg.eig(np.block([[np.zeros((2, 2)), np.eye(2)], [-stiffness, -damping]]))
        forward = roots.imag > 0
        s = vectors[2:, forward] @ np.linalg.inv(vectors[:2, forward])
        push = np.linalg.solve(1j * w * np.eye(2) + damping + s, force[k]) / p["m"]
        if velocity is not None:
            turn = np.exp(1j * w * t[k])
            gap = ((velocity - s @ q - push) * turn).real
            q = q - 1j * np.linalg.solve(s.imag, gap) / turn
        slow, modes = np.linalg.eig(s - 1j * w * np.eye(2))
        rest = -np.linalg.solve(s - 1j * w * np.eye(2), push)
        q = rest + modes @ (np.exp(slow * ENVELOPE_PERIOD) * np.linalg.solve(modes, q - rest))
        velocity = s @ q + push
    z = np.array(rows)
    inputs = {f"u_{a}_{part}": getattr(force[:, i], of) for i, a in enumerate("xy") for part, of in _PARTS}
    inputs |= {"omega_z": rate, "carrier_frequency": np.full(ROWS, carrier)}
    outputs = {f"{a}_{part}": getattr(z[:, i], of) for i, a in enumerate("xy") for part, of in _PARTS}
    outputs |= {f"v_{key}": 1e6 * column for key, column in outputs.items()}
    parameters = {**p, "x_start_i": DRIVE_AMPLITUDE}
    # A part may be small beside the amplitude that it is a part of.
    size = {axis: np.max(np.abs(z[:, i])) for i, axis in enumerate("xy")}
    share = {n: 1e6 ** n.startswith("v_") * size[n[-3]] / np.max(np.abs(column)) for n, column in outputs.items()}
    tolerances = {n: Tolerance(float(f"{ROOTS.relative * share[n]:.1e}"), ROOTS.reason) for n in outputs}
    return Experiment(name, name.replace("_", " "), parameters, t, inputs, outputs, tolerances)


_PARTS = (("i", "real"), ("q", "imag"))


@cache
def written(form: str) -> dict[str, bytes]:
    """The files of the traces of the FMU of that name, made anew."""
    if form == FULL:
        return experiment_files("Reference traces of the gyroscope", [make(name) for name in CASES])
    if form == SENSOR:
        return experiment_files("Reference traces of the sensor", [make_sensor(name) for name in SENSOR_CASES])
    made = [make_envelope(name) for name in ENVELOPE_CASES]
    return experiment_files("Reference traces of the gyroscope as envelopes", made)


def write(form: str) -> None:
    """Writes the traces of the FMU of that name anew."""
    (FOLDER / form).mkdir(parents=True, exist_ok=True)
    for name, data in written(form).items():
        (FOLDER / form / name).write_bytes(data)


def read(form: str) -> dict[str, Experiment]:
    """The traces of the FMU of that name, by name."""
    assert (FOLDER / form / EXPERIMENTS).is_file(), "run pytest with --update"
    return {e.name: e for e in read_experiments(lambda name: (FOLDER / form / name).read_bytes())}
