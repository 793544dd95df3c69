"""Each effect alone, at a size that the loop does not know but has an interval for: `--design lab`, with an interval
more for effects that `lab` leaves out."""

import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Annotated, Final, NamedTuple

import numpy as np
import typer
from rich.console import Console

from benchmarks import loop_drift
from benchmarks.loop_devices import scaled_intervals
from benchmarks.loop_runs import finite, in_processes
from benchmarks.report import RESULTS, Options, Report, Row, Table, row, show, spread, write
from cosim.design import packaged_designs
from cosim.master import simulate
from cosim.run import Run
from cosim.scenarios import Constant, Course, Sine
from gyro_model.device import load_device
from gyro_model.errors import InputError, nearest
from gyro_model.model import load_model
from gyrotwin.tasks.run import Request, prepare

SEEDS: Final = 40
ANGLE, DRIFT, OVER_BOUND, PARAMETER = 0.1, 0.1, 2.0, 1.5
"""Targets: angle C rms [deg] and drift [deg/s] in the median, drift over its bound at 95 %, error of a parameter over
its bound, rms over the seeds."""

Interval = tuple[float, float]
WARM: Final = {"temperature": (Constant(298.15), Sine(10.0, 2.0))}
"""10 K up and down, twice a second: a constant temperature would not tell its coefficient from the parameter."""
BIAS: Final = {"v_bias": (Constant(5.0), Sine(1.0, 3.0))}
SHAKE: Final = {"a_x": (Sine(20.0, 40.0),), "a_y": (Sine(20.0, 55.0),)}


@dataclass(frozen=True)
class Case:
    """What is put into the plant: ``intervals`` by FMU name, those of `lab` where there are none; ``courses``: what a
    scenario needs besides the rate to show it."""

    name: str
    intervals: Mapping[str, Interval] = field(default_factory=dict)
    courses: Mapping[str, tuple[Course, ...]] = field(default_factory=dict)


OWN: Final = (
    Case("quadratic_stiffness", {"k2_x": (-2e5, 2e5), "k2_y": (-2e5, 2e5)}),
    Case("nonlinear_damping", {"d2_x": (0.0, 1e6), "d2_y": (0.0, 1e6)}),
    Case("parasitic_mode", {"parasitic_coupling": (0.0, 2.0)}),
    Case("actuator_nonlinearity", {"actuator_a2": (-100.0, 100.0), "actuator_a3": (-1e6, 1e6)}),
    Case("electrostatic_softening", {"softening": (0.0, 0.1)}, BIAS),
    Case("linear_acceleration", {"acceleration_gain_x": (-1.5, 0.0), "acceleration_gain_y": (-1.5, 0.0)}, SHAKE),
    Case("frame_rotation", {"frame_rotation": (0.0, 1.0)}),
    Case("thermal_stiffness", {"tck": (-1e-4, 1e-4), "tck_split": (-2e-5, 2e-5)}, WARM),
    Case("thermal_damping", {"tcd": (-5e-3, 5e-3)}, WARM),
    Case("thermal_gain", {"tcg": (-5e-4, 5e-4)}, WARM),
    Case("thermal_phase", {"tcp": (-1e-8, 1e-8)}, WARM),
)
"""Effects that `lab` has no interval for, at sizes of one to some percent of what they act on at 1 um."""


class Outcome(NamedTuple):
    """Numbers of a run by name, infinite where there are none; ``errors``: of each parameter over its bound."""

    case: str
    seed: int
    values: dict[str, float]
    errors: dict[str, float]
    why: str = ""


def cases() -> list[Case]:
    """The effects of `lab`, then the others."""
    parameters = load_model()
    reference = load_device("reference").with_parameters({"x_start": 1e-6})
    lab: dict[str, dict[str, Interval]] = {}
    for name, pair in scaled_intervals(reference).items():
        owner = next(e.id for e in parameters.effects if any(q.name == name for q in e.parameters))
        lab.setdefault(owner, {})[name] = pair
    # A pair that is unequal shows only where there is a gap, and a lag that follows temperature where there is a lag.
    hosts = {"pickoff_mismatch": lab["pickoff_nonlinearity"], "thermal_phase": lab["amplifier_bandwidth"]}
    # Samples tell the sum of delay and lag, the priors share it out. Alone, either leaves the other at an end of its.
    late = Case("delay and lag together", {**lab["actuator_delay"], **lab["amplifier_bandwidth"]})
    own = [*(Case(name, intervals) for name, intervals in lab.items()), late, *OWN]
    return [replace(case, intervals={**hosts.get(case.name, {}), **case.intervals}) for case in own]


