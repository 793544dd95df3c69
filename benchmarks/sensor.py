"""The sensor that is exported beside the plant with its loops: rate and temperature that nothing was fitted to, noise
from 0.01 to 1,000 s, and how fast it runs in a C program."""

import time
from collections.abc import Mapping
from math import degrees
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.c_driver import CPlants
from benchmarks.report import Options, Report, Row, Table, load, row
from calibration.sensor.model import sensor_parameters
from calibration.sensor.numbers import sensor_of
from cosim.rate.allan import overlapping
from cosim.rate.bench import Bench, multisine
from cosim.rate.courses import Course
from cosim.rate.metrics import PER_HOUR
from gyro_model.build import build
from gyro_model.device import load_device
from gyro_model.sensor import SensorModel
from gyrotwin.api.datasheets import datasheet

Floats = NDArray[np.float64]

DEVICES: Final = ("rate-mode", "rate_mode_as_built")
STEP: Final = 1e-3
"""Of the sensor beside the plant [s]."""
QUIET: Final = ("angle_random_walk", "bias_instability", "rate_random_walk", "turn_on")
"""What is drawn is another draw than the plant's."""
MEAN_ERROR: Final = 0.05
"""Of the error budget's total."""
FASTEST: Final = {1e-2: 10_000.0, 1e-4: 500.0}
"""Times real time, by step [s]."""
REST_SEEDS, REST = 12, 9000.0
"""Records of the sensor at rest [s]."""
SHORT_SEEDS, SHORT = 4, 150.0
"""Records of the plant at rest with a row each 10 ms [s]."""
WITHIN, ERRORS = 0.1, 2.0


class Profile(NamedTuple):
    """rate [rad/s] and ambient temperature [K] against time, for ``duration`` [s]; row: its length [s], of which both
    give means; step: of the sensor [s]."""

    name: str
    rate: Course
    temperature: Course
    duration: float
    row: float
    step: float
    envelope: bool


def profiles(full_scale: float, bandwidth: float) -> list[Profile]:
    """None of their rates, temperatures or slopes is that of a test of the datasheet."""
    turns, degrees_c = (0.0, 60.0, 500.0, 900.0, 1500.0, 1800.0), (10.0, 10.0, 52.0, 52.0, -8.0, -8.0)
    slow = Course(lambda t: 0.35 * full_scale * np.sin(t / 7) * np.sign(np.sin(t / 61)), np.inf, "turns")
    warm = Course(lambda t: np.interp(t, turns, degrees_c) + 273.15, np.inf, "a day in half an hour")
    fast = multisine(np.geomspace(0.07, 0.8, 23) * bandwidth, 0.6 * full_scale, 77)
    drift = Course(lambda t: 308.0 - 0.2 * t, np.inf, "cooling")
    return [
        Profile("turns for 30 min, 10 to 52 to -8 °C, envelope", slow, warm, 1800.0, 1.0, STEP, True),
        Profile("23 sines to 0.8 of the bandwidth, cooling, full FMU", fast, drift, 20.0, 1e-3, 5e-5, False),
    ]


class Sensor:
    """The FMU with the parameters of a datasheet, in a C program."""

    def __init__(self, plants: CPlants, parameters: Mapping[str, float]) -> None:
        self.plants, self.parameters = plants, parameters

    def means(
        self, inputs: Mapping[str, Floats], rows: int, per_row: int, step: float = STEP, **changed: float
    ) -> Floats:
        """Means of the analogue rate [rad/s] over rows of steps, shape (rows,)."""
        first = {name: float(values[0]) for name, values in inputs.items()}
        own = {k: v for k, v in {**self.parameters, "start_up_time": 0.0, **changed, **first}.items() if k != "seed"}
        with self.plants.start(own, inputs, step) as plant:
            return plant.means(rows, per_row)[:, 0]


def followed(bench: Bench, sensor: Sensor, profile: Profile) -> tuple[Floats, Floats, Floats]:
    """Output of plant and sensor, and the true rate [rad/s], a row each, shapes (rows,)."""
    one = bench.record(
        profile.duration, rate=profile.rate, temperature=profile.temperature, output_rate=1 / profile.row,
        envelope=profile.envelope, seed=5,
    )  # fmt: skip
    rows, per_row = len(one.rate), round(profile.row / profile.step)
    count = rows * per_row
    inputs = {
        "omega_z": profile.rate.held(0, count, profile.step),
        "temperature": profile.temperature.held(0, count, profile.step),
    }
    quiet = dict.fromkeys(QUIET, 0.0)
    return one.rate, sensor.means(inputs, rows, per_row, profile.step, **quiet), one.true


