"""A delay of whole sample periods without a lag, beside a feedthrough: where its fit has a kink, and delay, lag and
feedthrough may be shared out otherwise."""

from collections.abc import Sequence
from functools import partial
from typing import Final, NamedTuple

import numpy as np

from benchmarks import loop_drift
from benchmarks.loop_devices import ANGLE, DRIFT, OVER_BOUND, SHARE, VALID_WITHIN, meets
from benchmarks.loop_runs import finite, in_processes
from benchmarks.report import Options, Report, Row, Table, row, spread
from cosim.master import simulate
from gyrotwin.tasks.run import Request, prepare

SEEDS: Final = 4
FIRST: Final = 880071
"""The first seed, of which the last state of the loop has seen none."""
DELAYS: Final = ((200e3, 5e-6), (400e3, 2.5e-6), (400e3, 5e-6))
"""Sample rate [Hz] and delay [s], one or two periods."""
FEEDTHROUGHS: Final = (6.0, -6.0, 10.0, -10.0)
"""[V/N]."""
FOUND: Final = 1e-9
"""How far a delay that was found may be off [s]."""


class Outcome(NamedTuple):
    """Numbers of a run by name, infinite where there are none; ``why``: the error that ended it."""

    hertz: float
    delay: float
    feedthrough: float
    seed: int
    values: dict[str, float]
    why: str = ""


def measure(what: tuple[float, float, float, int]) -> Outcome:
    """One run by sample rate, delay, feedthrough and seed. Whatever goes wrong is an outcome."""
    hertz, delay, feedthrough, seed = what
    settings = (f"actuator_delay={delay}", f"feedthrough={feedthrough}")
    try:
        run = prepare(Request("constant", design="lab", settings=settings, sample_rate=hertz, seed=seed))
        result = simulate(run)
    except Exception as error:
        return Outcome(*what, {}, f"{type(error).__name__}: {error}")
    worst = loop_drift.lie(result)
    values = {
        "valid from [s]": np.inf if result.converged_at is None else result.converged_at,
        "angle C [°]": loop_drift.angle_rms(result, run),
        "drift [°/s]": abs(loop_drift.drift(result)),
        "bound [°/s]": loop_drift.bound(result),
        "windows that lie": 0.0 if worst is None else float(worst.windows),
        "delay off [s]": abs(float(result.trace["est_actuator_delay"][-1]) - delay),
    }
    return Outcome(*what, values)


def _is_right(o: Outcome) -> bool:
    return bool(o.values) and meets(o.values)


def _shares(outcomes: Sequence[Outcome]) -> list[Row]:
    count = len(outcomes)
    right = sum(map(_is_right, outcomes)) / count
    found = sum(o.values.get("delay off [s]", np.inf) <= FOUND for o in outcomes) / count
    lies = float(sum(o.values.get("windows that lie", 0.0) > 0 for o in outcomes))
    return [
        Row(
            "valid in time, angle and drift within their limits",
            "1",
            {"share": right},
            SHARE,
            at_least=True,
            note=f"of {count}",
        ),
        Row("delay found within a nanosecond", "1", {"share": found}),
        Row("runs with a lie", "runs", {"share": lies}, 0.0),
        Row("runs that abort", "runs", {"share": float(sum(not o.values for o in outcomes))}, 0.0),
    ]


def make_report(seeds: Sequence[int], jobs: int) -> Report:
    """Runs all delays and feedthroughs with all seeds."""
    items = [(*pair, feedthrough, seed) for pair in DELAYS for feedthrough in FEEDTHROUGHS for seed in seeds]
    outcomes = in_processes(measure, items, jobs)
    names = ("valid from [s]", "angle C [°]", "drift [°/s]")
    spreads = [row(n, "", spread(o.values.get(n, np.inf) for o in outcomes)) for n in names]
    label = partial("{0.delay:.3g} s at {0.hertz:g} Hz, {0.feedthrough:+g} V/N, seed {0.seed}".format)
    wrong = [row(label(o), "", o.values, note=o.why) for o in outcomes if not _is_right(o)]
    tables = [Table("all runs", _shares(outcomes)), Table("spread", spreads)]
    if wrong:
        tables.append(Table("runs that are not right", wrong))
    notes = [
        "Reference device, `constant`, 1 s, design `lab`; a command that the processor sends on at the next sample, or "
        "at the one after.",
        f"Right: valid within {VALID_WITHIN:g} s, angle within {ANGLE:g}° rms, drift over 0.5 to 1 s of no more than "
        f"the larger of {DRIFT:g} °/s and {OVER_BOUND:g} times the bound.",
    ]
    data = {"runs": [o._asdict() | {"values": finite(o.values)} for o in outcomes]}
    title = f"Delays of whole sample periods, {len(seeds)} seeds from {seeds[0]}"
    return Report("loop_delays", title, tables, notes, data)


def run(options: Options) -> Report:
    """Four seeds: 48 runs."""
    return make_report(range(FIRST, FIRST + options.seeds_or(SEEDS)), options.jobs)
