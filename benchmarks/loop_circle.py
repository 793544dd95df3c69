"""Measure, diagnose, run: a device with three effects that nobody knows is tried, the trial is diagnosed, and what the
diagnosis wrote is the loop's design on the same device."""

import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

import gyrotwin as gt
from benchmarks import loop_effects
from benchmarks.loop_runs import finite, in_processes, numbers
from benchmarks.report import Options, Report, Row, Table, row, spread
from cosim.master import simulate
from gyrotwin.tasks.run import Request, prepare

DEVICES: Final = 20
HIDDEN: Final = 3
NEAR: Final = 1.5
"""Target: the angle's error over that on the ideal device, medians."""
SHOWN: Final = (
    ("angle C, rms [°]", "angle_C", NEAR),
    ("angle A, rms [°]", "angle_A", NEAR),
    ("drift of C over 0.5–1 s [°/s]", "late_drift", NEAR),
    ("seven parameters within 1 % [s]", "within", None),
    ("valid from [s]", "converged_at", None),
)
"""Title, number and target of each table."""


class Outcome(NamedTuple):
    """``hidden``: true parameters by name; ``named``: effects by id, with the verdict; ``values``, ``ideal``: of the
    run with what the diagnosis wrote, and of the ideal device under its plain design."""

    seed: int
    hidden: dict[str, float]
    named: tuple[str, ...]
    verdict: str
    values: dict[str, float]
    ideal: dict[str, float]
    why: str = ""


def hidden(seed: int) -> dict[str, float]:
    """Sizes of three effects, drawn by seed from their intervals; none that needs a temperature or a bias to show."""
    cases = [case for case in loop_effects.cases() if not case.courses]
    rng = np.random.default_rng([seed, 23])
    chosen = rng.choice(len(cases), HIDDEN, replace=False)
    return {k: v for i in chosen for k, v in loop_effects.sizes(cases[i], seed).items()}


def measure(seed: int) -> Outcome:
    """One circle. Whatever goes wrong is an outcome."""
    true = hidden(seed)
    ideal = _run(seed, {})
    try:
        with tempfile.TemporaryDirectory(prefix="gyrotwin-") as folder:
            trial, out = Path(folder) / "trial", Path(folder) / "results"
            gt.simulate_dataset(trial, hidden=true, seed=seed)
            found = gt.diagnose(trial, jobs=1, seed=seed)
            found.save(out)
            named = tuple(finding.id for finding in found.effects)
            values = _run(seed, true, out / "device.toml")
    except Exception as error:
        return Outcome(seed, true, (), "", {}, ideal, f"{type(error).__name__}: {error}")
    return Outcome(seed, true, named, found.verdict, values, ideal)


def _run(seed: int, true: Mapping[str, float], design: Path | None = None) -> dict[str, float]:
    """The numbers of `constant` on the reference device with some parameters."""
    settings = tuple(f"{name}={value!r}" for name, value in true.items())
    run = prepare(Request("constant", design=None if design is None else str(design), settings=settings, seed=seed))
    return numbers(run, simulate(run))


def rows(outcomes: Sequence[Outcome], name: str, limit: float | None) -> list[Row]:
    """A number with the diagnosis for a design, on the ideal device, and the ratio of the spreads."""
    found = spread(o.values.get(name, np.inf) for o in outcomes)
    ideal = spread(o.ideal[name] for o in outcomes)
    ratio = {column: found[column] / ideal[column] for column in found}
    return [
        row("measured, diagnosed, run", "", found),
        row("ideal device, plain design", "", ideal),
        row("ratio", "1", ratio, limit=limit, judged=("median",)),
    ]


def make_report(seeds: Sequence[int], jobs: int) -> Report:
    """Runs all circles."""
    outcomes = in_processes(measure, list(seeds), jobs)
    tables = [Table(title, rows(outcomes, name, limit)) for title, name, limit in SHOWN]
    flags = {
        "never valid": float(sum(not np.isfinite(o.values.get("converged_at", np.inf)) for o in outcomes)),
        "runs with a lie": float(sum(o.values.get("lies", 0.0) > 0 for o in outcomes)),
        "failed": float(sum(not o.values for o in outcomes)),
    }
    judged = ("runs with a lie", "failed")
    tables.append(Table("the flag", [row("runs", "", flags, limit=0.0, judged=judged, note=f"of {len(outcomes)}")]))
    notes = [
        f"Reference device with {HIDDEN} effects of `loop_effects` at sizes drawn from their intervals; three runs of "
        "8000 samples are diagnosed. The plant of the loop's run has the true effects, and its design is the "
        "device.toml that the diagnosis wrote. Ideal: no effect, default design, same seeds.",
    ]
    notes += [
        f"Seed {o.seed}: hidden {', '.join(f'{k} {v:.3g}' for k, v in o.hidden.items())}; "
        f"{o.verdict or o.why}: {', '.join(o.named) or 'none'}; angle C {o.values.get('angle_C', np.nan):.3g}°."
        for o in outcomes
    ]
    data = {"runs": [o._asdict() | {"values": finite(o.values), "ideal": finite(o.ideal)} for o in outcomes]}
    return Report("loop_circle", f"Measure, diagnose, run: {len(outcomes)} devices", tables, notes, data)


def run(options: Options) -> Report:
    """20 devices."""
    return make_report(range(1, options.seeds_or(DEVICES) + 1), options.jobs)