def budget(content: Mapping[str, Any], largest: float) -> dict[str, float]:
    """Terms of the error budget of a rate up to ``largest`` [rad/s], by name, and their root of the sum of squares
    [rad/s]: half ranges over temperature, what a line leaves, turn-on, noise of a second."""
    numbers, columns = sensor_of(content), {name: curve["columns"] for name, curve in content["curves"].items()}
    figures = {f["id"]: f["value"] for test in content["tests"] for f in test["figures"]}
    bias, scale = (np.ptp(columns["temperature"][name]) for name in ("bias [°/s]", "scale factor [1]"))
    terms = {
        "bias over temperature": float(np.radians(bias)) / 2,
        "scale factor over temperature": float(scale) / 2 * largest,
        "nonlinearity": 1e-6 * figures["scale_factor_nonlinearity"] * numbers.full_scale,
        "hysteresis": abs(figures.get("bias_hysteresis") or 0.0) / PER_HOUR / 2,
        "turn-on": numbers.turn_on,
        "noise of 1 s": numbers.noise_density,
    }
    return terms | {"total": float(np.sqrt(sum(term**2 for term in terms.values())))}


def profile_rows(device: str, bench: Bench, sensor: Sensor, content: Mapping[str, Any]) -> tuple[list[Row], list[Row]]:
    """A row a profile, and the terms of the budget."""
    found, terms = [], []
    for profile in profiles(bench.full_scale, sensor_of(content).bandwidth or 10.0):
        plant, own, true = followed(bench, sensor, profile)
        used = np.arange(len(plant)) * profile.row > bench.settling
        difference = (own - plant)[used]
        # Over a second, where a row is shorter: the noise of a row is none of the model.
        parts = max(int(len(difference) * profile.row), 1)
        over = np.array([part.mean() for part in np.array_split(difference, parts)])
        own_budget = budget(content, float(np.abs(true).max()))
        share = np.abs(over).mean() / own_budget["total"]
        values = {
            "mean error/total": share, "mean error [°/s]": degrees(float(np.abs(over).mean())),
            "largest [°/s]": degrees(float(np.abs(over).max())), "rms of rows [°/s]": degrees(float(difference.std())),
            "rms of the output's error [°/s]": degrees(float((plant - true)[used].std())),
            "total [°/s]": degrees(own_budget["total"]),
        }  # fmt: skip
        found.append(row(f"{device}: {profile.name}", "1", values, limit=MEAN_ERROR, judged=("mean error/total",)))
        terms.append(row(f"{device}: {profile.name}", "°/s", {k: degrees(v) for k, v in own_budget.items()}))
    return found, terms


def rest_variances(sensor: Sensor, seeds: int, duration: float, row_length: float) -> tuple[Floats, Floats]:
    """Tau [s] and the Allan variance of each record, shape (seeds, n)."""
    per_row = round(row_length / STEP)
    still = {"omega_z": np.zeros(1)}
    found = []
    for seed in range(seeds):
        with sensor.plants.start({**sensor.parameters, "seed": seed}, still, STEP) as plant:
            rate = plant.means(round(duration / row_length), per_row)[:, 0]
        tau, deviation = overlapping(rate[round(2.0 / row_length) :], row_length)
        found.append(deviation**2)
    return tau, np.array(found)


def deviation_of(variances: Floats) -> tuple[Floats, Floats]:
    """Deviation and its standard error by the scatter of the records, shapes (n,)."""
    deviation = np.sqrt(variances.mean(axis=0))
    return deviation, variances.std(axis=0, ddof=1) / np.sqrt(len(variances)) / (2 * deviation)


def compared(what: str, tau: Floats, found: tuple[Floats, Floats], wanted: tuple[Floats, Floats]) -> Row:
    """The largest difference over what is allowed, 10 % or two standard errors of both."""
    difference, errors = np.abs(found[0] - wanted[0]), np.hypot(found[1], wanted[1])
    allowed = np.maximum(WITHIN * wanted[0], ERRORS * errors)
    worst = int(np.argmax(difference / allowed))
    values = {
        "largest over allowed": float((difference / allowed).max()), "at τ [s]": float(tau[worst]),
        "ratio there": float(found[0][worst] / wanted[0][worst]),
        "within": float(np.mean(difference <= allowed)), "values": float(len(tau)),
    }  # fmt: skip
    return row(what, "1", values, limit=1.0, judged=("largest over allowed",))


