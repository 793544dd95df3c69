"""`gyrotwin rate`: rate mode, from the command line to summary.json, trace.parquet, report.html."""

from dataclasses import replace
from math import pi, radians
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final, NamedTuple

import typer
from rich.console import Console

from gyro_model.device import Device, load_device
from gyro_model.errors import InputError, nearest
from gyrotwin.interrupt import Interrupted

if TYPE_CHECKING:
    from cosim.rate.courses import Course
    from cosim.rate.kept import Keeper
    from cosim.rate.master import Result
    from cosim.rate.run import RateRun
    from gyro_model.progress import Progress

console = Console()

REST_DURATION: Final = 20.0
"""Seconds of a run that nothing limits."""
STEP_PERIOD: Final = 8.0
"""Period of a rate step [s]: a quarter is several settling times of a device with a sense Q below some thousand."""
FULL_AT_MOST: Final = 60.0
"""Longer runs go on the envelope where nothing is said [s]: the full plant takes a quarter of real time and more."""
OUTPUT_RATES: Final = {"full": 100.0, "envelope": 10.0}
"""Rows a second where nothing is said [Hz]."""

SENSE_RECORD: Final = "sense.parquet"
"""The record that `gyrotwin split` reads."""
CHECKPOINT: Final = "rate.checkpoint"


class Request(NamedTuple):
    """A run as typed; None where the program decides. ``settings`` are texts ``name=value``."""

    device: str | Device = "rate-mode"
    settings: tuple[str, ...] = ()
    rate_profile: Path | None = None
    rate_column: str | None = None
    rate_unit: str | None = None
    rate_step: float | None = None
    rate_period: float = STEP_PERIOD
    temperature: str | None = None
    sense: str = "open"
    plant: str | None = None
    duration: float | None = None
    sample_rate: float | None = None
    output_rate: float | None = None
    seed: int = 1
    sense_record: float | None = None
    design: str | Device | None = None
    scenario: str | None = None
    split_estimate: float | None = None


def rate(
    device: Annotated[str, typer.Option(help="Packaged device by name, or a device file.")] = "rate-mode",
    design: Annotated[
        str | None,
        typer.Option(help="All that loops and calibration know: a device file or name; default: the device itself."),
    ] = None,
    settings: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="NAME=VALUE", help="Set a device parameter, or rate_mode.NAME (SI); repeatable."),
    ] = None,
    rate_profile: Annotated[Path | None, typer.Option(help="CSV file (also .csv.gz) with a measured rate.")] = None,
    rate_column: Annotated[
        str | None, typer.Option(help="Its column with the rate; the first column is time in s.")
    ] = None,
    rate_unit: Annotated[
        str | None, typer.Option(help="Unit of that column, deg/s or rad/s; default: its heading's.")
    ] = None,
    rate_step: Annotated[float | None, typer.Option(help="Rest, +R, rest, -R again and again, deg/s.")] = None,
    rate_period: Annotated[float, typer.Option(help="Seconds of one such round.")] = STEP_PERIOD,
    temperature: Annotated[
        str | None,
        typer.Option(
            metavar="T | START,STOP,RAMP | FILE",
            help="Ambient: °C, a ramp in °C, °C, °C/min, or a table with t and temperature_deg_c; default: 25.",
        ),
    ] = None,
    scenario: Annotated[
        str | None,
        typer.Option(help="Scenario file: rate, temperature, a_x, a_y, v_bias as courses; or a packaged one by name."),
    ] = None,
    sense: Annotated[str, typer.Option(help="Sense loop: open, or closed (force to rebalance).")] = "open",
    plant: Annotated[
        str | None, typer.Option(help="full or envelope (hours); default: full up to 60 s, else envelope.")
    ] = None,
    duration: Annotated[float | None, typer.Option(help="Seconds; default: what the courses last.")] = None,
    sample_rate: Annotated[
        float | None,
        typer.Option(help="Samples a second of the converter; default: those of the device's sample period."),
    ] = None,
    output_rate: Annotated[
        float | None, typer.Option(help="Rows of the record a second; default 100, envelope 10.")
    ] = None,
    seed: Annotated[int, typer.Option(help="Seed of the noises.")] = 1,
    sense_record: Annotated[
        float | None,
        typer.Option(metavar="HZ", help="Also write sense.parquet for `gyrotwin split`, this many samples a second."),
    ] = None,
    split_estimate: Annotated[
        float | None,
        typer.Option(metavar="SECONDS", help="Frequency split from the noise, block by block of this length."),
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder for summary.json, trace.parquet, report.html.")] = Path(
        "results/rate"
    ),
    force: Annotated[bool, typer.Option("--force", help="Write even into a folder that holds other files.")] = False,
) -> None:
    """Run rate mode: drive loop, sense loop, rate over temperature, noise."""
    from gyrotwin.progress import shown_progress
    from gyrotwin.rate_report import results

    request = Request(
        device, tuple(settings or ()), rate_profile, rate_column, rate_unit, rate_step, rate_period, temperature, sense,
        plant, duration, sample_rate, output_rate, seed, sense_record, design, scenario, split_estimate,
    )  # fmt: skip
    prepared = prepare(request)
    with shown_progress(console, f"rate mode, {prepared.duration:g} s") as progress:
        summary = execute(prepared, out, progress, force=force, block=split_estimate)
    console.print(results(summary))
    if sense_record is not None:
        console.print(f"for gyrotwin split: {out / SENSE_RECORD}", soft_wrap=True, highlight=False)
    console.print(f"report: {out / 'report.html'}", soft_wrap=True, highlight=False)


