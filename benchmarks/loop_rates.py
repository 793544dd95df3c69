"""The flag under rates that nobody has chosen: random courses of the rate, six pairs of device and design.

``python -m benchmarks.loop_rates --replay SEED`` repeats one run and says what came of it.
"""

import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Annotated, Final, NamedTuple

import numpy as np
import typer
from rich.console import Console

from benchmarks import loop_drift
from benchmarks.loop_devices import RATE, random_device, sample_rate, why
from benchmarks.loop_runs import finite, in_processes
from benchmarks.report import RESULTS, Options, Report, Row, Table, row, show, spread, write
from cosim.master import simulate
from cosim.run import Run
from cosim.scenarios import Course, Sine, ramps, steps
from gyro_model.device import load_device
from gyrotwin.tasks.run import Request, prepare

RUNS: Final = 300
FIRST: Final = 30301
"""The first seed, of which the last state of the loop has seen none."""
DURATION: Final = 0.8
AMPLITUDE: Final = (0.01, 10.0)
"""Of a rate [rad/s]."""
FREQUENCY: Final = (0.5, 50.0)
"""Of its sines [Hz]."""
SLOPE: Final = 50.0
"""At most [rad/s2]."""
BAND: Final = 40
"""Sines that noise in a band is made of."""
PAIRS: Final = (
    ("reference", "plain"),
    ("reference", "lab"),
    ("reference_as_built", "lab"),
    ("tuning_fork_as_built", "lab"),
    ("whole_angle_as_built", "lab"),
    ("random", "lab"),
)
"""Device and design; the random one is that of benchmarks.loop_devices with the run's seed for its number."""

Courses = tuple[Course, ...]
Kind = Callable[[np.random.Generator], Courses]


class Outcome(NamedTuple):
    """What came of a run: ``seed`` repeats it; ``values`` by COLUMNS, infinite or NaN where there is none; ``why``:
    what the loop says, or the error."""

    seed: int
    pair: str
    kind: str
    values: dict[str, float]
    why: str = ""
    aborted: bool = False


COLUMNS: Final = ("valid from [s]", "valid share", "windows", "lies", "worst lie [°/s]", "squared [1]")
"""Windows: those of a tenth of a second that are valid throughout; squared: mean of their squared drift over its
prediction."""


def _size(rng: np.random.Generator) -> float:
    return float(np.exp(rng.uniform(*np.log(AMPLITUDE))))


def _sines(rng: np.random.Generator) -> Courses:
    def one() -> Sine:
        return Sine(_size(rng), float(np.exp(rng.uniform(*np.log(FREQUENCY)))), float(rng.uniform(0, 360)))

    return tuple(one() for _ in range(rng.integers(1, 5)))


def _slopes(rng: np.random.Generator) -> Courses:
    times = _knots(rng)
    slopes = rng.uniform(-1, 1, len(times) - 1) * min(SLOPE, 20 * _size(rng))
    values = np.cumsum(np.concatenate(([0.0], slopes * np.diff(times))))
    return (ramps(times, np.clip(values, -AMPLITUDE[1], AMPLITUDE[1])),)


def _steps(rng: np.random.Generator) -> Courses:
    times = _knots(rng)
    return (steps(times, rng.uniform(-1, 1, len(times)) * _size(rng)),)


def _noise(rng: np.random.Generator) -> Courses:
    """Noise in a band, as sines of equal size on average."""
    bottom, top = np.log(FREQUENCY)
    low, high = np.sort(np.exp(rng.uniform(bottom, top, 2)))
    size = _size(rng) / np.sqrt(BAND)
    return tuple(
        Sine(float(size * rng.rayleigh()), float(rng.uniform(low, high)), float(rng.uniform(0, 360)))
        for _ in range(BAND)
    )


def _knots(rng: np.random.Generator) -> np.ndarray:
    """From 0 s on, one to twenty within the run, wherever chance puts them [s]."""
    return np.concatenate(([0.0], np.sort(rng.uniform(0.0, DURATION, rng.integers(1, 21)))))


SINGLE: Final[Mapping[str, Kind]] = {"sines": _sines, "slopes": _slopes, "steps": _steps, "noise": _noise}
KINDS: Final = (*SINGLE, "mixture")


def courses(kind: str, rng: np.random.Generator) -> Courses:
    """A course of the rate [rad/s]; a mixture is the sum of two of the other kinds."""
    chosen = rng.choice(list(SINGLE), 2, replace=False) if kind == "mixture" else (kind,)
    return tuple(course for name in chosen for course in SINGLE[name](rng))


