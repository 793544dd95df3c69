"""`gyrotwin diagnose`: a data set becomes report.json, report.html, device.toml and the FMU of the improved model."""

import math
import shutil
import tempfile
import threading
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, Annotated, Any, Final, NamedTuple

import typer
from rich.console import Console
from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

from discrepancy import MOST_EFFECTS
from gyro_model.build import build
from gyro_model.device import Device, load_device, write_device
from gyro_model.errors import InputError
from gyro_model.model import Model, load_model
from gyro_model.progress import Steps
from gyrotwin.interrupt import Interrupted
from gyrotwin.results import DiagnosisResult, Writer, write_json

if TYPE_CHECKING:
    from discrepancy.criteria import Criteria
    from discrepancy.data.dataset import Dataset
    from discrepancy.tell.answer import Diagnosis
    from discrepancy.tell.limits import Limits

CHECKPOINT: Final = "search.checkpoint"

QUIET: Final = 8.0
"""Seconds without a line after which a log, where no spinner turns, says that the step goes on: below the ten that
pass for a hang."""

console = Console()


class Request(NamedTuple):
    """A diagnosis as typed."""

    dataset: Path
    out: Path
    device: str | None = None
    effects: tuple[Path, ...] = ()
    max_effects: int = MOST_EFFECTS
    jobs: int | None = None
    seed: int = 0
    criteria: Path | None = None
    limits: "Path | Limits | None" = None


