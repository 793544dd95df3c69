"""Temperature compensation on held-out cycles: factors beside those that the noise of the record would allow."""

from collections.abc import Callable
from functools import partial
from multiprocessing import get_context
from time import process_time
from typing import Final, NamedTuple

import numpy as np
import polars as pl

from benchmarks.compensation_records import (
    RAMP_FIT,
    RAMP_TEST,
    SAMPLING_TIME,
    SOAK_FIT,
    SOAK_TEST,
    Profile,
    blocks_of,
    fmu_record,
    quasi_static,
)
from benchmarks.compensation_warmup import NOTES, WARMUP, warmup_table
from benchmarks.report import SEEDS, Options, Report, Row, Table, row
from calibration.compensation.choose import choose
from calibration.compensation.measures import Result, change, judge
from calibration.compensation.methods import piecewise
from calibration.compensation.methods.method import Asked
from calibration.compensation.model import Compensation
from calibration.compensation.record import CIRCUIT, STRUCTURE, Blocks
from cosim.rate.metrics import PER_HOUR

SEGMENTS: Final = 16
"""Of 5 °C, as the soaks fitted lie, where structure and board are compared."""
SOURCE_SEGMENTS: Final = 4
"""Of 20 °C, as Liu et al. 2014 measure."""


class Cycle(NamedTuple):
    """A record of the FMU to be made."""

    profile: Profile
    seed: int
    closed: bool


CYCLES: Final = {
    "ramps": (Cycle(RAMP_FIT, 3, False), Cycle(RAMP_TEST, 4, False)),
    "soaks": (Cycle(SOAK_FIT, 1, False), Cycle(SOAK_TEST, 2, False)),
    "closed": (Cycle(RAMP_FIT, 3, True), Cycle(RAMP_TEST, 4, True)),
}


def run(options: Options) -> Report:
    """Makes the records on the envelope FMU and measures."""
    cycles = [cycle for pair in CYCLES.values() for cycle in pair]
    with get_context("spawn").Pool(options.jobs) as pool:
        made = iter(pool.map(_make, cycles, chunksize=1))
    records = {name: (blocks_of(next(made)), blocks_of(next(made))) for name in CYCLES}
    tables = [
        Table(
            "Held-out cycles of the device rate-mode on the envelope FMU", _methods(records, options.seeds_or(SEEDS))
        ),
        Table("Why the sensor belongs on the structure (16 segments, quasi-static cycles)", _causes()),
    ]
    notes = [
        "Coefficients are (max - min)/range over the test, of means over passes of at most 2 °C. Possible: the same if "
        "nothing but the noise of the record were left. A spline may come out above: that is its scatter.",
        "Soaks are fitted every 5 °C upwards and tested 2.5 °C off, downwards. Ramps are fitted at ±1 and ±3 °C/min "
        "from -22 to 62 °C and tested at ±5 °C/min, inputs clamped to what was fitted.",
        "Measured devices: piecewise 4.5 and 3.2 times, with the board's sensor 2.0 and 2.1 (Liu et al. 2014); network "
        "about 20 (CN 105222765).",
    ]
    if WARMUP.is_file():
        tables.append(warmup_table())
        notes += NOTES
    return Report("compensation", "Temperature compensation", tables, notes)


def _make(cycle: Cycle) -> pl.DataFrame:
    return fmu_record(cycle.profile, cycle.seed, cycle.closed)


def _methods(records: dict[str, tuple[Blocks, Blocks]], seeds: int) -> list[Row]:
    fitted, test = records["soaks"]
    soaks = fitted.part(fitted.settled), test.part(test.settled)
    chosen = choose(soaks[0], Asked("piecewise", sensor=STRUCTURE, sampling_time=SAMPLING_TIME)).best[0]
    rows = _pair("piecewise, structure sensor, settled", soaks, chosen.fit(soaks[0]), 20.0, 20.0)
    as_source = piecewise.fit(soaks[0], SAMPLING_TIME, STRUCTURE, SOURCE_SEGMENTS)
    rows += _pair("the same in four segments, as Liu et al. 2014", soaks, as_source)
    for name in ("ramps", "closed"):
        pair = records[name]
        loop = "closed loop" if name == "closed" else "open loop"
        rows += _network(pair, loop, seeds)
        for family, limit in (("spline", None), ("piecewise", None)):
            start = process_time()
            best = choose(pair[0], Asked(family, sampling_time=SAMPLING_TIME)).best[0].fit(pair[0])
            note = f"{best.note}; chosen in {process_time() - start:.1f} s of CPU time"
            rows += _pair(f"{best.method}, ±5 °C/min, {loop}", pair, best, limit, limit, note)
    return rows


