"""The command `gyrotwin`."""

import signal
import sys
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.table import Table

from gyro_model.build import build_all
from gyro_model.device import design_device, load_device, packaged_devices, write_device
from gyro_model.errors import InputError, nearest
from gyro_model.model import load_model
from gyrotwin.dataset import dataset_app
from gyrotwin.interrupt import Interrupted, interrupt
from gyrotwin.tasks.compensate import compensate
from gyrotwin.tasks.diagnose import diagnose
from gyrotwin.tasks.rate import rate
from gyrotwin.tasks.split import split

app = typer.Typer(
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
    help="A MEMS vibratory gyroscope as an FMU, and the loop that measures its angle.",
)
device_app = typer.Typer(no_args_is_help=True, help="Device files.")
app.add_typer(device_app, name="device")
app.add_typer(dataset_app, name="dataset")
app.command()(split)
app.command()(diagnose)
app.command()(rate)
app.command()(compensate)

console = Console()


@app.command()
def build(
    force: Annotated[bool, typer.Option("--force", help="Build even where the FMUs are up to date.")] = False,
) -> None:
    """Build the FMUs Gyroscope and GyroscopeEnvelope, FMI 2.0 and FMI 3.0, and print where they are."""
    for path in build_all(force=force):
        console.print(str(path), soft_wrap=True, highlight=False)


@app.command()
def run(
    scenario: Annotated[
        str, typer.Argument(help="A scenario by name (`gyrotwin list scenarios`) or a file of your own.")
    ],
    device: Annotated[
        str, typer.Option(help="What the plant is: packaged device by name, or a device file.")
    ] = "reference",
    design: Annotated[
        str | None,
        typer.Option(help="All that the loop may know: plain, lab, or a file, such as the device.toml of a diagnosis."),
    ] = None,
    effects: Annotated[
        list[Path] | None, typer.Option(metavar="DIR", help="Folder of further effect files; repeatable.")
    ] = None,
    settings: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="NAME=VALUE",
            help="Set a device parameter, or observer.NAME, controller.NAME, monitor.NAME (SI); repeatable.",
        ),
    ] = None,
    rate_profile: Annotated[
        Path | None, typer.Option(help="CSV file (also .csv.gz) with a measured rate, for `motion`.")
    ] = None,
    rate_column: Annotated[
        str | None, typer.Option(help="Its column with the rate; the first column is time in s.")
    ] = None,
    rate_unit: Annotated[str, typer.Option(help="Unit of that column: deg/s or rad/s.")] = "deg/s",
    rate_start: Annotated[float, typer.Option(help="Begin this many seconds into the profile.")] = 0.0,
    observer: Annotated[str, typer.Option(help="ekf, lyapunov, or a Python file that defines OBSERVER.")] = "ekf",
    controller: Annotated[str, typer.Option(help="foucault, or a Python file that defines CONTROLLER.")] = "foucault",
    sensing_defects: Annotated[
        bool,
        typer.Option(
            "--sensing-defects",
            help="Offset, drift, gap, mismatches and parasitic in the pickoff; design sensing_defects.",
        ),
    ] = False,
    angle: Annotated[str | None, typer.Option(help="Angle unit A, B or C; default: the scenario's.")] = None,
    sample_rate: Annotated[float, typer.Option(help="Samples a second.")] = 200e3,
    duration: Annotated[float | None, typer.Option(help="Seconds; default: the scenario's.")] = None,
    seed: Annotated[int, typer.Option(help="Seed of the noises and of the first estimates.")] = 1,
    trace_rate: Annotated[
        float | None, typer.Option(help="Rows of the trace a second; default 20000, fewer in long runs.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="Folder for summary.json, trace.parquet, report.html; default results/SCENARIO.")
    ] = None,
) -> None:
    """Run a scenario in the closed loop and report."""
    from gyrotwin.compiled import compile_once
    from gyrotwin.output import check_writable
    from gyrotwin.tasks.run import NOT_VALID, Request, prepare

    request = Request(
        scenario, device, design, tuple(settings or ()), rate_profile, rate_column, rate_unit, rate_start, observer,
        controller, sensing_defects, angle, sample_rate, duration, seed, trace_rate, tuple(effects or ()),
    )  # fmt: skip
    prepared = prepare(request)
    folder = out or Path("results") / prepared.scenario.name
    check_writable(folder)
    compile_once(console, prepared)
    from gyrotwin.console import results
    from gyrotwin.progress import shown_progress
    from gyrotwin.tasks.run import execute

    with shown_progress(console, f"{prepared.scenario.name}, {prepared.duration:g} s") as progress:
        summary = execute(prepared, folder, progress)
    console.print(results(summary))
    console.print(f"report: {folder / 'report.html'}", soft_wrap=True, highlight=False)
    if not summary["valid"]["now"]:
        sys.exit(NOT_VALID)