def diagnose(
    dataset: Annotated[
        Path, typer.Argument(metavar="FOLDER", help="Folder with dataset.toml; `gyrotwin dataset init` writes one.")
    ],
    each: Annotated[
        bool, typer.Option("--each", help="FOLDER holds a data set of each of many devices: diagnose all, compare.")
    ] = False,
    device: Annotated[
        str | None,
        typer.Option(metavar="NAME|FILE", help="Nominal values: this device's replace those of the data set."),
    ] = None,
    effects: Annotated[
        list[Path] | None, typer.Option(metavar="DIR", help="Folder of further effect files; repeatable.")
    ] = None,
    out: Annotated[Path | None, typer.Option(metavar="DIR", help="Folder to write; default results/NAME.")] = None,
    max_effects: Annotated[
        int, typer.Option(help="Name at most so many effects, beside the further modes that the runs show.")
    ] = MOST_EFFECTS,
    jobs: Annotated[int | None, typer.Option(help="Simulations at a time; default one a core.")] = None,
    seed: Annotated[int, typer.Option(help="Seed of whatever the search draws.")] = 0,
    criteria: Annotated[
        Path | None, typer.Option(metavar="FILE", help="TOML with thresholds; report.json lists all of them.")
    ] = None,
    limits: Annotated[
        Path | None, typer.Option(metavar="FILE", help="TOML with what the laboratory can do in a further experiment.")
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Write even into a folder that holds other files.")] = False,
) -> None:
    """Find what a model lacks to explain measured data, and write the improved model."""
    folder = out or Path("results") / _name(dataset)
    request = Request(dataset, folder, device, tuple(effects or ()), max_effects, jobs, seed, criteria, limits)
    if each:
        from gyrotwin.tasks import fleet

        fleet.execute(dataset, request, console, force=force)
        return
    execute(request, console, force=force)


def execute(request: Request, out: Console, *, force: bool = False) -> dict[str, Any]:
    """Diagnoses and writes all files of ``request.out``, complete or not at all; shows what is found on ``out``; gives
    the contents of report.json.

    Raises InputError for anything wrong in the request or in the data. An interrupted search leaves its checkpoint.
    """
    from discrepancy.data.checks import check, lines
    from gyrotwin.diagnosis_console import results
    from gyrotwin.output import check_writable

    check_request(request)
    check_writable(request.out, force=force)
    model = load_model(*request.effects)
    data, notes = load_nominal(request, model)
    warnings = [*notes, *lines(check(data))]
    for warning in warnings:
        out.print(f"warning: {warning}", style="yellow", soft_wrap=True, highlight=False, markup=False)
    with _kept_search(request, out) as (checkpoint, progress):
        found = find(request, data, model, progress, checkpoint, warnings)
        # What took minutes to find is said whatever becomes of the files.
        out.print(results(found.report, found.raw))
        with out.status("report and FMU"):
            found.save(request.out, force=force)
    (request.out / CHECKPOINT).unlink(missing_ok=True)
    out.print(f"report: {request.out / 'report.html'}", soft_wrap=True, highlight=False)
    return dict(found.report)


def find(
    request: Request,
    data: "Dataset",
    model: Model,
    progress: Steps,
    checkpoint: Path | None = None,
    warnings: Sequence[str] = (),
) -> DiagnosisResult:
    """Diagnoses ``data`` as ``request`` asks; nothing is written but ``checkpoint``."""
    from discrepancy import diagnose as naming
    from discrepancy.discover.term_search import TermSearch

    with tempfile.TemporaryDirectory(prefix="gyrotwin-") as folder:
        terms = Path(folder)
        found = naming.diagnose(
            data,
            model,
            max_effects=request.max_effects,
            jobs=request.jobs,
            seed=request.seed,
            progress=progress,
            checkpoint=checkpoint,
            further=TermSearch(terms, progress),
            criteria=criteria_of(request),
            limits=limits_of(request),
        )
        given = [path for folder in (*request.effects, terms) for path in sorted(folder.glob("*.py"))]
        texts = {f"effects/{path.name}": path.read_bytes() for path in given}
    device = improved_device(_name(request.dataset), data, found.model, found)
    return DiagnosisResult(data, device, found, texts, tuple(warnings))


def criteria_of(request: Request) -> "Criteria":
    """The thresholds as asked for."""
    from discrepancy.criteria import Criteria, load_criteria

    return load_criteria(request.criteria) if request.criteria else Criteria()


def limits_of(request: Request) -> "Limits | None":
    """What the laboratory can do, as said."""
    from discrepancy.tell.limits import load_limits

    return load_limits(request.limits) if isinstance(request.limits, Path) else request.limits


def check_request(request: Request) -> None:
    """Raises InputError for options that nothing can be done with."""
    if request.max_effects < 0:
        raise InputError(f"--max-effects {request.max_effects}: give 0 or more")
    if request.jobs is not None and request.jobs < 1:
        raise InputError(f"--jobs {request.jobs}: give 1 or more")
    effects = request.out / "effects"
    if effects.is_symlink():
        raise InputError(f"--out {request.out}: its {effects.name} is a link that leads elsewhere; name another folder")


def _name(dataset: Path) -> str:
    """The name of a data set: that of its folder."""
    whole = dataset.resolve()
    return whole.parent.name if whole.suffix == ".toml" else whole.name


def load_nominal(request: Request, model: Model) -> tuple["Dataset", list[str]]:
    """The data set as asked for, with what to say about its nominal values."""
    from discrepancy.data.dataset import load_dataset

    given = load_device(request.device, model).parameters if request.device else {}
    data = load_dataset(request.dataset, _without_noise(given, model), model)
    return with_nominal(data, given, str(request.device))


def with_nominal(data: "Dataset", given: Mapping[str, float], device: str) -> tuple["Dataset", list[str]]:
    """The data set with the nominal values to start from, and what to say about them.

    ``given``, the parameters of the ``device`` that was asked for, replace [nominal]. Noise is switched off: it is
    found, not assumed.
    """
    from discrepancy.data.dataset import Y_ONLY

    nominal = _without_noise(data.nominal, data.model)
    used = {n: v for n, v in _without_noise(given, data.model).items() if data.axes == 2 or n not in Y_ONLY}
    changed = [name for name, value in used.items() if nominal.get(name, value) != value]
    notes = [f"device {device} replaces the nominal {', '.join(changed)} of the data set"] if changed else []
    return replace(data, nominal=nominal | used), notes


def _without_noise(parameters: Mapping[str, float], model: Model) -> dict[str, float]:
    noise = {q.name for effect in model.effects if effect.noise for q in effect.sizes}
    return {name: value for name, value in parameters.items() if name not in noise}


@contextmanager
def _kept_search(request: Request, out: Console) -> Iterator[tuple[Path, Steps]]:
    """The checkpoint, which an interrupted search leaves in the folder of the results, and what shows its steps."""
    made = not request.out.exists()
    checkpoint = request.out / CHECKPOINT
    try:
        request.out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"output folder {request.out}: {error.strerror}; name another with --out") from None
    try:
        with steps_shown(out) as progress:
            if checkpoint.is_file():
                progress(f"going on from {checkpoint}")
            yield checkpoint, progress
    except Interrupted as stop:
        if checkpoint.is_file():
            stop.left = f"{checkpoint} keeps the search: the same command goes on from there"
        raise
    finally:
        if made and request.out.is_dir() and not any(request.out.iterdir()):
            request.out.rmdir()


