"""The traces of GyroscopeSensor: what each shows, and the sensor by another road than the C's: filters of scipy as
transfer functions, the curve over temperature as Hermite pieces, noise by the oracle. One step of the grid at a time.
"""

import zlib
from collections.abc import Mapping
from math import exp, log, pi, sqrt

import numpy as np
from philox_oracle import philox
from scipy.interpolate import CubicHermiteSpline
from scipy.signal import cont2discrete, tf2ss
from scipy.special import ndtri

from gyro_model.experiments import Experiment, Floats, Tolerance
from gyro_model.sensor import KNOTS, SensorModel

NAME, ROWS, PERIOD, STEP = "GyroscopeSensor", 161, 7e-3, 1e-3
TOLERANCE = Tolerance(1e-11, "matrix exponentials by two roads: some 1e-13, carried on over the filter's memory")
ROUNDED = Tolerance(1e-11, "as the rate; a sample would jump by an lsb where a rounding tips it, and none does here")

_FILTER = {
    "filter_frequency_1": 43.0, "filter_damping_1": 0.35, "filter_lead_1": 2e-3,
    "filter_frequency_2": 120.0, "filter_damping_2": 1.4, "filter_lead_2": -4e-4, "noise_lead": 5e-3,
}  # fmt: skip
# By name: what differs from the packaged sensor.
CASES: Mapping[str, dict[str, float]] = {
    "rate_errors": {
        **_FILTER, "scale_factor": 0.97, "scale_factor_supply": 0.02, "nonlinearity_2": 3e-3, "nonlinearity_3": -2e-3,
        "misalignment_x": 0.02, "misalignment_y": -0.03, "bias": 0.05, "bias_supply": 0.01, "self_test_rate": 0.3,
        "acceleration_sensitivity_x": 1e-3, "acceleration_sensitivity_y": -2e-3, "acceleration_sensitivity_z": 5e-4,
        "sample_period": 2 * PERIOD, "full_scale": 2.0,
    },
    "temperature": {
        **_FILTER, "temperature_low": 280.0, "temperature_high": 325.0, "structure_lag": 0.2,
        "thermal_hysteresis": 0.02, "scale_factor_hysteresis": -0.015,
        **{f"bias_temperature_{k}": round(0.03 * ((3 * k) % 7 - 3), 3) for k in range(KNOTS)},
        **{f"scale_factor_temperature_{k}": round(0.01 * ((5 * k) % 11 - 4), 3) for k in range(KNOTS)},
    },
    "noise_and_turn_ons": {
        **_FILTER, "seed": 5, "angle_random_walk": 2e-3, "bias_instability": 0.02, "rate_random_walk": 0.05,
        "turn_on": 0.1, "supply_low": 2.5, "start_up_time": 0.0335, "lsb": 0.01, "sample_period": PERIOD,
    },
}  # fmt: skip


