"""``python -m benchmarks [NAME ...] [--seeds N] [--jobs N]``."""

import importlib
import sys
from typing import Annotated

import typer
from rich.console import Console

from benchmarks.report import RESULTS, Options, Report, show, write
from gyro_model.errors import InputError, nearest

NAMES = (
    "plant_call",
    "plant_cost",
    "envelope",
    "startup",
    "work_precision",
    "angle_lag",
    "loop_measures",
    "loop_effects",
    "loop_devices",
    "loop_delays",
    "loop_periods",
    "loop_rates",
    "loop_rest",
    "loop_pace",
    "loop_circle",
    "mode_split",
    "matching",
    "rate_mode",
    "compensation",
    "compensation_memory",
    "compensation_as_built",
    "structures",
    "drives",
    "drives_damped",
    "drives_rubbing",
    "drives_sticking",
    "rubbing",
    "resting",
    "bent",
    "sweeps",
    "bowed",
    "diagnosis_speed",
    "next_experiment",
    "silverbox",
    "sensor",
    "published",
)
"""The benchmarks, one module each with ``run(options) -> Report``."""


def command_of(name: str, options: Options) -> str:
    """The command that runs one benchmark."""
    seeds = "" if options.seeds is None else f" --seeds {options.seeds}"
    return f"python -m benchmarks {name}{seeds} --jobs {options.jobs}"


def run(name: str, options: Options) -> Report:
    """Runs one benchmark by name. Raises InputError for an unknown name."""
    if name not in NAMES:
        raise InputError(f"benchmark {name!r} is not known{nearest(name, NAMES)} (benchmarks: {', '.join(NAMES)})")
    report: Report = importlib.import_module(f"benchmarks.{name}").run(options)
    return report


def main(
    names: Annotated[list[str] | None, typer.Argument(help=f"Of {', '.join(NAMES)}; all by default.")] = None,
    seeds: Annotated[
        int | None, typer.Option(min=1, help="Seeds of every measure of the loop; each has its own number.")
    ] = None,
    jobs: Annotated[int, typer.Option(min=1, help="Processes at a time; timings always use one.")] = 2,
) -> None:
    """Measure what is promised; print tables and write benchmarks/results/NAME.json and NAME.md."""
    # A file or pipe has no width of its own.
    console = Console(width=None if sys.stdout.isatty() else 200)
    options = Options(seeds, jobs)
    for name in names or NAMES:
        try:
            report = run(name, options)
        except InputError as error:
            console.print(f"benchmarks: {error}", markup=False, highlight=False, style="red")
            sys.exit(2)
        show(report, console)
        write(report, command_of(name, options))
        console.print(f"written: {RESULTS / name}.json, .md", soft_wrap=True, highlight=False)


if __name__ == "__main__":
    typer.run(main)