def prepare(request: Request) -> "RateRun":
    """The run that ``request`` asks for. Raises InputError, with a remedy, for whatever is wrong in it."""
    from cosim.rate.run import RateRun
    from cosim.run import sample_rate_of

    choose("--sense", request.sense, ("open", "closed"))
    courses, length = courses_of_request(request)
    rate, temperature = courses.pop("omega_z"), courses.pop("temperature")
    duration = request.duration if request.duration is not None else length
    plant = request.plant or ("full" if duration <= FULL_AT_MOST else "envelope")
    choose("--plant", plant, tuple(OUTPUT_RATES))
    device = request.device if isinstance(request.device, Device) else load_device(request.device)
    device = with_settings(device, request.settings)
    if request.split_estimate is not None and request.sense == "closed":
        raise InputError("--split-estimate with --sense closed: the force that rebalances shapes the noise; give open")
    run = RateRun(
        device=device,
        rate=rate,
        temperature=temperature,
        closed=request.sense == "closed",
        duration=duration,
        seed=int(device.model.parameter("seed").check(request.seed)),
        sample_rate=sample_rate_of(device, request.sample_rate),
        output_rate=request.output_rate if request.output_rate is not None else OUTPUT_RATES[plant],
        envelope=plant == "envelope",
        sense_rate=request.sense_record,
        design=None if request.design is None else design_of(request.design, device),
        others=courses,
    )
    if request.split_estimate is not None:
        from gyrotwin.split_online import check_blocks, sense_rate_for

        check_blocks(run, request.split_estimate)
        run = run if run.sense_rate is not None else replace(run, sense_rate=sense_rate_for(run))
    if run.sense_rate is not None:
        _check_sense_length(run)
    return run


def _check_sense_length(run: "RateRun") -> None:
    """Raises InputError where a record of the sense voltage would not resolve the hump."""
    from calibration.mode_split.estimate import check_length

    known = run.nominal
    f_x = known.calibration.frequency
    f_y, line_width = f_x + known.pole.imag / (2 * pi), max(-known.pole.real, 1e-9) / pi
    check_length(run.duration, f_x, f_y / line_width)


def courses_of_request(request: Request) -> "tuple[dict[str, Course], float]":
    """The courses of the inputs by name, rate and temperature among them, and how long the run is [s].

    Raises InputError where an input is given twice.
    """
    from cosim.rate import from_scenario
    from cosim.scenarios import load_scenario

    chosen = None if request.scenario is None else load_scenario(request.scenario)
    given = {} if chosen is None else dict(from_scenario.courses_of(chosen))
    typed = {
        "omega_z": ("--rate-step or --rate-profile", request.rate_step or request.rate_profile),
        "temperature": ("--temperature", request.temperature),
    }
    for name, (option, value) in typed.items():
        if name in given and value is not None:
            raise InputError(f"{option} with scenario {request.scenario}, which gives {name}: leave one of them out")
    rate, temperature = _rate(request), _temperature(request.temperature or "25")
    given = {"omega_z": rate, "temperature": temperature, **given}
    return given, _duration(rate, temperature, request) if chosen is None else chosen.duration


