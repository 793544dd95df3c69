"""The loop on devices that nobody has measured: `--design lab` on random devices as built.

``python -m benchmarks.loop_devices --replay DEVICE SEED`` repeats one run and says what came of it.
"""

import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Annotated, Final, NamedTuple

import numpy as np
import typer
from rich.console import Console

from benchmarks import loop_drift
from benchmarks.loop_runs import finite, in_processes
from benchmarks.report import RESULTS, Options, Report, Row, Table, row, show, spread, write
from cosim.design import TABLES, packaged_designs
from cosim.master import simulate
from cosim.recorder import Result
from cosim.run import Run
from gyro_model.device import Device, interval, read_toml, write_device
from gyrotwin.tasks.run import Request, execute, prepare

DEVICES: Final = 30
SEEDS: Final = 3
FREQUENCY: Final = (1.5e3, 15e3)
"""Of x alone [Hz]."""
QUALITY: Final = (300.0, 1e5)
MASS: Final = (1e-9, 1e-6)
"""[kg]."""
SPLIT: Final = 0.2
"""Largest difference of the frequencies of y and x alone, relative."""
CROSS_STIFFNESS: Final = 0.1
CROSS_DAMPING: Final = 0.2
"""Largest cross terms, relative to kxx and to the geometric mean of the dampings."""
DAMPING_RATIO: Final = 0.2
"""Largest difference of the two dampings per frequency, relative."""
GAIN: Final = 1e6
"""Of the pickoff [V/m]."""
WHITE: Final = 20e-12
"""White noise of a sample [m rms]."""
START: Final = 1e-6
"""Start on x [m], and the amplitude that is held."""
SAMPLES_A_PERIOD: Final = 25
RATE: Final = 200e3
"""Least sample rate [Hz]."""
RATE_STEP: Final = 50e3
"""Sample rates are multiples of this [Hz]."""
VALID_WITHIN: Final = 0.5
ANGLE: Final = 0.15
"""Targets: time at which the angle is valid [s], its rms error [deg]."""
DRIFT: Final = 0.15
OVER_BOUND: Final = 2.0
"""The drift may be the larger of DRIFT [deg/s] and this times the run's own bound."""
SHARE: Final = 0.95
CONVERTER: Final = {"bits": 12, "jitter": 10e-9}
"""The poor converter: bits over twice the start's amplitude to either side, jitter [s rms]."""

COLUMNS: Final = (
    *("valid from [s]", "valid share", "angle C [°]", "drift [°/s]", "between edges [°/s]"),
    *("bound [°/s]", "predicted [°/s]", "lies", "worst lie [°/s]"),
)


class Outcome(NamedTuple):
    """What came of a run: ``device`` and ``seed`` repeat it; ``values`` by COLUMNS, infinite or NaN where there is
    none; ``why``: what the loop says, or the error."""

    device: int
    seed: int
    what: str
    values: dict[str, float]
    why: str = ""
    aborted: bool = False


def meets(values: Mapping[str, float]) -> bool:
    """Whether a run's ``values`` by COLUMNS meet the targets."""
    limit = max(DRIFT, OVER_BOUND * np.nan_to_num(values["bound [°/s]"]))
    in_time = values["valid from [s]"] <= VALID_WITHIN
    return in_time and values["angle C [°]"] <= ANGLE and abs(values["drift [°/s]"]) <= limit


def scaled_intervals(device: Device, name: str = "lab") -> dict[str, tuple[float, float]]:
    """The intervals of a packaged design as they hold for ``device``."""
    data = read_toml(packaged_designs()[name], TABLES)
    values, reference = device.all_parameters, data["reference"]
    result = {}
    for parameter, pair in data["intervals"].items():
        powers = data["scaling"].get(parameter, {})
        factor = float(np.prod([(values[key] / reference[key]) ** power for key, power in powers.items()]))
        low, high = interval(parameter, pair)
        result[parameter] = (factor * low, factor * high)
    return result


