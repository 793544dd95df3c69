"""The functions of the package; each command is a thin skin over the one of its name."""

import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Final

from gyro_model.device import Device, write_device
from gyro_model.device import load_device as _load_device
from gyro_model.errors import InputError
from gyro_model.model import load_model

if TYPE_CHECKING:
    from cosim.design import Design
    from discrepancy.dataset import Dataset
    from gyro_model.anatomy import Effect
    from gyro_model.experiments import Residual
    from gyrotwin.results import CompensationResult, DiagnosisResult, RateResult, RunResult, SplitResult

DeviceSource = str | Path | Device
"""A packaged name, a file, or the device itself."""
Progress = Callable[[float, float], None]
"""Called with what is done and what there is to do, in the same unit."""
Steps = Callable[[str], None]
"""Called with one line of text a step."""

MOST_EFFECTS: Final = 6
"""Effects that a diagnosis names at most, where nothing is said."""


def load_device(source: DeviceSource, *, effects: Sequence[str | Path] = ()) -> Device:
    """Load a device.

    Parameters
    ----------
    source : str, Path or Device
        Packaged name (``gyrotwin list devices``) or path of a device file.
    effects : sequence of str or Path
        Folders of further effect files, whose parameters the device file may set.

    Returns
    -------
    Device
        With parameters in SI.

    Raises
    ------
    InputError
        If there is no such device, or the file is wrong.

    Examples
    --------
    >>> import gyrotwin as gt
    >>> device = gt.load_device("reference")
    >>> round(device.frequencies[0])  # Hz
    2893

    """
    if isinstance(source, Device):
        return source
    return _load_device(str(source), load_model(*map(Path, effects)))


def load_design(source: "str | Path | Design | Device", device: DeviceSource = "reference", seed: int = 1) -> "Design":
    """Load a design: all that a loop may know of a device.

    Parameters
    ----------
    source : str, Path, Design or Device
        Packaged name (``gyrotwin list designs``), path of a design file, or a device, whose parameters are then known
        within its intervals.
    device : str, Path or Device
        The device for which the design is completed.
    seed : int
        Seed of the first estimates that the design leaves open.

    Returns
    -------
    Design

    Raises
    ------
    InputError
        If there is no such design, or the file is wrong.

    Examples
    --------
    >>> import gyrotwin as gt
    >>> design = gt.load_design("plain", "reference", seed=7)
    >>> sorted(design.deviations)
    ['dxx', 'dxy', 'dyy', 'kxx', 'kxy', 'kyy', 'm']

    """
    from cosim.design import Design
    from cosim.design import load_design as load

    if isinstance(source, Design):
        return source
    plant = load_device(device)
    if not isinstance(source, Device):
        return load(str(source), plant, seed)
    with tempfile.TemporaryDirectory(prefix="gyrotwin-") as folder:
        path = Path(folder) / "device.toml"
        write_device(source, path)
        return load(str(path), plant, seed)


