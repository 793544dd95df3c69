"""Compensation of devices as built, on the envelope FMU: what is reached of what any function of the inputs' history
could reach, and the two published methods with thermal hysteresis off and on.

The floor is simulated: the same record of the same device and seed without walk, turn-on and noise is a function of the
inputs' history; what the record differs from it by is what no such function tells.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from multiprocessing import get_context
from typing import Final, NamedTuple

import numpy as np
from threadpoolctl import threadpool_limits

from benchmarks.compensation_records import Profile, blocks_of, fmu_record, lot_shares, profile, soaks
from benchmarks.report import Options, Report, Row, Table, row
from calibration.compensation.choose import choose
from calibration.compensation.measures import Change, change, judge, spread_over_temperature
from calibration.compensation.methods import piecewise
from calibration.compensation.methods.method import Asked
from calibration.compensation.record import STRUCTURE, Blocks, Floats, joined
from calibration.compensation.trial import trial
from cosim.rate.metrics import PER_HOUR
from gyro_model.device import Device, load_device

DEVICES: Final = 20
METHODS: Final = ("history", "spline", "piecewise")
REACH: Final = 0.8
"""Of the possible factor."""
UNTOLD: Final = ("bias_walk", "turn_on", "thermal_force", "sense_noise", "flicker_noise")
"""What no function of the inputs' history tells."""
FITTED: Final = (
    profile(-22, (62, 2, 10), (-22, 2, 10)),
    profile(-22, (62, 4, 10), (-22, 4, 10)),
    profile(-22, (62, 1.5, 5), (-22, 4, 5)),
)
"""Three cycles, each with a turn-on of its own."""
TESTED: Final = profile(-20, (60, 3, 10), (-20, 5, 10))
"""Another, with ramps that none of those has."""
SAMPLING_TIME: Final = 10.0
PERIOD: Final = 2e-3
"""Of the loops on the envelope [s]: twice the usual, half the time. Blocks then differ by 0.6 °/h rms, a third of their
noise."""
NETWORK_SEEDS: Final = 3
"""Of the network: half a minute of processor time each."""
SOURCE_SEGMENTS: Final = 4
"""Of 20 °C, as Liu et al. 2014 measure."""
SOAKED: Final = soaks(np.arange(-20.0, 61.0, 20.0))
SOAKED_BETWEEN: Final = soaks(np.array([60.0, 50.0, 30.0, 10.0, -10.0, -20.0]))
"""The other way, between the temperatures fitted."""


def as_built(number: int) -> Device:
    """Device ``number`` of the lot: sizes of what remembers and wanders, lags and laws, each drawn about the packaged
    device's."""
    rng = np.random.default_rng([14, number])
    p = load_device("rate_mode_as_built").parameters

    def between(low: float, high: float) -> float:
        return float(low * (high / low) ** rng.uniform())

    own = {name: p[name] * between(0.5, 2.0) for name in ("thermal_hysteresis", "relaxation", "turn_on", "bias_walk")}
    own |= {name: p[name] * between(0.7, 1.4) for name in ("relaxation_time", "structure_lag", "circuit_lag")}
    own |= {name: p[name] * between(0.8, 1.25) for name in ("tck_split", "tcd", "tcg", "tcp", "parasitic_coupling")}
    return replace(load_device("rate_mode_as_built"), name=f"lot-{number}").with_parameters(own)


def made(device: Device, course: Profile, seed: int, closed: bool) -> Blocks:
    """Blocks of a record of ``device``."""
    return blocks_of(fmu_record(course, seed, closed, device, PERIOD), device.name, SAMPLING_TIME)


class Tests(NamedTuple):
    """Blocks of a device: fitted cycles, the one held out, and what of its rate no function of the inputs' history
    tells, shape (n,) [rad/s]."""

    fitted: Blocks
    tested: Blocks
    untold: Floats


def tests_of(number: int, closed: bool) -> Tests:
    """The records of device ``number``, every cycle turned on anew."""
    device = as_built(number)
    *seeds, last = (10 * number + k for k in range(len(FITTED) + 1))
    fitted = joined([made(device, course, seed, closed) for course, seed in zip(FITTED, seeds, strict=True)])
    tested = made(device, TESTED, last, closed)
    told = made(device.with_parameters(dict.fromkeys(UNTOLD, 0.0)), TESTED, last, closed)
    return Tests(fitted, tested, tested.rate - told.rate)


def factors(tests: Tests, method: str) -> tuple[float, float]:
    """By what (max - min)/range of the held-out bias fell, and by what it could have fallen."""
    part = tests.tested.part(tests.tested.at_rest)
    untold = tests.untold[tests.tested.at_rest]
    possible = spread_over_temperature(part, part.rate) / spread_over_temperature(part, untold)
    of = trial(tests.fitted, tests.tested, Asked(method, sampling_time=SAMPLING_TIME), "clamp")
    return change(of.judged[0].held_out.bias).factor, possible