def mechanics(rng: np.random.Generator) -> Device:
    """A random device without effects; its noise is white."""
    frequency, quality, mass = (float(np.exp(rng.uniform(*np.log(limits)))) for limits in (FREQUENCY, QUALITY, MASS))
    w = 2 * np.pi * frequency
    split, cross, cross_damping = rng.uniform(-1, 1, 3) * (SPLIT, CROSS_STIFFNESS, CROSS_DAMPING)
    kxx, dxx = mass * w**2, mass * w / quality
    dyy = dxx * (1 + split) * (1 + rng.uniform(-DAMPING_RATIO, DAMPING_RATIO))
    parameters = {
        "m": mass,
        "kxx": kxx,
        "kyy": kxx * (1 + split) ** 2,
        "kxy": cross * kxx,
        "dxx": dxx,
        "dyy": dyy,
        "dxy": cross_damping * np.sqrt(dxx * dyy),
        "sense_gain_x": GAIN,
        "sense_gain_y": GAIN,
        "sense_noise": WHITE * GAIN,
        "x_start": START,
    }
    return Device("random", {name: float(value) for name, value in parameters.items()})


def sample_rate(device: Device) -> float:
    """Enough samples a period of the highest mode [Hz]."""
    rate = SAMPLES_A_PERIOD * highest_mode(device)
    return max(RATE, float(np.ceil(rate / RATE_STEP)) * RATE_STEP)


def highest_mode(device: Device) -> float:
    """Frequency of the higher mode [Hz]."""
    p = device.all_parameters
    squares = np.linalg.eigvalsh([[p["kxx"], p["kxy"]], [p["kxy"], p["kyy"]]]) / p["m"]
    return float(np.sqrt(squares[-1]) / (2 * np.pi))


def further_noise(rng: np.random.Generator, device: Device) -> dict[str, float]:
    """Rounding, jitter and flicker, together at most as strong as the white noise, in a random mixture."""
    p = device.all_parameters
    total = rng.uniform(0, p["sense_noise"])
    parts = rng.normal(size=3)
    rounding, jitter, flicker = total * np.abs(parts) / np.linalg.norm(parts)
    slope = GAIN * START * np.sqrt(p["kxx"] / p["m"]) / np.sqrt(2)
    return {
        "adc_lsb": float(rounding * np.sqrt(12)),
        "sampling_jitter": float(jitter / slope),
        # Its density a²/f reaches from 1 Hz to half the sample rate.
        "flicker_noise": float(flicker / np.sqrt(np.log(0.5 * sample_rate(device)))),
    }


def poor_converter() -> dict[str, float]:
    """Rounding and jitter of a converter below what such a device deserves."""
    return {
        "adc_lsb": 4 * START * GAIN / 2 ** CONVERTER["bits"],
        "sampling_jitter": CONVERTER["jitter"],
        "flicker_noise": 0.0,
    }


def random_device(number: int, poor: bool = False) -> Device:
    """The device of that number as built: every effect of `lab` at a size from its interval, noise."""
    rng = np.random.default_rng([number, 11])
    device = mechanics(rng)
    effects = {name: float(rng.uniform(*pair)) for name, pair in scaled_intervals(device).items()}
    noise = further_noise(rng, device)
    return device.with_parameters(effects | (poor_converter() if poor else noise))


def the_run(number: int, seed: int, poor: bool = False, design: str = "lab") -> Run:
    """The run of one device and one seed: 1 s of `constant`, as from the command line."""
    return run_of(random_device(number, poor), seed, design)


def run_of(device: Device, seed: int, design: str = "lab") -> Run:
    """The same of any device."""
    with tempfile.TemporaryDirectory(prefix="gyrotwin-") as folder:
        path = Path(folder) / "device.toml"
        write_device(device, path)
        return prepare(Request("constant", str(path), design, sample_rate=sample_rate(device), seed=seed))


def measure(what: tuple[int, int], made: Callable[[int], Device] = random_device) -> Outcome:
    """One run by the numbers of device and seed. Whatever goes wrong is an outcome. made: the device of a number."""
    number, seed = what
    label = f"{number} {seed}"
    try:
        run = run_of(made(number), seed)
        label = describe(run.device)
        result = simulate(run)
        return Outcome(number, seed, label, reduced(run, result), why(result))
    except Exception as error:
        empty = dict.fromkeys(COLUMNS, np.inf) | {
            "valid share": 0.0,
            "lies": 0.0,
            "bound [°/s]": np.nan,
            "worst lie [°/s]": np.nan,
        }
        return Outcome(number, seed, label, empty, f"{type(error).__name__}: {error}", aborted=True)