def run(
    scenario: str | Path,
    *,
    device: DeviceSource = "reference",
    design: "str | Path | Design | Device | None" = None,
    parameters: Mapping[str, float] | None = None,
    seed: int = 1,
    duration: float | None = None,
    observer: str | Path = "ekf",
    controller: str | Path = "foucault",
    angle: str | None = None,
    sample_rate: float = 200e3,
    trace_rate: float | None = None,
    rate_profile: str | Path | None = None,
    rate_column: str | None = None,
    rate_unit: str = "deg/s",
    rate_start: float = 0.0,
    sensing_defects: bool = False,
    effects: Sequence[str | Path] = (),
    progress: Progress | None = None,
) -> "RunResult":
    """Run a scenario in the closed loop: gyroscope, observer, controller and angle unit.

    Parameters
    ----------
    scenario : str or Path
        Packaged name (``gyrotwin list scenarios``) or a scenario file.
    device : str, Path or Device
        What the plant is.
    design : str, Path, Design, Device or None
        All that the loop may know; None: what goes with the device.
    parameters : mapping of str to float
        Parameters of the device to change, SI, and settings ``observer.NAME``, ``controller.NAME``, ``monitor.NAME``.
    seed : int
        Seed of the noises and of the first estimates.
    duration : float
        Seconds; None: the scenario's.
    observer, controller : str or Path
        By name, or a Python file that defines ``OBSERVER`` or ``CONTROLLER``.
    angle : {"A", "B", "C"}
        Angle unit; None: the scenario's.
    sample_rate : float
        Samples a second [Hz], 1e3 to 1e7.
    trace_rate : float
        Rows of the trace a second [Hz]; None: 20,000, fewer in long runs.
    rate_profile, rate_column, rate_unit, rate_start
        A measured rate for the scenario ``motion``: CSV file, its column, ``"deg/s"`` or ``"rad/s"``, start [s].
    sensing_defects : bool
        Set offset, drift, gap, mismatches and parasitic in the pickoff.
    effects : sequence of str or Path
        Folders of further effect files.
    progress : callable
        Called with the time reached and the duration [s], some hundred times a second of simulated time.

    Returns
    -------
    RunResult
        With ``summary``, ``trace``, ``figures()``, ``save(folder)``.

    Raises
    ------
    InputError
        If an argument is wrong; the message names the remedy.

    Examples
    --------
    >>> import gyrotwin as gt
    >>> result = gt.run("constant", seed=7, duration=0.2)
    >>> result.valid
    True
    >>> len(result.trace)
    4000

    """
    from cosim.master import simulate
    from gyrotwin.compiled import compile_once
    from gyrotwin.results import RunResult
    from gyrotwin.tasks.run import Request, prepare

    folders = tuple(map(Path, effects))
    plant = load_device(device, effects=folders)
    prepared = prepare(
        Request(
            scenario=str(scenario),
            device=plant,
            design=None if design is None else load_design(design, plant, seed),
            settings=_texts(parameters),
            rate_profile=None if rate_profile is None else Path(rate_profile),
            rate_column=rate_column,
            rate_unit=rate_unit,
            rate_start=rate_start,
            observer=str(observer),
            controller=str(controller),
            sensing_defects=sensing_defects,
            angle=angle,
            sample_rate=sample_rate,
            duration=duration,
            seed=seed,
            trace_rate=trace_rate,
            effects=folders,
        )
    )
    compile_once(prepared)
    return RunResult(prepared, simulate(prepared, progress))


def _texts(parameters: Mapping[str, float] | None) -> tuple[str, ...]:
    """Settings as the texts of --set, to the last bit."""
    return tuple(f"{name}={float(value)!r}" for name, value in (parameters or {}).items())


def rate(
    *,
    device: DeviceSource = "rate-mode",
    parameters: Mapping[str, float] | None = None,
    rate_profile: str | Path | None = None,
    rate_column: str | None = None,
    rate_unit: str = "deg/s",
    rate_step: float | None = None,
    rate_period: float = 8.0,
    temperature: float | tuple[float, float, float] | str | Path = 25.0,
    sense: str = "open",
    plant: str | None = None,
    duration: float | None = None,
    sample_rate: float = 200e3,
    output_rate: float | None = None,
    seed: int = 1,
    sense_record: float | None = None,
    progress: Progress | None = None,
) -> "RateResult":
    """Run rate mode: drive loop, sense loop, rate over temperature, noise.

    Parameters
    ----------
    device : str, Path or Device
        What the plant is.
    parameters : mapping of str to float
        Parameters of the device to change, SI, and settings ``rate_mode.NAME``.
    rate_profile, rate_column, rate_unit
        A measured rate: CSV file, its column, ``"deg/s"`` or ``"rad/s"``.
    rate_step, rate_period : float
        Rest, +R, rest, -R again and again [deg/s], one round in so many seconds.
    temperature : float, tuple or path
        Ambient [°C]; a ramp (start [°C], stop [°C], slope [°C/min]); or a CSV file.
    sense : {"open", "closed"}
        Sense loop.
    plant : {"full", "envelope"}
        None: full up to 60 s, else envelope.
    duration : float
        Seconds; None: what the courses last.
    sample_rate, output_rate : float
        Of the converter and of the record [Hz].
    seed : int
        Seed of the noises.
    sense_record : float
        Also record v_y as I and Q for `split`, so many samples a second [Hz].
    progress : callable
        Called with the time reached and the duration [s].

    Returns
    -------
    RateResult
        With ``summary``, ``trace``, ``sense``, ``save(folder)``.

    Raises
    ------
    InputError
        If an argument is wrong; the message names the remedy.

    Examples
    --------
    >>> import gyrotwin as gt
    >>> result = gt.rate(plant="envelope", duration=5, seed=3)
    >>> abs(result.summary["bias_deg_s"]) < 50
    True

    """
    from cosim.rate.master import simulate
    from gyrotwin.results import RateResult
    from gyrotwin.tasks.rate import Request, prepare

    course = ",".join(map(str, temperature)) if isinstance(temperature, tuple) else str(temperature)
    prepared = prepare(
        Request(
            device=load_device(device),
            settings=_texts(parameters),
            rate_profile=None if rate_profile is None else Path(rate_profile),
            rate_column=rate_column,
            rate_unit=rate_unit,
            rate_step=rate_step,
            rate_period=rate_period,
            temperature=course,
            sense=sense,
            plant=plant,
            duration=duration,
            sample_rate=sample_rate,
            output_rate=output_rate,
            seed=seed,
            sense_record=sense_record,
        )
    )
    return RateResult(prepared, simulate(prepared, progress))