def the_run(seed: int) -> tuple[str, str, Run]:
    """Pair, kind and run of a seed: pairs and kinds follow each other."""
    (name, design), kind = PAIRS[seed % len(PAIRS)], KINDS[seed // len(PAIRS) % len(KINDS)]
    device = random_device(seed) if name == "random" else load_device(name)
    hertz = sample_rate(device) if name == "random" else RATE
    run = prepare(Request("rest", device, design, sample_rate=hertz, seed=seed, duration=DURATION))
    rate = courses(kind, np.random.default_rng([seed, 17]))
    return f"{name}, {design}", kind, replace(run, scenario=replace(run.scenario, courses={"omega_z": rate}))


def measure(seed: int) -> Outcome:
    """One run by its seed. Whatever goes wrong is an outcome."""
    pair, kind = ", ".join(PAIRS[seed % len(PAIRS)]), KINDS[seed // len(PAIRS) % len(KINDS)]
    try:
        pair, kind, run = the_run(seed)
        result = simulate(run)
    except Exception as error:
        none = dict(zip(COLUMNS, (np.inf, 0.0, 0.0, 0.0, np.nan, np.nan), strict=True))
        return Outcome(seed, pair, kind, none, f"{type(error).__name__}: {error}", aborted=True)
    windows = loop_drift.valid_windows(result)
    worst = loop_drift.lie(result)
    values = (
        np.inf if result.converged_at is None else result.converged_at,
        result.validity.share,
        len(windows),
        0.0 if worst is None else worst.windows,
        np.nan if worst is None else worst.drift,
        np.mean([(w.drift / w.sigma) ** 2 for w in windows]) if windows else np.nan,
    )
    return Outcome(seed, pair, kind, dict(zip(COLUMNS, map(float, values), strict=True)), why(result))


def summary_rows(groups: Mapping[str, Sequence[Outcome]]) -> list[Row]:
    """What each group of runs comes to."""
    rows = []
    for name, outcomes in groups.items():
        at = spread(o.values["valid from [s]"] for o in outcomes)
        total = {c: sum(o.values[c] for o in outcomes) for c in ("windows", "lies")}
        weighted = [o.values["windows"] * o.values["squared [1]"] for o in outcomes if o.values["windows"]]
        values = {
            "runs with a lie": float(sum(o.values["lies"] > 0 for o in outcomes)),
            "windows that lie": total["lies"],
            "of valid windows": total["windows"],
            "squared drift over prediction": sum(weighted) / total["windows"] if total["windows"] else np.nan,
            "valid from, median [s]": at["median"],
            "never valid": float(sum(not np.isfinite(o.values["valid from [s]"]) for o in outcomes)),
            "aborted": float(sum(o.aborted for o in outcomes)),
        }
        judged = ("runs with a lie", "aborted")
        rows.append(row(name, "", values, limit=0.0, judged=judged, note=f"of {len(outcomes)} runs"))
    return rows


def make_report(seeds: Sequence[int], jobs: int) -> Report:
    """Runs all seeds."""
    outcomes = in_processes(measure, list(seeds), jobs)
    by_pair = {", ".join(pair): [o for o in outcomes if o.pair == ", ".join(pair)] for pair in PAIRS}
    by_kind = {kind: [o for o in outcomes if o.kind == kind] for kind in KINDS}
    lies = [o for o in outcomes if o.values["lies"] or o.aborted]
    tables = [
        Table("all runs", summary_rows({"all": outcomes})),
        Table("by device and design", summary_rows({n: g for n, g in by_pair.items() if g})),
        Table("by kind of rate", summary_rows({n: g for n, g in by_kind.items() if g})),
    ]
    if lies:
        told = [row(f"seed {o.seed}", "", o.values, note=f"{o.pair}, {o.kind}. {o.why}") for o in lies]
        tables.append(Table("runs with a lie, or that abort", told))
    notes = [
        f"Runs of {DURATION:g} s. Rates: amplitudes of {AMPLITUDE[0]:g} to {AMPLITUDE[1]:g} rad/s, evenly in their "
        f"logarithm; one to four sines, or noise in a band, of {FREQUENCY[0]:g} to {FREQUENCY[1]:g} Hz; one to twenty "
        f"steps, or slopes of at most {SLOPE:g} rad/s²; mixtures are sums of two of these.",
        f"A lie: the angle was valid throughout a window of {loop_drift.WINDOW:g} s and drifted by more than "
        f"{loop_drift.LIE:g} °/s and {loop_drift.LIE_SIGMAS:g} times the prediction.",
        "One run again: `python -m benchmarks.loop_rates --replay SEED`.",
    ]
    data = {"runs": [o._asdict() | {"values": finite(o.values)} for o in outcomes]}
    return Report("loop_rates", f"{len(outcomes)} runs under random rates", tables, notes, data)


def run(options: Options) -> Report:
    """300 runs."""
    return make_report(range(FIRST, FIRST + options.seeds_or(RUNS)), options.jobs)


def main(
    runs: Annotated[int, typer.Option(min=1, help="Runs, one a seed.")] = RUNS,
    first: Annotated[int, typer.Option(min=0, help="The first seed.")] = FIRST,
    jobs: Annotated[int, typer.Option(min=1, help="Processes at a time.")] = 2,
    replay: Annotated[int | None, typer.Option(help="Repeat the run of this seed.")] = None,
) -> None:
    """Run the loop under random rates; or repeat one of the runs."""
    console = Console(width=None if sys.stdout.isatty() else 200)
    if replay is not None:
        outcome = measure(replay)
        shown = row(f"seed {outcome.seed}", "", outcome.values, note=f"{outcome.pair}, {outcome.kind}. {outcome.why}")
        show(Report("replay", "", [Table("one run", [shown])], []), console)
        return
    report = make_report(range(first, first + runs), jobs)
    show(report, console)
    write(report, f"python -m benchmarks.loop_rates --runs {runs} --first {first}")
    console.print(f"written: {RESULTS / report.name}.json, .md", soft_wrap=True, highlight=False)


if __name__ == "__main__":
    typer.run(main)