def reduced(run: Run, result: Result) -> dict[str, float]:
    """The numbers of a run, by COLUMNS."""
    worst = loop_drift.lie(result)
    values = (
        np.inf if result.converged_at is None else result.converged_at,
        result.validity.share,
        loop_drift.angle_rms(result, run),
        loop_drift.drift(result),
        loop_drift.drift_between_edges(result, run),
        loop_drift.bound(result),
        loop_drift.predicted(result),
        0.0 if worst is None else float(worst.windows),
        np.nan if worst is None else worst.drift,
    )
    return dict(zip(COLUMNS, map(float, values), strict=True))


def describe(device: Device) -> str:
    """Mechanics in a line."""
    p = device.all_parameters
    w = np.sqrt(p["kxx"] / p["m"])
    split, cross = np.sqrt(p["kyy"] / p["kxx"]) - 1, p["kxy"] / p["kxx"]
    return (
        f"{w / 2e3 / np.pi:.2f} kHz, Q {p['m'] * w / p['dxx']:.0f}, {p['m']:.1e} kg, "
        f"split {split:+.1%}, kxy {cross:+.1%}, {sample_rate(device) / 1e3:.0f} kHz"
    )


def why(result: Result) -> str:
    """Why the angle was withdrawn, the last two times, and why it is not valid at the end."""
    validity = result.validity
    said = [f"{reason} (at {t:.3f} s)" for t, reason in validity.withdrawn[-2:]]
    more = len(validity.withdrawn) - len(said)
    said += [f"and {more} more"] if more > 0 else []
    if not validity.now:
        said.insert(0, f"at the end: {validity.reason}")
    return "; ".join(said)


def run_rows(outcomes: Sequence[Outcome], all_of_them: bool = True) -> list[Row]:
    """A row for each run."""
    return [
        row(
            f"device {o.device} seed {o.seed}",
            "",
            o.values,
            note=f"{'' if meets(o.values) else 'MISSED: '}{o.what}. {o.why}",
        )
        for o in outcomes
        if all_of_them or not meets(o.values)
    ]


def summary_rows(outcomes: Sequence[Outcome]) -> list[Row]:
    """Shares of the runs, and the spread of what they reach."""
    count = len(outcomes)

    def share(what: str, number: int, limit: float | None = None) -> Row:
        return row(what, "1", {"share": number / count}, limit=limit, at_least=True, note=f"{number} of {count}")

    def number(what: str, numbers: int, limit: float = 0.0) -> Row:
        return row(what, "runs", {"share": float(numbers)}, limit=limit, note=f"of {count}")

    ratios = [
        (o.values["drift [°/s]"] / o.values["predicted [°/s]"]) ** 2 for o in outcomes if o.values["valid share"] > 0
    ]
    ratios = [ratio for ratio in ratios if np.isfinite(ratio)]
    middle = float(np.median(ratios)) if ratios else np.nan
    return [
        share("valid in time, angle and drift within their limits", sum(meets(o.values) for o in outcomes), SHARE),
        share(f"valid within {VALID_WITHIN:g} s", sum(o.values[COLUMNS[0]] <= VALID_WITHIN for o in outcomes)),
        share("valid at some time", sum(np.isfinite(o.values[COLUMNS[0]]) for o in outcomes)),
        number("runs with a lie", sum(o.values["lies"] > 0 for o in outcomes)),
        number("runs that abort", sum(o.aborted for o in outcomes)),
        row(
            "squared drift over squared prediction",
            "1",
            {"share": float(np.mean(ratios)) if ratios else np.nan},
            note=f"mean of {len(ratios)} runs, wanted 0.5 to 1.5; median {middle:.2g} (of a normal error 0.45)",
        ),
    ]