def load_dataset(
    folder: str | Path, *, device: DeviceSource | None = None, effects: Sequence[str | Path] = ()
) -> "Dataset":
    """Load measured runs.

    Parameters
    ----------
    folder : str or Path
        Folder with ``dataset.toml``; ``gyrotwin dataset init`` writes one.
    device : str, Path or Device
        Its parameters stand where ``[nominal]`` names none.
    effects : sequence of str or Path
        Folders of further effect files.

    Returns
    -------
    Dataset
        With ``records``, ``nominal`` (SI), ``axes``.

    Raises
    ------
    InputError
        If there is no data set, or it is wrong.

    """
    from discrepancy.dataset import load_dataset as load

    given = dict(load_device(device, effects=effects).parameters) if device is not None else {}
    return load(Path(folder), given, load_model(*map(Path, effects)))


def simulate_dataset(
    folder: str | Path,
    *,
    device: DeviceSource = "reference",
    hidden: Mapping[str, float] | None = None,
    runs: int = 3,
    samples: int = 8000,
    seed: int = 1,
) -> "Dataset":
    """Write the runs that a device would give, driven over both modes, and load them.

    Parameters
    ----------
    folder : str or Path
        Where ``dataset.toml`` and the runs are written.
    device : str, Path or Device
        What is measured.
    hidden : mapping of str to float
        Parameters that differ in truth from what ``[nominal]`` will say [SI].
    runs, samples : int
        The last run is held out; samples of each at 200 kHz.
    seed : int
        Seed of drive, noise and of what the lab believes.

    Returns
    -------
    Dataset

    Raises
    ------
    InputError
        If an argument is wrong, or the folder holds a data set.

    Examples
    --------
    >>> import tempfile, gyrotwin as gt
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     data = gt.simulate_dataset(folder, hidden={"k3_x": 2e9}, samples=2000)
    >>> len(data.fit), len(data.held_out)
    (2, 1)

    """
    from discrepancy.dataset import load_dataset as load
    from discrepancy.trial_runs import write_trial

    write_trial(load_device(device), dict(hidden or {}), Path(folder), runs=runs, samples=samples, seed=seed)
    return load(Path(folder))