def noise_rows(device: str, bench: Bench, sensor: Sensor, content: Mapping[str, Any]) -> list[Row]:
    """Below a second beside the plant, above beside the plant's long records, and all of it beside the design."""
    tau, short = rest_variances(sensor, SHORT_SEEDS, SHORT, 1e-2)
    records = [bench.record(SHORT, seed=11 + k, output_rate=100.0, envelope=True).rate for k in range(SHORT_SEEDS)]
    plant = np.array([overlapping(rate[200:], 1e-2)[1] ** 2 for rate in records])
    near = tau <= 1.0
    rows = [
        compared(
            f"{device}: 0.01 to 1 s, beside the plant", tau[near], *(
                (d[near], e[near]) for d, e in (deviation_of(short), deviation_of(plant))
            )
        )
    ]  # fmt: skip
    tau, long = rest_variances(sensor, REST_SEEDS, REST, 0.1)
    own = deviation_of(long)
    curve = {name: np.array(values) for name, values in content["curves"]["allan"]["columns"].items()}
    used = curve["tau [s]"] >= 1.0
    there = [np.interp(np.log(curve["tau [s]"][used]), np.log(tau), part) for part in own]
    # The interval of 95 % is two errors to either side, of five records.
    width = (curve["high [°/h]"] - curve["low [°/h]"])[used] / 4 / PER_HOUR
    measured = curve["deviation [°/h]"][used] / PER_HOUR
    rows.append(
        compared(f"{device}: 1 s on, beside the plant", curve["tau [s]"][used], (there[0], there[1]), (measured, width))
    )
    p = sensor.parameters
    n, b, k = (p[name] for name in ("angle_random_walk", "bias_instability", "rate_random_walk"))
    design = np.sqrt(n**2 / tau + 2 * np.log(2) / np.pi * b**2 + k**2 * tau / 3)
    chosen = (tau >= 1.0) & (tau <= 1000.0)
    exact = (design[chosen], np.zeros(chosen.sum()))
    rows.append(
        compared(f"{device}: 1 to 1,000 s, beside N, B, K", tau[chosen], (own[0][chosen], own[1][chosen]), exact)
    )
    return rows


def speed_rows(plants: CPlants, parameters: Mapping[str, float], repeats: int = 15) -> list[Row]:
    """Set rate and temperature, step, get, with every part of the sensor on."""
    rng = np.random.default_rng(3)
    inputs = {"omega_z": rng.uniform(-1, 1, 256), "temperature": 298 + rng.uniform(-1, 1, 256)}
    on = {
        "bias_instability": 1e-6, "rate_random_walk": 1e-7, "lsb": 1e-5, "thermal_hysteresis": 1e-4,
        "structure_lag": 240.0,
    }  # fmt: skip
    rows = []
    for step, limit in FASTEST.items():
        calls = round(200 / step) if step > 1e-3 else 500_000
        spent = []
        with plants.start({**on, **parameters}, inputs, step) as plant:
            for _ in range(repeats):
                began = time.process_time_ns()
                plant(calls)
                spent.append((time.process_time_ns() - began) / calls)
        ratios = {"of minima": 1e9 * step / min(spent), "of medians": 1e9 * step / float(np.median(spent))}
        rows.append(row(f"steps of {1e3 * step:g} ms", "times real time", {**ratios, "a step [ns]": min(spent)},
                        limit=limit, at_least=True, judged=tuple(ratios)))  # fmt: skip
    return rows


def run(options: Options) -> Report:
    """Both devices, in this one process."""
    del options
    before = load()
    followed_rows: list[Row] = []
    terms: list[Row] = []
    noise: list[Row] = []
    speed: list[Row] = []
    with CPlants(build(SensorModel()).fmi3, ("rate",)) as plants:
        for name in DEVICES:
            content = datasheet(name, seed=1).summary
            sensor = Sensor(plants, sensor_parameters(content, 100.0))
            bench = Bench(load_device(name))
            one, own = profile_rows(name, bench, sensor, content)
            followed_rows += one
            terms += own
            noise += noise_rows(name, bench, sensor, content)
        speed = speed_rows(plants, sensor.parameters)
    notes = [
        "The parameters are those that `gyrotwin export sensor` writes of `gyrotwin datasheet DEVICE`. Error: sensor "
        "without noise and turn-on less the plant, which has both, by means over a second.",
        "Total: root of the sum of squares of the budget's terms, each below.",
        f"Noise: largest difference of the Allan deviations over what is allowed, {100 * WITHIN:g} % or {ERRORS:g} "
        "standard errors of both; means over rows of 10 ms below a second, of 0.1 s above.",
        f"Speed in processor time, {load()}",
        "Before: " + before,
    ]
    tables = [
        Table("Profiles that nothing was fitted to", followed_rows),
        Table("Error budget", terms),
        Table("Allan deviation at rest", noise),
        Table("Speed in a C program, all parts of the sensor on", speed),
    ]
    return Report("sensor", "The sensor that is exported beside the plant with its loops", tables, notes)