def inputs_of(name: str, t: Floats) -> dict[str, Floats]:
    """What drives each case, in few digits."""
    k = np.arange(len(t))
    rate = np.where(k // 20 % 2 == 0, 0.5, -1.5) * (k > 4)
    if name == "temperature":
        return {"omega_z": rate, "temperature": np.round(305.0 + 40.0 * np.sin(9.0 * t) * (t > 0.05), 3)}
    if name == "noise_and_turn_ons":
        return {"omega_z": rate, "supply": np.where((k >= 60) & (k < 75), 2.0, 3.3)}
    return {
        "omega_z": 2.0 * rate,
        "omega_x": np.where(k > 50, 1.0, 0.0),
        "omega_y": np.where(k > 70, -2.0, 0.0),
        "a_x": np.where(k > 90, 9.8, 0.0),
        "a_y": np.where(k > 100, 9.8, 0.0),
        "a_z": np.where(k > 110, -9.8, 0.0),
        "supply": np.where(k > 120, 3.6, 3.3),
        "self_test": (k > 135).astype(np.int32),
    }


class _Held:
    """A transfer function, input held over a step of the grid."""

    def __init__(self, top: list[float], bottom: list[float], rest: float) -> None:
        a, b, self.out, self.through = tf2ss(top, bottom)
        self.move, self.push, *_ = cont2discrete((a, b, self.out, self.through), STEP)
        self.state = -np.linalg.solve(a, b * rest)

    def step(self, value: float) -> None:
        self.state = self.move @ self.state + self.push * value

    @property
    def output(self) -> float:
        return float((self.out @ self.state)[0, 0])


def _filters(p: Mapping[str, float], rest: float) -> tuple[_Held, _Held]:
    """From the input and from the noise to the output."""
    w = [2.0 * pi * p[f"filter_frequency_{k}"] for k in (1, 2)]
    bottoms = [[1.0 / w[k] ** 2, 2.0 * p[f"filter_damping_{k + 1}"] / w[k], 1.0] for k in (0, 1)]
    bottom = list(np.polymul(*bottoms))
    leads = (p["filter_lead_1"], p["noise_lead"])
    signal, noise = (list(np.polymul([lead, 1.0], [p["filter_lead_2"], 1.0])) for lead in leads)
    return _Held(signal, bottom, rest), _Held(noise, bottom, 0.0)


class _Numbers:
    """Standard normal numbers of a stream, 32 to a counter."""

    def __init__(self, seed: int, name: str, offset: int = 0) -> None:
        self.key = (seed, (zlib.crc32(name.encode()) + offset) % 2**32)

    def at(self, counter: int, lane: int) -> Floats:
        words = philox(np.array([[counter % 2**32, counter >> 32, lane, 0]], dtype=np.uint64), self.key)
        bits = (words[:, 0::2] << np.uint64(21)) ^ (words[:, 1::2] >> np.uint64(11))
        return np.asarray(ndtri((bits.astype(float) + 0.5) * 2.0**-53))[0]

    def __getitem__(self, index: int) -> float:
        block, place = divmod(index, 32)
        return float(self.at(block + 1, place // 2)[place % 2])


class _Noise:
    """White, flicker (14 processes) and random walk from point to point of the grid."""

    def __init__(self, p: Mapping[str, float]) -> None:
        seed, names = int(p["seed"]), ("angle_random_walk", "bias_instability", "rate_random_walk")
        self.white, _, self.walk = (_Numbers(seed, name) for name in names)
        self.flicker = [_Numbers(seed, "bias_instability", i) for i in range(14)]
        self.sizes = (p[names[0]] / sqrt(STEP), sqrt(2 * log(2) / pi) * p[names[1]], p[names[2]] * sqrt(STEP))
        self.deviation = [self.sizes[1] * (sqrt(1.1) if i == 0 else 1.0) for i in range(14)]
        self.process = [d * n[0] for d, n in zip(self.deviation, self.flicker, strict=True)]
        self.walked = 0.0

    def next(self, point: int) -> None:
        self.walked += self.sizes[2] * self.walk[point]
        for i in range(14):
            if point % 4**i == 0:
                drawn = self.deviation[i] * self.flicker[i][point // 4**i]
                self.process[i] = 0.2 * self.process[i] + sqrt(1.0 - 0.04) * drawn

    def at(self, point: int) -> float:
        return self.walked + self.sizes[0] * self.white[point] + sum(self.process)


class _Sensor:
    """State of the sensor, and what it takes the rate for."""

    def __init__(self, p: Mapping[str, float], inputs: Mapping[str, float]) -> None:
        self.p, self.inputs = p, inputs
        self.knots = np.linspace(p["temperature_low"], p["temperature_high"], KNOTS)
        self.curves = {name: self._curve(name) for name in ("bias", "scale_factor")}
        self.widths = [p[f"thermal_hysteresis_width_{i}"] for i in (1, 2, 3)]
        self.temperature, self.play = inputs["temperature"], [inputs["temperature"]] * 3
        self.numbers = _Numbers(int(p["seed"]), "turn_on")
        self.turn_ons, self.turn_on, self.ready = -1, 0.0, np.inf

    def _curve(self, name: str) -> CubicHermiteSpline:
        values = np.array([self.p[f"{name}_temperature_{k}"] for k in range(KNOTS)])
        ends = np.concatenate([[2 * values[0] - values[1]], values, [2 * values[-1] - values[-2]]])
        return CubicHermiteSpline(self.knots, values, (ends[2:] - ends[:-2]) / 2 / (self.knots[1] - self.knots[0]))

    def switch(self, time: float) -> None:
        """The supply switches it on and off."""
        if self.inputs["supply"] < self.p["supply_low"]:
            self.ready = np.inf
        elif self.ready == np.inf:
            self.turn_ons += 1
            self.turn_on = self.p["turn_on"] * float(self.numbers.at(self.turn_ons, 0)[0])
            self.ready = time + self.p["start_up_time"]

    def warm(self) -> None:
        """Over a step of the grid."""
        lag, ambient = self.p["structure_lag"], self.inputs["temperature"]
        self.temperature += (ambient - self.temperature) * (1.0 - exp(-STEP / lag) if lag else 1.0)
        t = self.temperature
        self.play = [min(max(z, t - w), t + w) for z, w in zip(self.play, self.widths, strict=True)]

    def takes(self) -> float:
        """The rate before the bandwidth [rad/s]."""
        p, i, dv = self.p, self.inputs, self.inputs["supply"] - self.p["supply_ref"]
        t = min(max(self.temperature, self.knots[0]), self.knots[-1])
        rate = i["omega_z"] + p["misalignment_x"] * i["omega_x"] + p["misalignment_y"] * i["omega_y"]
        scale = p["scale_factor"] + self.curves["scale_factor"](t) + p["scale_factor_supply"] * dv
        scale += p["nonlinearity_2"] * rate + p["nonlinearity_3"] * rate**2
        bias = p["bias"] + self.curves["bias"](t) + p["bias_supply"] * dv
        bias += sum(p[f"acceleration_sensitivity_{a}"] * i[f"a_{a}"] for a in "xyz")
        side = sum((self.temperature - z) / w for z, w in zip(self.play, self.widths, strict=True)) / 3
        scale += p["scale_factor_hysteresis"] * side
        bias += p["thermal_hysteresis"] * side
        return float(scale * rate + bias + self.turn_on + i["self_test"] * p["self_test_rate"])


def simulated(p: Mapping[str, float], t: Floats, inputs: Mapping[str, Floats]) -> dict[str, Floats]:
    """The outputs at ``t``, before the inputs there act."""
    starts = {q.name: q.start for q in SensorModel().quantities if q.role == "input"}
    rows: list[tuple[float, float, int, float]] = []
    sensor = _Sensor(p, starts | {name: float(column[0]) for name, column in inputs.items()})
    sensor.switch(0.0)
    signal, noisy = _filters(p, sensor.takes())
    noise, sample, fresh = _Noise(p), 0.0, 0
    per_row = round(PERIOD / STEP)
    for point in range(per_row * (len(t) - 1) + 1):
        time = point * STEP
        rate = signal.output + noisy.output
        # In steps of the grid: sample periods here are whole numbers of them.
        since = point % round(p["sample_period"] / STEP)
        if since == 0:
            fresh, sample = int(time >= sensor.ready - 1e-12), 0.0
            if fresh:
                rounded = p["lsb"] * np.rint(rate / p["lsb"]) if p["lsb"] else rate
                sample = float(np.clip(rounded, -p["full_scale"], p["full_scale"]))
        row, rest = divmod(point, per_row)
        if rest == 0:
            valid = time >= sensor.ready - 1e-12
            ready = int(fresh and 2 * since * STEP < p["sample_period"] - 1e-9)
            rows.append((rate if valid else 0.0, sample, ready, sensor.temperature))
            sensor.inputs = starts | {name: float(column[row]) for name, column in inputs.items()}
            sensor.switch(time)
        if point:
            noise.next(point)
        if p["structure_lag"] == 0.0:
            sensor.warm()
        signal.step(sensor.takes())
        noisy.step(noise.at(point))
        if p["structure_lag"] > 0.0:
            sensor.warm()
    names = ("rate", "rate_sampled", "data_ready", "temperature_structure")
    columns = dict(zip(names, map(np.array, zip(*rows, strict=True)), strict=True))
    return {name: column for name, column in columns.items() if np.any(column)}


def parameters_of(name: str) -> dict[str, float]:
    """All that a sensor has, written out, and what the case changes."""
    own = [q for q in SensorModel().quantities if q.role == "parameter"]
    nominal = {q.name: int(q.start) if q.integer else q.start for q in own}
    return {**nominal, **CASES[name]}


def make_sensor(name: str) -> Experiment:
    """The trace of that name."""
    t = np.round(np.arange(ROWS) * PERIOD, 12)
    parameters, inputs = parameters_of(name), inputs_of(name, t)
    outputs = simulated(parameters, t, inputs)
    tolerances = {output: ROUNDED if output == "rate_sampled" else TOLERANCE for output in outputs}
    return Experiment(name, name.replace("_", " "), parameters, t, inputs, outputs, tolerances)