def diagnose(
    dataset: "str | Path | Dataset",
    *,
    device: DeviceSource | None = None,
    effects: Sequence[str | Path] = (),
    max_effects: int = MOST_EFFECTS,
    jobs: int | None = None,
    seed: int = 0,
    progress: Steps | None = None,
    checkpoint: str | Path | None = None,
) -> "DiagnosisResult":
    """Find what a model lacks to explain measured data.

    Parameters
    ----------
    dataset : str, Path or Dataset
        Measured runs.
    device : str, Path or Device
        Nominal values that replace those of the data set.
    effects : sequence of str or Path
        Folders of further effect files.
    max_effects : int
        Name at most so many.
    jobs : int
        Simulations at a time; None: one a core.
    seed : int
        Seed of whatever the search draws.
    progress : callable
        Called with one line of text a step.
    checkpoint : str or Path
        File that keeps the search after each step; an interrupted search goes on from it.

    Returns
    -------
    DiagnosisResult
        With ``effects``, ``device``, ``design``, ``misfit``, ``save(folder)``.

    Raises
    ------
    InputError
        If an argument or the data are wrong.

    """
    from discrepancy.checks import check
    from discrepancy.dataset import Dataset
    from gyrotwin.tasks.diagnose import Request, find, with_nominal

    folders = tuple(map(Path, effects))
    if isinstance(dataset, Dataset):
        place, data = dataset.folder, replace(dataset, model=load_model(*folders)) if folders else dataset
    else:
        place = Path(dataset)
        data = load_dataset(place, device=device, effects=folders)
    given = load_device(device, effects=folders).parameters if device is not None else {}
    data, notes = with_nominal(data, given, "that was given")
    request = Request(place, place, None, folders, max_effects, jobs, seed)
    warnings = [*notes, *map(str, check(data))]
    kept = None if checkpoint is None else Path(checkpoint)
    return find(request, data, data.model, progress or (lambda line: None), kept, warnings)


def split(
    record: str | Path,
    *,
    q: float | None = None,
    drive_frequency: float | None = None,
    sample_rate: float | None = None,
    columns: Sequence[str] = (),
    carrier: float | None = None,
    span: float | None = None,
    guard: float = 0.0,
    clean_line: bool = False,
    resolution: float | None = None,
    track: float | None = None,
    unfold: bool = False,
    mass: float | None = None,
    sense_gain: float | None = None,
    temperature: float = 298.15,
) -> "SplitResult":
    """Find the frequency split of the two modes in a record of normal operation, from thermal noise.

    Parameters
    ----------
    record : str or Path
        Table of one voltage: .csv, .csv.gz or .parquet.
    q : float
        Quality factor of the sense mode; None: found.
    drive_frequency : float
        Hz; None: the strongest line.
    sample_rate : float
        Samples a second [Hz], where no column is the time.
    columns : sequence of str
        Column of the voltage; two with ``carrier``, I and Q.
    carrier : float
        The columns are I and Q around this frequency [Hz]: v = I cos - Q sin.
    span, guard : float
        Search so far, leave out so much either side of the drive [Hz].
    clean_line : bool
        The drive line has no phase noise.
    resolution : float
        Refuse an answer with a 95 % interval wider than plus or minus this [Hz].
    track : float
        Follow the split through time, by blocks of so many seconds.
    unfold : bool
        The record was sampled below twice the drive frequency, which is given.
    mass, sense_gain, temperature : float
        With the first two [kg, V/m] the power of the hump is held against kT at the temperature [K].

    Returns
    -------
    SplitResult
        With ``summary``, ``trace`` of a track, ``save(folder)``.

    Raises
    ------
    InputError
        If an argument or the record is wrong, or the noise does not tell.

    """
    from gyrotwin.tasks.split import Request, find

    return find(
        Request(
            Path(record), q, drive_frequency, sample_rate, tuple(columns), carrier, span, guard, clean_line, resolution,
            track, unfold, mass, sense_gain, temperature,
        )
    )  # fmt: skip


def compensate(
    records: str | Path | Sequence[str | Path],
    *,
    test: str | Path | None = None,
    method: str = "best",
    sensor: str | None = None,
    segments: int | None = None,
    hidden: int | None = None,
    sampling_time: float = 10.0,
    settling: float = 1.0,
    settled: bool = False,
    outside: str = "refuse",
    maps: Mapping[str, str] | None = None,
    scales: Mapping[str, str] | None = None,
    seed: int = 1,
) -> "CompensationResult":
    """Fit a temperature compensation of scale factor and bias.

    Parameters
    ----------
    records : str or Path, or several
        Temperature tests: trace.parquet of `rate`, or tables.
    test : str or Path
        Another record to test on; None: the last whole cycle is held out, of a single one contiguous parts.
    method : {"best", "piecewise", "network", "spline", "history"}
        Best: by inner validation on the fitting cycles alone.
    sensor : {"structure", "circuit"}
        Temperature of the piecewise lines; None: structure where given.
    segments : int
        Of the piecewise lines; None: by inner validation.
    hidden : int
        Neurons of the network; None: by inner validation.
    sampling_time, settling : float
        Means over so many seconds; left out after a step of the rate [s].
    settled : bool
        Only where the temperatures rest, below 0.05 °C/min.
    outside : {"refuse", "clamp"}
        Beyond the fitted range.
    maps, scales : mapping of str to str
        Headings and units of the columns of a lab's own table.
    seed : int
        Of the network's starts.

    Returns
    -------
    CompensationResult
        With ``summary``, ``save(folder)``: TOML and C header of the coefficients, report.

    Raises
    ------
    InputError
        If an argument or the record is wrong.

    """
    from gyrotwin.tasks.compensate import Request, find

    paths = [records] if isinstance(records, str | Path) else records
    return find(
        Request(
            tuple(map(Path, paths)), None if test is None else Path(test), method, sensor, segments, hidden,
            sampling_time, settling, settled, outside, _pairs(maps), _pairs(scales), seed,
        )
    )  # fmt: skip