def _network(pair: tuple[Blocks, Blocks], loop: str, seeds: int) -> list[Row]:
    """Median and worst over the seeds; neurons chosen on the fitted cycles."""
    start = process_time()
    asked = [Asked("network", seed=seed, sampling_time=SAMPLING_TIME) for seed in range(1, seeds + 1)]
    found = [choose(pair[0], one).best[0].fit(pair[0]) for one in asked]
    each = (process_time() - start) / seeds
    factors = np.array([_factors(judge(pair[1], c, "clamp"))[1] for c in found])
    sizes = ", ".join(c.note.partition(",")[0].removesuffix(" neurons") for c in found)
    note = f"neurons by inner validation: {sizes}; {each:.0f} s of CPU time a choice and training"
    possible = float(factors[:, 1].mean())
    return [
        row(f"network, {loop}, bias, {what} of {seeds} seeds", "×", {"factor": value, "possible": possible}, note=note)
        for what, value in (("median", float(np.median(factors[:, 0]))), ("worst", float(factors[:, 0].min())))
    ]


def _pair(
    what: str,
    pair: tuple[Blocks, Blocks],
    compensation: Compensation,
    scale_limit: float | None = None,
    bias_limit: float | None = None,
    note: str = "",
) -> list[Row]:
    scale, bias = _factors(judge(pair[1], compensation, "clamp"))
    names = (("scale factor", scale, scale_limit), ("bias", bias, bias_limit))
    return [
        row(f"{what}: {name}", "×", {"factor": found[0], "possible": found[1]}, limit=limit, at_least=True,
            judged=("factor",), note=note or compensation.note)
        for name, found, limit in names
    ]  # fmt: skip


def _factors(result: Result) -> tuple[tuple[float, float], tuple[float, float]]:
    """Factor and possible factor of scale factor and bias."""
    if result.scale is None:
        raise ValueError("the test never turns")
    scale, bias = change(result.scale), change(result.bias)
    return (scale.factor, scale.possible), (bias.factor, bias.possible)


def _causes() -> list[Row]:
    """What is left on structure and board: alike where nothing parts the two temperatures."""
    soaks, ramps = (SOAK_FIT, SOAK_TEST), (RAMP_FIT, RAMP_TEST)
    rows: list[Row] = []
    cases: list[tuple[str, Callable[..., pl.DataFrame], tuple[Profile, Profile], bool, tuple[float, float]]] = [
        ("soaks, no gradient", quasi_static, soaks, True, (0.0, 0.0)),
        ("soaks, self-heating 2 K fitted, 3 K tested", quasi_static, soaks, True, (2.0, 3.0)),
        ("ramps, lags 240 s and 120 s", quasi_static, ramps, False, (0.0, 0.0)),
        ("ramps, equal lags of 240 s", partial(quasi_static, lags=(240.0, 240.0)), ramps, False, (0.0, 0.0)),
    ]
    for what, make, profiles, settled, heating in cases:
        blocks = [blocks_of(make(p, seed, heating=h)) for p, seed, h in zip(profiles, (1, 2), heating, strict=True)]
        fitted, test = (b.part(b.settled) if settled else b for b in blocks)
        left = {}
        for name, sensor in (("structure", STRUCTURE), ("board", CIRCUIT)):
            found = judge(test, piecewise.fit(fitted, SAMPLING_TIME, sensor, SEGMENTS), "clamp")
            if found.scale is not None:
                left[name] = (1e6 * change(found.scale).after, PER_HOUR * change(found.bias).after)
        for k, unit in enumerate(("ppm/°C", "°/h/°C")):
            rows.append(row(what, unit, {name: values[k] for name, values in left.items()}))
    rows.append(row("Liu et al. 2014", "ppm/°C", {"structure": 69.67, "board": 154.97}))
    rows.append(row("Liu et al. 2014", "°/h/°C", {"structure": 115.25, "board": 172.67}))
    return rows
