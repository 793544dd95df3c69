"""Mode matching on devices as built, their tuner knowing the design alone: passive, active, and what it costs."""

from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import partial
from math import degrees, pi, sqrt
from multiprocessing import get_context
from typing import Any, Final

import numpy as np

from benchmarks.report import Options, Report, Row, Table, row, spread
from calibration.matching import Asking, ask, match, measures
from calibration.matching.measures import SETTLING
from cosim.rate.allan import allan_deviation
from cosim.rate.courses import ZERO_CELSIUS, Course, constant, constant_temperature, temperature_ramp
from cosim.rate.dither import Dither
from cosim.rate.master import simulate
from cosim.rate.settings import design_for
from gyro_model.device import Device, load_device

DEVICES: Final = 12
LOWEST_Q, HIGHEST_Q = 500.0, 20_000.0
COLD, HOT, PER_MINUTE = -20.0, 60.0, 1.0
"""The ramp [°C, °C/min]."""
PASSIVE_RUNS, PASSIVE_MINUTES = 3, 20.0
"""Ramps of the passive method at most, and how much of each."""
REST: Final = 200.0
"""Of a run for the noise of the rate [s]."""


def as_designed(number: int) -> Device:
    """The design of device ``number``: Q from 500 to 20,000, whichever part of the lot is taken."""
    # Digits of the number in base 2 behind the point, in reverse: 0, 1/2, 1/4, 3/4, ...; the largest of twelve is 7/8.
    share = int(f"{number:04b}"[::-1], 2) / 16 / 0.875
    q = LOWEST_Q * (HIGHEST_Q / LOWEST_Q) ** share
    design = load_device("mode_matched")
    p = design.parameters
    damping = p["m"] * 2 * pi * 5123.0 / q
    return design.with_parameters({"dxx": damping, "dyy": damping})


def as_built(number: int) -> Device:
    """Device ``number`` of the lot: every figure of its design off by what processes leave, and a chain of its own."""
    rng = np.random.default_rng([704, number])
    p = as_designed(number).parameters

    def off(share: float) -> float:
        return float(1 + share * rng.uniform(-1, 1))

    def about(size: float) -> float:
        return float(size * rng.uniform(-1, 1))

    mass = p["m"] * off(0.02)
    stiffness = p["kxx"] * off(0.01)
    omega = sqrt(stiffness / mass)
    # A split of ±8 Hz beside the designed one.
    sense = stiffness * (p["kyy"] / p["kxx"]) * (1 + 2 * 2 * pi * about(8.0) / omega)
    damping = [p["dxx"] * off(0.2) for _ in range(2)]
    own = {
        "m": mass, "kxx": stiffness, "kyy": sense, "kxy": 2 * mass * omega * np.deg2rad(about(5.0)),
        "dxx": damping[0], "dyy": damping[1], "dxy": about(5e-3) * damping[1],
        "sense_gain_x": 1e6 * off(0.03), "sense_gain_y": 1e6 * off(0.03),
        "softening": p["softening"] * off(0.1), "electrode_gap": p["electrode_gap"] * off(0.03),
        "tck": -6e-5 * off(0.05), "tck_split": about(3e-5), "tcd": 2.5e-3 * off(0.2), "tcg": about(3e-4),
        "amplifier_time_constant": 1e-6 * off(0.3), "tcp": 3e-9 * off(0.5), "structure_lag": 240.0 * off(0.3),
        "circuit_lag": 120.0 * off(0.3), "actuator_misalignment": about(0.02), "pickoff_misalignment": about(0.01),
        "pickoff_gain_mismatch": about(0.03), "feedthrough": about(10.0),
    }  # fmt: skip
    device = load_device("mode_matched").with_parameters(own)
    return replace(device, name=f"lot-{number}")


def asking(number: int, method: str, temperature: Course, duration: float) -> Asking:
    """Device ``number`` at rest, its tuner and loops knowing its design."""
    device = as_built(number)
    courses = {"omega_z": constant(0.0, "at rest"), "temperature": temperature}
    return ask(device, design_for(as_designed(number), device), method, courses, duration, seed=number + 1)


def through_ramp(number: int, method: str, minutes: float | None = None) -> dict[str, float]:
    """Measures of a run through the ramp, or its first ``minutes``."""
    course = temperature_ramp(COLD + ZERO_CELSIUS, HOT + ZERO_CELSIUS, PER_MINUTE)
    asked = asking(number, method, course, course.length if minutes is None else 60 * minutes)
    matched = match(asked)
    found = measures(asked.run, matched)
    t, split = (matched.record[name].to_numpy() for name in ("t", "split_true"))
    after = np.abs(split[(t > 5.0) & (t <= 6.0)]).max()
    first = abs(float(split[0]))
    return {**found._asdict(), "after_5_s": float(after), "first": first, "q": _q(number)}