def spread_rows(outcomes: Sequence[Outcome]) -> list[Row]:
    """Median, 95 % and worst of the numbers that should be small."""
    names = (("valid from [s]", "s"), ("angle C [°]", "°"), ("drift [°/s]", "°/s"), ("between edges [°/s]", "°/s"))
    rows = [row(name.split(" [")[0], unit, spread(o.values[name] for o in outcomes)) for name, unit in names]
    ratio = [abs(o.values["drift [°/s]"]) / o.values["bound [°/s]"] for o in outcomes]
    return [*rows, row("drift over its bound", "1", spread(x for x in ratio if not np.isnan(x)))]


def make_report(devices: Sequence[int], seeds: Sequence[int], jobs: int, poor: bool = False) -> Report:
    """Runs all devices with all seeds."""
    what = [(device, seed) for device in devices for seed in seeds]
    outcomes = in_processes(partial(measure, made=partial(random_device, poor=poor)), what, jobs)
    name = "loop_devices_poor" if poor else "loop_devices"
    converter = f", {CONVERTER['bits']:g} bit and {1e9 * CONVERTER['jitter']:g} ns of jitter" if poor else ""
    title = f"`--design lab` on {len(devices)} random devices as built, {len(seeds)} seeds each{converter}"
    tables = [
        Table("all runs", summary_rows(outcomes)),
        Table("spread", spread_rows(outcomes)),
        Table("runs", run_rows(outcomes)),
    ]
    notes = [
        "One run again: `python -m benchmarks.loop_devices --replay DEVICE SEED`" + (" --poor." if poor else "."),
        f"Drift: slope of angle C's error over {loop_drift.SPAN[0]:g}–{loop_drift.SPAN[1]:g} s; "
        "bound and prediction: rms over the same time. "
        f"The drift may be the larger of {DRIFT:g} °/s and {OVER_BOUND:g} times the run's bound.",
        "Between edges: the same slope with a step left free at each edge of the rate.",
        f"A lie: the angle was valid throughout a window of {loop_drift.WINDOW:g} s and drifted by more than "
        f"{loop_drift.LIE:g} °/s and {loop_drift.LIE_SIGMAS:g} times the prediction.",
    ]
    data = {"runs": [o._asdict() | {"values": finite(o.values)} for o in outcomes]}
    return Report(name, title, tables, notes, data)


def run(options: Options) -> Report:
    """30 devices, 3 seeds."""
    return make_report(range(1, DEVICES + 1), range(1, options.seeds_or(SEEDS) + 1), options.jobs)


def main(
    devices: Annotated[int, typer.Option(min=1, help="Random devices.")] = DEVICES,
    seeds: Annotated[int, typer.Option(min=1, help="Runs of each.")] = SEEDS,
    jobs: Annotated[int, typer.Option(min=1, help="Processes at a time.")] = 2,
    first: Annotated[int, typer.Option(min=0, help="Number of the first device.")] = 1,
    poor: Annotated[bool, typer.Option("--poor", help="With 12 bit and 10 ns of jitter.")] = False,
    replay: Annotated[tuple[int, int] | None, typer.Option(help="Repeat one run: DEVICE SEED.")] = None,
    out: Annotated[Path | None, typer.Option(help="Folder for the files of a replayed run, with its device.")] = None,
) -> None:
    """Run `--design lab` on random devices; or repeat one of the runs."""
    console = Console(width=None if sys.stdout.isatty() else 250)
    if replay is not None:
        outcome = measure(replay, partial(random_device, poor=poor))
        show(Report("replay", "", [Table(outcome.what, run_rows([outcome]))], []), console)
        parameters = random_device(replay[0], poor).parameters
        console.print(", ".join(f"{name} = {value:.4g}" for name, value in parameters.items()), highlight=False)
        if out is not None:
            out.mkdir(parents=True, exist_ok=True)
            write_device(random_device(replay[0], poor), out / "as_built.toml")
            execute(the_run(*replay, poor), out)
        return
    report = make_report(range(first, first + devices), range(1, seeds + 1), jobs, poor)
    show(report, console)
    options = f"--devices {devices} --seeds {seeds} --first {first}" + (" --poor" if poor else "")
    write(report, f"python -m benchmarks.loop_devices {options}")
    console.print(f"written: {RESULTS / report.name}.json, .md", soft_wrap=True, highlight=False)


if __name__ == "__main__":
    typer.run(main)