def _pairs(pairs: Mapping[str, str] | None) -> tuple[str, ...]:
    return tuple(f"{name}={value}" for name, value in (pairs or {}).items())


def verify(fmu: str | Path) -> "list[Residual]":
    """Replay the reference traces that an FMU brings, on this machine.

    Parameters
    ----------
    fmu : str or Path
        An FMU for FMI 2.0 or 3.0 with the layered standard fmi-ls-ref inside.

    Returns
    -------
    list of Residual
        Of each output of each experiment: how far it is off, what is allowed and why, ``met``.

    Raises
    ------
    InputError
        Where it is no FMU, brings no traces, or has no binary for this machine.

    Examples
    --------
    >>> import gyrotwin as gt
    >>> all(residual.met for residual in gt.verify(gt.build()[0]))
    True

    """
    from gyro_model.experiments import verify as replay

    return replay(Path(fmu))


def build(
    device: DeviceSource | None = None,
    *,
    effects: Sequence[str | Path] = (),
    folder: str | Path | None = None,
    force: bool = False,
    platforms: str | Sequence[str] = (),
) -> tuple[Path, ...]:
    """Build the FMUs Gyroscope and GyroscopeEnvelope, FMI 2.0 and FMI 3.0.

    Parameters
    ----------
    device : str, Path or Device
        The FMUs start as this device where nobody sets a parameter; needs ``folder``.
    effects : sequence of str or Path
        Folders of further effect files.
    folder : str or Path
        Where to put them; None: beside the sources in a checkout, else the user's cache.
    force : bool
        Build even where they are up to date.
    platforms : str or sequence of str
        Platforms to hold libraries for, compiled by zig: "all", or names such as x86_64-windows; wasm32 is a module
        beside the FMUs. None: this machine's, by its own compiler.

    Returns
    -------
    tuple of Path
        Gyroscope for FMI 2.0 and 3.0, then GyroscopeEnvelope.

    Raises
    ------
    InputError
        If there is no compiler, or it fails; if a platform is unknown.

    Examples
    --------
    >>> import gyrotwin as gt
    >>> [path.name for path in gt.build()]
    ['Gyroscope.fmu', 'Gyroscope.fmu', 'GyroscopeEnvelope.fmu', 'GyroscopeEnvelope.fmu']

    """
    from gyro_model.build import build_all
    from gyro_model.platforms import chosen_platforms

    named = chosen_platforms(platforms if isinstance(platforms, str) else ",".join(platforms)) if platforms else ()
    model = load_model(*map(Path, effects))
    if device is not None:
        if folder is None:
            raise InputError("build of a device: name the folder, so that the FMUs of the package stay as they are")
        model = model.starting_at(load_device(device, effects=effects).parameters)
    return build_all(model, None if folder is None else Path(folder), force=force, platforms=named)


def effects(*folders: str | Path) -> "tuple[Effect, ...]":
    """List the effects of the model.

    Parameters
    ----------
    *folders : str or Path
        Folders of further effect files.

    Returns
    -------
    tuple of Effect
        Each with ``id``, ``stage``, ``parameters`` (name, unit, bounds), ``signature``, ``doc``.

    Raises
    ------
    InputError
        If a file is wrong.

    Examples
    --------
    >>> import gyrotwin as gt
    >>> "cubic_stiffness" in [effect.id for effect in gt.effects()]
    True

    """
    return load_model(*map(Path, folders)).effects