def find_case(name: str) -> Case:
    """A case by name. Raises InputError for an unknown one."""
    known = {case.name: case for case in cases()}
    if name not in known:
        raise InputError(f"effect {name!r} is not measured{nearest(name, known)}")
    return known[name]


def sizes(case: Case, seed: int) -> dict[str, float]:
    """What the plant has: drawn evenly from the intervals."""
    rng = np.random.default_rng([seed, 7, *case.name.encode()])
    return {name: float(rng.uniform(*pair)) for name, pair in case.intervals.items()}


def the_run(case: Case, seed: int) -> Run:
    """The run of one effect and one seed: the reference device, `constant`."""
    settings = tuple(f"{name}={value!r}" for name, value in sizes(case, seed).items())
    with tempfile.TemporaryDirectory(prefix="gyrotwin-") as folder:
        design = Path(folder) / "design.toml"
        design.write_text(_design(case), encoding="utf-8")
        run = prepare(Request("constant", design=str(design), settings=settings, seed=seed))
    return replace(run, scenario=replace(run.scenario, courses={**run.scenario.courses, **case.courses}))


def _design(case: Case) -> str:
    """The text of `lab` with the intervals that it leaves out."""
    text = packaged_designs()["lab"].read_text(encoding="utf-8")
    known = scaled_intervals(load_device("reference").with_parameters({"x_start": 1e-6}))
    more = [f"{name} = [{low!r}, {high!r}]" for name, (low, high) in case.intervals.items() if name not in known]
    return text.replace("[intervals]\n", "\n".join(["[intervals]", *more, ""]), 1)


def measure(what: tuple[str, int]) -> Outcome:
    """One run by effect and seed. Whatever goes wrong is an outcome."""
    name, seed = what
    try:
        case = find_case(name)
        run = the_run(case, seed)
        result = simulate(run)
    except Exception as error:
        return Outcome(name, seed, {}, {}, f"{type(error).__name__}: {error}")
    trace = result.trace
    worst = loop_drift.lie(result)
    values = {
        "angle": loop_drift.angle_rms(result, run),
        "drift": loop_drift.drift(result),
        "between": loop_drift.drift_between_edges(result, run),
        "bound": loop_drift.bound(result),
        "predicted": loop_drift.predicted(result),
        "lies": 0.0 if worst is None else float(worst.windows),
        "converged_at": np.inf if result.converged_at is None else result.converged_at,
        "share": result.validity.share,
    }
    errors = {}
    for parameter in case.intervals:
        bound = np.nan if result.bounds is None else float(result.bounds.effects[parameter][-1])
        errors[parameter] = (float(trace[f"est_{parameter}"][-1]) - run.device.all_parameters[parameter]) / bound
    said = result.validity.reason or "; ".join(
        f"{reason} (at {t:.3f} s)" for t, reason in result.validity.withdrawn[-1:]
    )
    return Outcome(name, seed, values, errors, said)