@app.command(name="list")
def list_(what: Annotated[str, typer.Argument(help="effects, devices, designs, scenarios, observers.")]) -> None:
    """List what there is by name."""
    listings = {
        "effects": _effects,
        "devices": _devices,
        "designs": _designs,
        "scenarios": _scenarios,
        "observers": _observers,
    }
    if what not in listings:
        raise InputError(f"list {what!r}: there are {', '.join(listings)}{nearest(what, listings)}")
    console.print(listings[what]())


def _table(*headings: str) -> Table:
    table = Table(box=None, header_style="bold")
    for heading in headings:
        table.add_column(heading, overflow="fold")
    return table


def _effects() -> Table:
    table = _table("effect", "stage", "parameters", "signature")
    for effect in load_model().effects:
        names = [
            f"{q.name} \\[{q.unit}]" if q.role == "size" else f"({q.name} \\[{q.unit}])" for q in effect.parameters
        ]
        table.add_row(effect.id, effect.stage, ", ".join(names), effect.signature)
    return table


def _devices() -> Table:
    table = _table("device", "mass", "x alone", "Q of x", "file")
    for name, path in packaged_devices().items():
        p = load_device(name).all_parameters
        w = (p["kxx"] / p["m"]) ** 0.5
        table.add_row(
            name, f"{p['m']:.3g} kg", f"{w / 6.283185307179586:.1f} Hz", f"{p['m'] * w / p['dxx']:.4g}", str(path)
        )
    return table


def _designs() -> Table:
    from cosim.design import packaged_designs

    table = _table("design", "what the loop knows", "file")
    for name, path in packaged_designs().items():
        comment = [
            line.removeprefix("# ") for line in path.read_text(encoding="utf-8").splitlines() if line[:2] == "# "
        ]
        table.add_row(name, comment[0], str(path))
    return table


def _scenarios() -> Table:
    from cosim.scenarios import DESCRIPTIONS

    table = _table("scenario", "what happens")
    for name, text in DESCRIPTIONS.items():
        table.add_row(name, text)
    return table


def _observers() -> Table:
    from cosim.registry import controller_names, observer_names

    table = _table("name", "kind")
    for name in observer_names():
        table.add_row(name, "observer")
    for name in controller_names():
        table.add_row(name, "controller")
    return table


@device_app.command()
def new(
    frequency: Annotated[float, typer.Option(help="Frequency of the lower mode, Hz.")],
    split: Annotated[float, typer.Option(help="The other mode lies above it by this, Hz.")],
    q: Annotated[float, typer.Option("--q", help="Quality factor of both modes.")],
    axis_angle: Annotated[float, typer.Option(help="From x to the axis of the lower mode, degrees.")],
    mass: Annotated[float, typer.Option(help="Proof mass, kg.")],
    name: Annotated[str, typer.Option(help="Name of the device.")] = "my_device",
    out: Annotated[Path | None, typer.Option(help="File to write; default NAME.toml.")] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace an existing file.")] = False,
) -> None:
    """Write a device file from what a designer knows."""
    path = out or Path(f"{name}.toml")
    if path.exists() and not force:
        raise InputError(f"device file {path}: exists; name another with --out or replace it with --force")
    device = design_device(name, frequency=frequency, split=split, q=q, axis_angle=axis_angle, mass=mass)
    note = (
        f"From frequency {frequency:g} Hz, split {split:g} Hz, Q {q:g}, "
        f"axis angle {axis_angle:g} deg, mass {mass:g} kg.\n"
        "Sensor gains and noise are the FMU's start values until set here."
    )
    write_device(device, path, note)
    console.print(f"wrote {path}", soft_wrap=True, highlight=False)


def main(arguments: list[str] | None = None) -> Any:
    """Entry point: one line and exit code 2 for wrong input, 130 for Ctrl-C."""
    signal.signal(signal.SIGINT, interrupt)
    try:
        return app(args=arguments, prog_name="gyrotwin")
    except InputError as error:
        print(f"gyrotwin: {error}", file=sys.stderr)
        sys.exit(2)
    except Interrupted as stop:
        print(f"gyrotwin: interrupted; {stop.left}", file=sys.stderr)
        sys.exit(130)
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)


if __name__ == "__main__":
    main()