def design_of(given: str | Device, device: Device) -> Device:
    """What may be known of ``device``, from a device, its name or its file."""
    from cosim.rate.settings import design_for

    return design_for(given if isinstance(given, Device) else load_device(given), device)


def with_settings(device: Device, settings: tuple[str, ...]) -> Device:
    """``device`` with its parameters and [rate_mode] entries set by texts ``name=value``."""
    from gyrotwin.tasks.run import split_settings

    own, entries = split_settings(settings, "rate_mode")
    device = device.with_parameters(own)
    return replace(device, rate_mode={**device.rate_mode, **entries["rate_mode"]})


def choose(option: str, value: str, valid: tuple[str, ...]) -> None:
    """Raises InputError, with the nearest, where ``value`` is none of ``valid``."""
    if value not in valid:
        raise InputError(f"{option} {value}: use {' or '.join(valid)}{nearest(value, valid)}")


def _rate(request: Request) -> "Course":
    from cosim.rate import courses
    from cosim.rate_profile import read_profile

    if request.rate_profile is not None and request.rate_step is not None:
        raise InputError("--rate-profile and --rate-step: give one of them")
    if request.rate_profile is not None:
        if request.rate_column is None:
            raise InputError("--rate-profile needs --rate-column: name the column that holds the rate")
        return courses.rate_profile(read_profile(request.rate_profile, request.rate_column, request.rate_unit))
    if request.rate_step is not None:
        return courses.rate_step(radians(request.rate_step), request.rate_period)
    return courses.constant(0.0, "at rest")


def _temperature(text: str) -> "Course":
    from cosim.rate import courses

    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        return courses.temperature_table(Path(text))
    if len(numbers) == 1:
        return courses.constant_temperature(numbers[0])
    if len(numbers) != 3:
        raise InputError(f"--temperature {text}: give one temperature, START,STOP,RAMP in °C, °C, °C/min, or a file")
    start, stop, ramp = numbers
    return courses.temperature_ramp(start + courses.ZERO_CELSIUS, stop + courses.ZERO_CELSIUS, ramp)


def _duration(rate: "Course", temperature: "Course", request: Request) -> float:
    """What the courses last: the measured rate first, which can't be stretched."""
    for course in (rate, temperature):
        if course.length < float("inf"):
            return course.length
    return request.rate_period if request.rate_step is not None else REST_DURATION


def execute(
    run: "RateRun", folder: Path, progress: "Progress | None" = None, *, force: bool = False, block: float | None = None
) -> dict[str, Any]:
    """Runs and writes the files into ``folder``, complete or not at all; gives the summary. block: of a split estimate
    [s]. An interrupted run leaves its state there, from which the same run goes on."""
    from cosim.rate.kept import Keeper
    from gyrotwin.notice import LOGGER
    from gyrotwin.output import check_writable
    from gyrotwin.results import RateResult

    check_writable(folder, force=force)
    keeper = Keeper(folder / CHECKPOINT, LOGGER.info)
    try:
        result = RateResult(run, _simulated(run, progress, keeper), block)
        result.save(folder, force=force)
    except Interrupted as stop:
        if keeper.seconds:
            kept = f"{keeper.path} keeps {keeper.seconds:g} of {run.duration:g} s"
            stop.left = f"{kept}: the same command goes on from there"
        raise
    keeper.forget()
    return dict(result.summary)


def _simulated(run: "RateRun", progress: "Progress | None", keeper: "Keeper") -> "Result":
    from cosim.rate.master import simulate

    try:
        return simulate(run, progress, keeper)
    except InputError:
        if keeper.seconds:
            keeper.forget()  # going on would end the same way
        raise
