"""`gyrotwin match`: rate mode with the bias voltage tuned until both modes are at one frequency."""

from math import radians
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final, NamedTuple

import typer
from rich.console import Console

from gyro_model.device import Device, load_device
from gyrotwin.tasks.rate import STEP_PERIOD, choose, courses_of_request, design_of
from gyrotwin.tasks.rate import Request as RateRequest

if TYPE_CHECKING:
    from calibration.matching import Asking

console = Console()

HOLDING: Final = {True: 60.0, False: 600.0}
"""Seconds of a run that nothing limits, in the closed and in the open loop: a passive block takes tens of them."""


class Request(NamedTuple):
    """A run as typed; None where the program decides. dither [°/s], block [s], highest_bias [V]; the rest as in
    ``rate``."""

    device: str | Device
    method: str = "active"
    design: str | Device | None = None
    settings: tuple[str, ...] = ()
    scenario: str | None = None
    temperature: str | None = None
    rate_step: float | None = None
    rate_period: float = STEP_PERIOD
    duration: float | None = None
    plant: str = "envelope"
    dither: float | None = None
    block: float | None = None
    highest_bias: float | None = None
    seed: int = 1


def match(
    device: Annotated[str, typer.Argument(help="Packaged device by name, or a device file: what the plant is.")],
    method: Annotated[str, typer.Option(help="passive (thermal noise), active (a small dither), hybrid.")] = "active",
    design: Annotated[
        str | None,
        typer.Option(help="All that tuner, loops and calibration know: a device file or name; default: the device."),
    ] = None,
    settings: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="NAME=VALUE", help="Set a device parameter, or rate_mode.NAME (SI); repeatable."),
    ] = None,
    scenario: Annotated[
        str | None, typer.Option(help="Scenario file: rate, temperature, a_x, a_y; v_bias: the first bias.")
    ] = None,
    temperature: Annotated[
        str | None,
        typer.Option(
            metavar="T | START,STOP,RAMP | FILE",
            help="Ambient: °C, a ramp in °C, °C, °C/min, or a table with t and temperature_deg_c; default: 25.",
        ),
    ] = None,
    rate_step: Annotated[float | None, typer.Option(help="Rest, +R, rest, -R again and again, deg/s.")] = None,
    rate_period: Annotated[float, typer.Option(help="Seconds of one such round.")] = STEP_PERIOD,
    duration: Annotated[
        float | None, typer.Option(help="Seconds; default: what the courses last, else 60, passive 600.")
    ] = None,
    plant: Annotated[str, typer.Option(help="envelope (hours), or full.")] = "envelope",
    dither: Annotated[
        float | None, typer.Option(help="Virtual rate of the tone, deg/s; default: a tenth of full scale.")
    ] = None,
    block: Annotated[float | None, typer.Option(help="Seconds of a measurement; default: by the method.")] = None,
    highest_bias: Annotated[
        float | None, typer.Option(help="Largest bias, V; default: twice that at which the design matches.")
    ] = None,
    seed: Annotated[int, typer.Option(help="Seed of the noises.")] = 1,
    out: Annotated[Path, typer.Option(help="Folder for match.json, trace.parquet, report.html.")] = Path(
        "results/match"
    ),
    force: Annotated[bool, typer.Option("--force", help="Write even into a folder that holds other files.")] = False,
) -> None:
    """Run rate mode with the bias tuned to matched modes, from noise or by a small dither."""
    from calibration.matching import match as tuned
    from gyrotwin.match_report import results
    from gyrotwin.match_result import MatchResult
    from gyrotwin.output import check_writable
    from gyrotwin.progress import shown_progress

    request = Request(
        device, method, design, tuple(settings or ()), scenario, temperature, rate_step, rate_period, duration, plant,
        dither, block, highest_bias, seed,
    )  # fmt: skip
    asking = prepare(request)
    check_writable(out, force=force)
    with shown_progress(console, f"mode matching, {asking.run.duration:g} s") as progress:
        result = MatchResult(asking, tuned(asking, progress))
    result.save(out, force=force)
    console.print(results(result.summary))
    console.print(f"report: {out / 'report.html'}", soft_wrap=True, highlight=False)


def prepare(request: Request) -> "Asking":
    """The run that ``request`` asks for. Raises InputError, with a remedy, for whatever is wrong in it."""
    from calibration.matching import Asked, ask, methods
    from gyrotwin.tasks.rate import with_settings

    choose("--plant", request.plant, ("envelope", "full"))
    choose("--method", request.method, tuple(methods()))
    device = request.device if isinstance(request.device, Device) else load_device(request.device)
    device = with_settings(device, request.settings)
    courses, length = courses_of_request(
        RateRequest(
            scenario=request.scenario, temperature=request.temperature, rate_step=request.rate_step,
            rate_period=request.rate_period,
        )
    )  # fmt: skip
    limited = request.scenario is not None or any(course.length < float("inf") for course in courses.values())
    duration = length if limited else HOLDING[methods()[request.method].closed]
    return ask(
        device,
        design_of(request.design or device, device),
        request.method,
        courses,
        duration if request.duration is None else request.duration,
        seed=int(device.model.parameter("seed").check(request.seed)),
        envelope=request.plant == "envelope",
        highest_bias=request.highest_bias,
        asked=Asked(None if request.dither is None else radians(request.dither), request.block),
    )