@contextmanager
def steps_shown(out: Console) -> Iterator[Any]:
    """Shows the step at work with the time since the start; steps done stay as lines. A log, in which nothing turns,
    gets a line every QUIET s."""
    columns = (SpinnerColumn(), TextColumn("{task.description}", markup=False), TimeElapsedColumn())
    with Progress(*columns, console=out, transient=True) as bar:
        task = bar.add_task("start", total=None)

        def say(line: str) -> None:
            out.print(f"· {line}", style="dim", soft_wrap=True, highlight=False, markup=False)

        def progress(line: str) -> None:
            bar.update(task, description=line)
            say(line)
            at_work.set()

        at_work, over = threading.Event(), threading.Event()
        if not out.is_terminal:
            heard = threading.Thread(target=_still, args=(say, at_work, over), daemon=True)
            heard.start()
        try:
            yield progress
        finally:
            over.set()
            at_work.set()


def _still(say: Steps, at_work: threading.Event, over: threading.Event) -> None:
    """Says every QUIET s for how long the step has been at work that began when ``at_work`` was set, until ``over``."""
    begun = monotonic()
    while not over.is_set():
        if at_work.wait(QUIET):
            at_work.clear()
            begun = monotonic()
        else:
            say(f"still at it, for {monotonic() - begun:.0f} s")


def writers_of(result: DiagnosisResult) -> dict[str, Writer]:
    """The files of a diagnosis by name. The FMUs are built when the first of them is written."""
    from gyrotwin.diagnosis_report import render

    data, found, device, report = result.dataset, result.raw, result.device, result.report
    note = f"{result.verdict.capitalize()}: the model of data set {device.name} after `gyrotwin diagnose`.\n" + (
        "Only x was measured: y stands here like x, uncoupled." if data.axes == 1 else ""
    )

    def write_fmus(path: Path) -> None:
        with tempfile.TemporaryDirectory(prefix="gyrotwin-") as folder:
            fmus = build(improved_model(data, found.model, device), Path(folder))
            shutil.copy(fmus.fmi2, path)
            shutil.copy(fmus.fmi3, path.with_name("fmi3.fmu"))

    def write_page(path: Path) -> None:
        render(device.name, data, found.model, report, found, [*dict.fromkeys((*result.warnings, *found.doubts))], path)

    return {
        "fmi2.fmu": write_fmus,
        "fmi3.fmu": lambda path: None,  # written with the other
        **{name: partial(_write_bytes, text) for name, text in result.effect_files.items()},
        **{next_name(name): experiment.write for name, experiment in found.experiments.items()},
        "device.toml": lambda path: write_device(device, path, note.strip()),
        "report.json": write_json(report),
        "report.html": write_page,
    }


def next_name(effect: str) -> str:
    """The file of the experiment that tells an effect from its rivals."""
    return f"next-{effect}.csv"


def _write_bytes(text: bytes, path: Path) -> None:
    path.write_bytes(text)


def improved_device(name: str, data: "Dataset", model: Model, found: "Diagnosis") -> Device:
    """The device that the data shows: nominal values, what was fitted, effects, noise, with intervals."""
    from discrepancy.fit.simulate import both_axes

    known = {**found.device, **{n: value for n, value in found.noise.items() if value.value > 0}}
    parameters = {**found.parameters, **{n: value.value for n, value in known.items()}}
    if data.axes == 1:
        parameters = both_axes(parameters)
    intervals = {n: (float(v.low), float(v.high)) for n, v in known.items() if math.isfinite(v.high - v.low)}
    return Device(name, {n: float(v) for n, v in parameters.items()}, intervals, model=model, fitted=True)


def improved_model(data: "Dataset", model: Model, device: Device) -> Model:
    """The model whose FMU is the improved device where nobody sets a parameter; noise off, as in the fit, and the clock
    of the data."""
    from discrepancy.fit.forced import steps_a_sample

    noise = {q.name for effect in model.effects if effect.noise for q in effect.sizes}
    first = data.fit[0]
    step = 1 / (first.sample_rate * steps_a_sample(first))
    clock = {"internal_step": step, "sample_period": step * steps_a_sample(first)}
    return model.starting_at({n: v for n, v in device.parameters.items() if n not in noise} | clock)
