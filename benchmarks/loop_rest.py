"""At rest, all constants constant: the bias over its bound, and the Allan deviation."""

import sys
from collections.abc import Sequence
from functools import partial
from typing import Annotated, Final, NamedTuple

import numpy as np
import typer
from numpy.typing import NDArray
from rich.console import Console

from benchmarks.closed_loop import SteppedLoop, stepped_plant
from benchmarks.loop_drift import slope
from benchmarks.loop_runs import in_processes
from benchmarks.report import RESULTS, Options, Report, Row, Table, row, show, spread, write
from calibration.analysis.allan import OCTAVE, angle_allan
from cosim.angle import Block, UnitC
from cosim.bound import GrowingBound, Motion, at_the_truth
from cosim.compiled_loop import parts_of
from cosim.core.library import CONTROL_NAMES
from cosim.layout import OMEGA_Z
from cosim.master import BLOCK_DURATION
from cosim.monitor import Monitor, Orbit
from cosim.run import Run
from gyro_model.errors import InputError
from gyrotwin.tasks.run import Request, prepare

Floats = NDArray[np.float64]

DURATION: Final = 100.0
WINDOW: Final = 2.0
"""The bias is the slope of the angle over this [s]."""
KEPT: Final = 1e-3
"""The angle is kept as means over this [s]; blocks are whole multiples of it."""
SEEDS: Final = 3
DESIGNS: Final = ("plain", "lab")
OVER_BOUND: Final = 2.0
DEG_PER_HOUR: Final = np.rad2deg(1) * 3600


class Outcome(NamedTuple):
    """Per window: begin [s], bias, its bound and its prediction [rad/s]; ``allan``: tau [s] and deviation with its 95 %
    interval [rad/s]; ``valid``: share of the run; ``why`` it failed or was withdrawn."""

    design: str
    seed: int
    begin: Floats
    bias: Floats
    bound: Floats
    predicted: Floats
    allan: tuple[Floats, Floats, Floats, Floats] | None
    valid: float
    why: str = ""


def the_run(design: str, seed: int, duration: float) -> Run:
    """`rest` with the reference device."""
    return prepare(Request("rest", design=design, seed=seed, duration=duration))


def measure(what: tuple[str, int], duration: float) -> Outcome:
    """One run by design and seed; the bound is taken along it."""
    design, seed = what
    none = np.empty(0)
    try:
        run = the_run(design, seed, duration)
        with stepped_plant(run) as plant:
            return _measured(design, seed, run, SteppedLoop(run, plant))
    except Exception as error:
        return Outcome(design, seed, none, none, none, none, None, 0.0, f"{type(error).__name__}: {error}")


def _measured(design: str, seed: int, run: Run, loop: SteppedLoop) -> Outcome:
    every = max(round(KEPT * run.sample_rate), 1)
    size = max(round(BLOCK_DURATION / KEPT), 1) * every
    monitor = Monitor(run.observer, run.design, loop.loop.lib, loop.loop.observer, run.period, run.monitor_settings())
    growing = GrowingBound(at_the_truth(run.design, run.device.all_parameters), run.period)
    unit = UnitC()
    angles, bounds, sigmas, flags = [], [], [], []
    for first in range(0, run.samples - size + 1, size):
        rows, _ = loop.step(size)
        held = run.scenario.inputs(first, size, run.period)
        estimate, control, plant = parts_of(rows)
        growing.extend(Motion(plant[:, 2:], control[:, :2], held[:, 0], held[:, 1:], run.period))
        angle = _angle(unit, run, first, estimate, control)
        angles.append(angle.reshape(-1, every).mean(axis=1))
        phi = unit.zero - run.design.all_values["angular_gain"] * float(angle[-1])
        measured = np.array([*held[-1, 1:], held[-1, 1], held[-1, 1]])
        t = (first + size - 1) * run.period
        orbit = Orbit(phi, float(control[-1, CONTROL_NAMES.index("omega_squared")]))
        verdict = monitor.judge(t, estimate[-1].copy(), loop.loop.deviation(), measured, orbit)
        growing.stiffness = orbit.omega_squared * run.device.all_parameters["m"]
        bounds.append(growing.deviations()[2])
        sigmas.append(verdict.drift_sigma)
        flags.append(verdict.valid)
    angle = np.concatenate(angles)
    block = size * run.period
    windows = [
        slice(round(b / block), round((b + WINDOW) / block)) for b in np.arange(0, run.duration - WINDOW + 1e-9, WINDOW)
    ]
    begin = np.array([w.start * block for w in windows])
    time = every * run.period * np.arange(len(angle))
    rows_of = [(time >= b - 1e-9) & (time < b + WINDOW - 1e-9) for b in begin]
    bias = np.array([slope(time[rows], angle[rows]) for rows in rows_of])
    bound, predicted = (np.array([np.sqrt(np.mean(np.square(v[w]))) for w in windows]) for v in (bounds, sigmas))
    allan = None
    valid_from = int(np.argmax(flags)) * block
    if any(flags):
        found = angle_allan(angle[time >= valid_from], every * run.period)
        allan = (found.tau, found.deviation, found.low, found.high)
    why = "; ".join(f"{reason} (at {t:.3f} s)" for t, reason in monitor.withdrawn[-2:])
    return Outcome(design, seed, begin, bias, bound, predicted, allan, float(np.mean(flags)), why)