def _q(number: int) -> float:
    p = as_built(number).parameters
    return float(sqrt(p["kyy"] * p["m"]) / p["dyy"])


def noise(number: int) -> dict[str, float]:
    """Angle random walk [deg/√h] of device ``number`` at 25 °C with the active method, and without dither at the bias
    that it ended at."""
    asked = asking(number, "active", constant_temperature(25.0), REST)
    matched = match(asked)
    with_dither = degrees(measures(asked.run, matched).walk) * 60
    bias = float(matched.record["v_bias"][-1])
    course = Course(lambda t: np.interp(t, (0.0, 1.0), (asked.known.first_bias, bias)), np.inf, "matched")
    run = replace(asked.run, others={"v_bias": course})
    record = simulate(run).record
    rate = record["rate"].to_numpy()[record["t"].to_numpy() > SETTLING]
    walk = allan_deviation(rate, run.interval, run.white_from).angle_random_walk
    assert run.blocks().dither == Dither()
    return {"with": with_dither, "without": degrees(walk) * 60}


def run(options: Options) -> Report:
    """The tables."""
    lot = range(options.seeds_or(DEVICES))
    with ProcessPoolExecutor(options.jobs, mp_context=get_context("spawn")) as pool:
        held = list(pool.map(partial(through_ramp, method="active"), lot))
        passive = list(pool.map(partial(through_ramp, method="passive", minutes=PASSIVE_MINUTES), _some(lot)))
        costs = list(pool.map(noise, lot))
    what = f"{COLD:g}..{HOT:g} °C at {PER_MINUTE:g} °C/min, {len(held)} devices as built, Q {LOWEST_Q:g}..{HIGHEST_Q:g}"
    return Report(
        "matching",
        "Mode matching",
        [
            Table("Active: force either side of the drive, sense loop closed", active_rows(held, what)),
            Table(f"Passive: thermal noise, sense loop open, {PASSIVE_MINUTES:g} minutes", passive_rows(passive)),
            Table("What the dither costs the rate, at 25 °C", noise_rows(costs)),
        ],
        [
            "Split: √(kyy/m)/2π with the bias in kyy, less the frequency of the drive loop, true values. The tuner is "
            "told its design, demodulated voltage, commanded forces and drive frequency alone.",
            "Published, measured on one device: 0.01 Hz in 5 s, fluctuation at most 0.005 Hz over -20..60 °C "
            "(Micromachines 16, 704, 2025, by mode reversal).",
            "Time 0 is when the loops have settled at the bias at which the design matches.",
        ],
        {"devices": [{**h, **c} for h, c in zip(held, costs, strict=True)], "passive": passive},
    )


def _some(lot: Sequence[int]) -> list[int]:
    """Devices of low, middle and high Q."""
    return [lot[i] for i in np.unique(np.linspace(0, len(lot) - 1, PASSIVE_RUNS).astype(int))]


def active_rows(held: Sequence[dict[str, float]], what: str) -> list[Row]:
    """Median, 95 % and worst over the devices."""

    def figures(key: str, factor: float = 1.0) -> dict[str, float]:
        return spread(factor * run[key] for run in held)

    return [
        row("split at the first bias", "Hz", figures("first"), note=what),
        row("time until |Δf| stays below 0.01 Hz", "s", figures("matched_at"), limit=5.0),
        row("|Δf| from 5 to 6 s, largest", "mHz", figures("after_5_s", 1e3), limit=10.0),
        row("Δf from 5 s on, rms of a run", "mHz", figures("rms", 1e3), limit=5.0),
        row("Δf from 5 s on, largest of a run", "mHz", figures("largest", 1e3)),
        row("error of a block over its own deviation, rms", "1", figures("ratio")),
    ]


def passive_rows(runs: Sequence[dict[str, float]]) -> list[Row]:
    """One row a device."""

    def line(run: dict[str, float]) -> Row:
        values = {
            "error/bound": run["over_bound"],
            "rms [Hz]": run["rms"],
            "largest [Hz]": run["largest"],
            "blocks without an answer": run["missed"],
        }
        return row(
            f"Q {run['q']:.0f}", "1", values, limit=1.2, judged=("error/bound",), note=f"{run['first']:.2f} Hz at first"
        )

    return [line(run) for run in runs]


def noise_rows(costs: Sequence[dict[str, float]]) -> list[Row]:
    """Angle random walk with and without the dither, and by how much more."""
    columns: dict[str, Callable[[dict[str, Any]], float]] = {
        "with dither": lambda c: c["with"],
        "without": lambda c: c["without"],
    }
    rows = [row(f"angle random walk, {name}", "°/√h", spread(map(value, costs))) for name, value in columns.items()]
    return [*rows, row("with over without", "1", spread(c["with"] / c["without"] for c in costs))]