def make_report(names: Sequence[str], seeds: Sequence[int], jobs: int) -> Report:
    """Runs the effects of these names with all seeds."""
    outcomes = in_processes(measure, [(name, seed) for name in names for seed in seeds], jobs)
    groups = {name: [o for o in outcomes if o.case == name] for name in names}
    every = partial(_spread_rows, groups)
    tables = [
        Table("angle C, rms [°]", every("angle", ANGLE, ("median",))),
        Table("angle C, slope over 0.5–1 s [°/s]", every("drift", DRIFT, ("median",))),
        Table("that slope over its bound", every("over bound", OVER_BOUND, ("median", "95 %"))),
        Table("that slope with a step left free at each edge of the rate [°/s]", every("between", DRIFT, ("median",))),
        Table("error of a parameter at the end over its posterior bound", _parameter_rows(groups)),
        Table("valid from [s]", every("converged_at", None, ())),
        Table("the flag", _flag_rows(groups)),
    ]
    notes = [
        "Reference device, `constant`, 1 s; the plant has the one effect, "
        "the design is `lab` with the effect's interval.",
        "Intervals: " + "; ".join(f"{n} {_told(find_case(n))}" for n in names) + ".",
    ]
    notes += [f"{o.case}, seed {o.seed}: {o.why}" for o in outcomes if o.why]
    data = {"runs": [o._asdict() | {"values": finite(o.values), "errors": finite(o.errors)} for o in outcomes]}
    return Report("loop_effects", f"Each effect alone, {len(seeds)} seeds", tables, notes, data)


def _told(case: Case) -> str:
    return ", ".join(f"{name} [{low:g}, {high:g}]" for name, (low, high) in case.intervals.items())


def _spread_rows(
    groups: Mapping[str, Sequence[Outcome]], what: str, limit: float | None, judged: tuple[str, ...]
) -> list[Row]:
    rows = []
    for name, outcomes in groups.items():
        if what == "over bound":
            numbers = [abs(o.values.get("drift", np.inf)) / o.values.get("bound", np.nan) for o in outcomes]
        else:
            numbers = [o.values.get(what, np.inf) for o in outcomes]
        rows.append(row(name, "", spread(numbers), limit=limit, judged=judged))
    return rows


def _parameter_rows(groups: Mapping[str, Sequence[Outcome]]) -> list[Row]:
    rows = []
    for name, outcomes in groups.items():
        for parameter in find_case(name).intervals:
            errors = np.array([o.errors.get(parameter, np.inf) for o in outcomes])
            values = {"rms": float(np.sqrt(np.mean(errors**2))), **spread(errors)}
            rows.append(row(f"{name}: {parameter}", "1", values, limit=PARAMETER, judged=("rms",)))
    return rows


def _flag_rows(groups: Mapping[str, Sequence[Outcome]]) -> list[Row]:
    rows = []
    for name, outcomes in groups.items():
        ratio = np.array([(o.values.get("drift", np.nan) / o.values.get("predicted", np.nan)) ** 2 for o in outcomes])
        ratio = ratio[np.isfinite(ratio)]
        values = {
            "never valid": float(sum(not np.isfinite(o.values.get("converged_at", np.inf)) for o in outcomes)),
            "runs with a lie": float(sum(o.values.get("lies", 0.0) > 0 for o in outcomes)),
            "failed": float(sum(not o.values for o in outcomes)),
            "squared drift over prediction": float(np.mean(ratio)) if len(ratio) else np.nan,
        }
        rows.append(
            row(name, "runs", values, limit=0.0, judged=("runs with a lie", "failed"), note=f"of {len(outcomes)}")
        )
    return rows


def run(options: Options) -> Report:
    """All effects, 40 seeds."""
    return make_report([case.name for case in cases()], range(1, options.seeds_or(SEEDS) + 1), options.jobs)


def main(
    effects: Annotated[list[str] | None, typer.Argument(help="By id; all by default.")] = None,
    seeds: Annotated[int, typer.Option(min=1, help="Runs of each.")] = SEEDS,
    first: Annotated[int, typer.Option(min=1, help="The first seed.")] = 1,
    jobs: Annotated[int, typer.Option(min=1, help="Processes at a time.")] = 2,
) -> None:
    """Measure some effects; results are written where all are measured."""
    names = effects or [case.name for case in cases()]
    console = Console(width=None if sys.stdout.isatty() else 200)
    try:
        report = make_report(names, range(first, first + seeds), jobs)
    except InputError as error:
        console.print(f"benchmarks: {error}", markup=False, highlight=False, style="red")
        sys.exit(2)
    show(report, console)
    if not effects:
        write(report, f"python -m benchmarks.loop_effects --seeds {seeds} --first {first}")
        console.print(f"written: {RESULTS / report.name}.json, .md", soft_wrap=True, highlight=False)


if __name__ == "__main__":
    typer.run(main)