def _angle(unit: UnitC, run: Run, first: int, estimate: Floats, control: Floats) -> Floats:
    """Angle C [rad]; zero from the first sample on, the rate is none."""
    count = len(control)
    columns = {name: np.ascontiguousarray(control[:, i]) for i, name in enumerate(CONTROL_NAMES)}
    forced, near = (
        np.stack([columns[f"{what}_{axis}"] for axis in ("x", "x_dot", "y", "y_dot")]) for what in ("forced", "near")
    )
    t: Floats = np.arange(first, first + count, dtype=np.float64) * np.float64(run.period)
    gain, always = run.design.all_values["angular_gain"], np.ones(count, dtype=bool)
    states = np.ascontiguousarray(estimate[:, :4].T)
    turn = gain * estimate[:, OMEGA_Z] + columns["own_rate"]
    block = Block(t, states, forced, near, columns["omega_squared"], always, gain, columns["turned"], turn)
    return unit.process(block)[0]


def make_report(designs: Sequence[str], seeds: Sequence[int], duration: float, jobs: int) -> Report:
    """Runs the designs with all seeds."""
    what = [(design, seed) for design in designs for seed in seeds]
    outcomes = in_processes(partial(measure, duration=duration), what, jobs)
    tables = [
        Table(f"{o.design}, seed {o.seed}: bias in windows of {WINDOW:g} s", _window_rows(o))
        for o in outcomes
        if len(o.bias)
    ]
    tables += [
        Table(f"{o.design}, seed {o.seed}: Allan deviation", _allan_rows(o)) for o in outcomes if o.allan is not None
    ]
    summary = [_summary(design, [o for o in outcomes if o.design == design]) for design in designs]
    tables.insert(0, Table("bias over its bound, all windows but the first", summary))
    notes = [
        f"`rest` for {duration:g} s, reference device, nothing changes. "
        "Bias: slope of angle C; bound and prediction: rms over the window.",
        *(f"{o.design}, seed {o.seed}: {o.why}" for o in outcomes if o.why),
    ]
    return Report("loop_rest", f"At rest for {duration:g} s", tables, notes)


def _summary(design: str, outcomes: Sequence[Outcome]) -> Row:
    ratio = np.concatenate([(o.bias / o.bound)[1:] for o in outcomes] or [np.empty(0)])
    rms = float(np.sqrt(np.mean(ratio**2))) if len(ratio) else np.nan
    valid = ", ".join(f"{o.valid:.0%}" for o in outcomes)
    note = f"the angle was valid for {valid} of the time"
    return row(design, "1", {"rms": rms, **spread(ratio)}, limit=OVER_BOUND, judged=("rms",), note=note)


def _window_rows(outcome: Outcome) -> list[Row]:
    rows = []
    for begin, *values in zip(outcome.begin, outcome.bias, outcome.bound, outcome.predicted, strict=True):
        bias, bound, predicted = (DEG_PER_HOUR * v for v in values)
        columns = {"bias": bias, "bound": bound, "predicted": predicted, "bias over bound": abs(bias) / bound}
        rows.append(row(f"from {begin:g} s", "°/h", columns))
    return rows


def _allan_rows(outcome: Outcome) -> list[Row]:
    assert outcome.allan is not None
    octaves = [0]
    for i, tau in enumerate(outcome.allan[0]):
        if tau >= OCTAVE * outcome.allan[0][octaves[-1]]:
            octaves.append(i)
    return [
        row(
            f"τ = {tau:.3g} s",
            "°/h",
            {"deviation": DEG_PER_HOUR * d, "low": DEG_PER_HOUR * low, "high": DEG_PER_HOUR * high},
        )
        for tau, d, low, high in zip(*(part[octaves] for part in outcome.allan), strict=True)
    ]


def run(options: Options) -> Report:
    """100 s, both designs, 3 seeds."""
    return make_report(DESIGNS, range(1, options.seeds_or(SEEDS) + 1), DURATION, options.jobs)


def main(
    duration: Annotated[float, typer.Option(min=2 * WINDOW, help="Of each run [s].")] = DURATION,
    seeds: Annotated[int, typer.Option(min=1, help="Runs of each design.")] = SEEDS,
    jobs: Annotated[int, typer.Option(min=1, help="Processes at a time.")] = 2,
    design: Annotated[
        list[str] | None, typer.Option(help=f"Of {', '.join(DESIGNS)}, or a file; both by default.")
    ] = None,
) -> None:
    """Let the loop rest, and write what it makes of it."""
    console = Console(width=None if sys.stdout.isatty() else 160)
    try:
        report = make_report(design or DESIGNS, range(1, seeds + 1), duration, jobs)
    except InputError as error:
        console.print(f"benchmarks: {error}", markup=False, highlight=False, style="red")
        sys.exit(2)
    show(report, console)
    write(report, f"python -m benchmarks.loop_rest --duration {duration:g} --seeds {seeds}")
    console.print(f"written: {RESULTS / report.name}.json, .md", soft_wrap=True, highlight=False)


if __name__ == "__main__":
    typer.run(main)