def _device(number: int, closed: bool) -> list[tuple[float, float]]:
    with threadpool_limits(1, "blas"):
        tests = tests_of(number, closed)
        return [factors(tests, method) for method in METHODS]


def lot_rows(found: Sequence[Sequence[tuple[float, float]]]) -> list[Row]:
    """A row a method: median and worst over the devices, shape (devices, methods, 2)."""
    rows = []
    for method, both in zip(METHODS, np.moveaxis(np.array(found), 1, 0), strict=True):
        factor, possible = both.T
        values = lot_shares(factor, possible)
        limit = REACH if method == METHODS[0] else None
        rows.append(row(f"{method}, bias", "×", values, limit=limit, at_least=True, judged=("share",)))
    return rows


def _packaged(hysteresis: bool) -> Device:
    device = load_device("rate_mode_as_built")
    return device if hysteresis else device.with_parameters({"thermal_hysteresis": 0.0})


def _network(hysteresis: bool, seeds: int) -> list[Row]:
    """CN 105222765 in the closed loop: bias of the held-out cycle, neurons chosen by inner validation."""
    with threadpool_limits(1, "blas"):
        device = _packaged(hysteresis)
        fitted = joined([made(device, course, 1 + k, True) for k, course in enumerate(FITTED)])
        tested = made(device, TESTED, 9, True)
        asked = [Asked("network", seed=seed, sampling_time=SAMPLING_TIME) for seed in range(1, seeds + 1)]
        found = [judge(tested, choose(fitted, one).best[0].fit(fitted), "clamp").bias for one in asked]
        reached = np.array([change(curve).factor for curve in found])
    values = {"median": float(np.median(reached)), "worst": float(reached.min())}
    return [row(f"network, hysteresis {_word(hysteresis)}, bias, {seeds} seeds", "×", values)]


def _segments(hysteresis: bool) -> list[Row]:
    """Liu et al. 2014: four segments of 20 °C, settled, open loop."""
    device = _packaged(hysteresis)
    fitted, tested = (made(device, course, seed, False) for course, seed in ((SOAKED, 1), (SOAKED_BETWEEN, 2)))
    fitted, tested = fitted.part(fitted.settled), tested.part(tested.settled)
    left = judge(tested, piecewise.fit(fitted, SAMPLING_TIME, STRUCTURE, SOURCE_SEGMENTS), "clamp")
    if left.scale is None:
        raise ValueError("the soaks never turn")
    what = f"four segments, hysteresis {_word(hysteresis)}"
    return [
        row(f"{what}, scale factor", "ppm/°C", _before_after(change(left.scale), 1e6)),
        row(f"{what}, bias", "°/h/°C", _before_after(change(left.bias), PER_HOUR)),
    ]


def _word(on: bool) -> str:
    return "on" if on else "off"


def _before_after(found: Change, factor: float) -> dict[str, float]:
    return {"before": factor * found.before, "after": factor * found.after, "factor": found.factor}


PUBLISHED: Final = (
    row("Liu et al. 2014, scale factor", "ppm/°C", {"before": 316.66, "after": 69.67, "factor": 316.66 / 69.67}),
    row("Liu et al. 2014, bias", "°/h/°C", {"before": 366.22, "after": 115.25, "factor": 366.22 / 115.25}),
)


def run(options: Options) -> Report:
    """The tables."""
    numbers = range(1, options.seeds_or(DEVICES) + 1)
    with get_context("spawn").Pool(options.jobs) as pool:
        lot = pool.map(partial(_device, closed=True), numbers, chunksize=1)
        network = pool.map(partial(_network, seeds=options.seeds_or(NETWORK_SEEDS)), (False, True), chunksize=1)
        segments = pool.map(_segments, (False, True), chunksize=1)
    return Report(
        "compensation_as_built",
        "Compensation of devices as built",
        [
            Table(f"{len(numbers)} devices, closed loop: held out is another cycle, with other ramps", lot_rows(lot)),
            Table(
                "The network of CN 105222765, device rate_mode_as_built, closed loop, another cycle held out",
                [one for rows in network for one in rows],
            ),
            Table(
                "The segments of Liu et al. 2014, device rate_mode_as_built, open loop, settled",
                [*PUBLISHED, *(one for rows in segments for one in rows)],
            ),
        ],
        [
            "Envelope FMU under steps of 100 °/s. The lot: hysteresis, relaxation, turn-on and walk of half to twice "
            "those of rate_mode_as_built, lags and laws about its. Fitted on three cycles, each turned on anew, at ±2, "
            "±4, +1.5 and -4 °C/min, tested on a fourth at +3 and -5 °C/min.",
            "Coefficients are (max - min)/range of means over passes of at most 2 °C. Possible: down to what walk, "
            "turn-on and noise leave, which no function of the inputs' history tells; by simulation. Share: factor "
            "over possible, a device at a time; over 1 by luck with the walk.",
            "Segments: fitted at -20, 0, ..., 60 °C upwards, tested downwards between them.",
        ],
    )
