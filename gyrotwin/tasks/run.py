"""One run: what was asked for becomes a cosim Run, its result becomes summary.json, trace.parquet, report.html."""

import tempfile
from collections.abc import Iterable
from pathlib import Path
from typing import Any, Final, NamedTuple

from calibration.characteristics.kind import characteristics, course
from cosim.angle import UNIT_NAMES
from cosim.angle_filters import Filter, band_pass, low_pass
from cosim.angle_record import angle_record
from cosim.design import DEFAULT, Design, chosen_design, load_design
from cosim.master import simulate
from cosim.metrics import summarise
from cosim.rate_profile import read_profile
from cosim.recorder import Result
from cosim.registry import find_controller, find_observer
from cosim.run import Run, sample_rate_of
from cosim.scenarios import scenario
from gyro_model.device import Device, load_device
from gyro_model.errors import InputError, nearest
from gyro_model.model import load_model
from gyro_model.progress import Progress
from gyrotwin.output import check_writable

PARTS: Final = ("observer", "controller", "monitor")
"""What --set NAME.KEY=VALUE may set besides the device."""
NOT_VALID: Final = 3
"""Exit code where the angle was not valid at the end."""
DESIGN_FILE: Final = "design.toml"
"""All that the loop knew, beside the results."""

SENSING_DEFECTS: Final = {
    "offset_x": 0.01,
    "offset_y": 0.01,
    "offset_drift": 0.01,
    "pickoff_inverse_gap": 4e4,
    "pickoff_mismatch": 0.02,
    "pickoff_gain_mismatch": 0.03,
    "parasitic_ratio": 0.05,
}
"""What --sensing-defects sets where the device says nothing else: offset 10 mV, drift 10 mV/s, 1/g = 4e4 1/m with a
pair mismatch of 2 %, gain ratio 3 %, parasitic 5 %."""


class Request(NamedTuple):
    """A run as asked for; None where the scenario, the design or the device decides. ``settings`` are texts
    ``name=value``; a device or design is a name, a file, or the object itself."""

    scenario: str
    device: str | Device = "reference"
    design: str | Design | None = None
    settings: tuple[str, ...] = ()
    rate_profile: Path | None = None
    rate_column: str | None = None
    rate_unit: str | None = None
    rate_start: float = 0.0
    observer: str = "ekf"
    controller: str = "foucault"
    sensing_defects: bool = False
    angle: str | None = None
    sample_rate: float | None = None
    duration: float | None = None
    seed: int = 1
    trace_rate: float | None = None
    effects: tuple[Path, ...] = ()


def prepare(request: Request, folder: Path | None = None) -> Run:
    """The run that ``request`` asks for. The loop gets what stands in the design file that is written to ``folder``
    (default: a temporary one) and read back, and nothing else of the device.

    Raises InputError, with a remedy, for whatever is wrong in it.
    """
    profile = None
    if request.rate_profile is not None:
        if request.rate_column is None:
            raise InputError("--rate-profile needs --rate-column: name the column that holds the rate")
        profile = read_profile(request.rate_profile, request.rate_column, request.rate_unit)
    chosen = scenario(request.scenario, profile, request.rate_start)
    if request.angle is not None:
        if request.angle not in UNIT_NAMES:
            raise InputError(f"angle unit {request.angle!r}: give {', '.join(UNIT_NAMES)}")
        chosen = chosen.with_angle_unit(request.angle)
    own, settings = split_settings(request.settings, *PARTS)
    device = request.device
    if not isinstance(device, Device):
        device = load_device(device, load_model(*request.effects))
    # The device's own start comes before the scenario's, what the user sets before both.
    device = device.with_parameters({**chosen.parameters, **device.parameters})
    device = device.with_parameters(
        {**(SENSING_DEFECTS if request.sensing_defects else {}), **device.parameters, **own}
    )
    seed = int(device.model.parameter("seed").check(request.seed))
    default = "sensing_defects" if request.sensing_defects else DEFAULT
    design = chosen_design(request.design or None, device, seed, default)
    run = Run(
        scenario=chosen,
        device=device,
        design=_through_file(design, device, seed, folder),
        observer=find_observer(request.observer),
        controller=find_controller(request.controller),
        sample_rate=sample_rate_of(device, request.sample_rate),
        duration=request.duration if request.duration is not None else chosen.duration,
        seed=seed,
        trace_rate=request.trace_rate,
        settings=settings,
    )
    chosen.inputs(run.samples - 1, 1, run.period)  # a record too short for the run is refused before it begins
    return run


def _through_file(design: Design, device: Device, seed: int, folder: Path | None) -> Design:
    """Writes the design and reads it back."""
    if folder is not None:
        check_writable(folder)
        folder.mkdir(parents=True, exist_ok=True)
        design.write(folder / DESIGN_FILE)
        return load_design(str(folder / DESIGN_FILE), device, seed)
    with tempfile.TemporaryDirectory(prefix="gyrotwin-") as name:
        design.write(Path(name) / DESIGN_FILE)
        return load_design(str(Path(name) / DESIGN_FILE), device, seed)


def split_texts(texts: Iterable[str]) -> dict[str, float]:
    """``name=value`` texts as a mapping."""
    pairs = {}
    for text in texts:
        name, equals, value = text.partition("=")
        try:
            number = float(value)
        except ValueError:
            raise InputError(f"--set {text!r}: give name=value with a number, SI") from None
        if not equals or not name.strip():
            raise InputError(f"--set {text!r}: give name=value with a number, SI")
        pairs[name.strip()] = number
    return pairs


def split_settings(texts: Iterable[str], *tables: str) -> tuple[dict[str, float], dict[str, dict[str, float]]]:
    """Splits ``name=value`` texts into device parameters and, for names ``TABLE.NAME``, entries of those tables."""
    own: dict[str, float] = {}
    entries: dict[str, dict[str, float]] = {table: {} for table in tables}
    for name, number in split_texts(texts).items():
        text = f"{name}={number:g}"
        table, dot, key = name.partition(".")
        if dot and table not in entries:
            raise InputError(
                f"--set {text!r}: {table!r} is unknown{nearest(table, entries)}; there are {', '.join(entries)}"
            )
        (entries[table] if dot else own)[key if dot else name] = number
    return own, entries


def execute(run: Run, folder: Path, progress: Progress | None = None) -> dict[str, Any]:
    """Runs and writes the files of a result into ``folder``, complete or not at all; gives the summary."""
    from gyrotwin.results import RunResult

    check_writable(folder)
    result = RunResult(run, simulate(run, progress))
    result.save(folder)
    return dict(result.summary)


def filters_of(run: Run, result: Result) -> list[Filter]:
    """The filters of the angle units, then others of the same bands to compare them with."""
    own = [unit.filter for unit in result.units.values() if unit.filter is not None]
    hertz = run.oscillation_hz
    return own + [design(run.sample_rate, hertz, "butterworth") for design in (band_pass, low_pass)]


def summary_of(run: Run, result: Result) -> dict[str, Any]:
    """The content of summary.json."""
    summary = summarise(
        result.trace,
        scenario=run.scenario.name,
        seed=run.seed,
        unit=run.scenario.angle_unit,
        converged_at=result.converged_at,
        edges=run.scenario.edges_until(run.duration),
        bounds=result.bounds,
        validity=result.validity,
        extra=_extra(run, result),
        real_time_factor=run.duration / result.wall_time,
        run={
            "description": run.scenario.description,
            "device": run.device.name,
            "design": run.design.name,
            "observer": run.observer.name,
            "controller": run.controller.name,
            "duration": f"{run.duration:g} s",
            "sample_rate": f"{run.sample_rate / 1e3:g} kHz",
            "effects": ", ".join(_acting(run.device)) or None,
        },
    )
    return summary | {"characteristics": _characteristics(run, result)}


def _characteristics(run: Run, result: Result) -> dict[str, Any]:
    """What the run shows by what its rate does, by kind of run: see calibration.characteristics."""
    t, rate, turned = (result.trace[name].to_numpy() for name in ("t", "omega_true", "turned"))
    through = course(t, rate, turned, run.design.all_values["angular_gain"])
    found = characteristics(angle_record(run, result), through)
    return {
        name: {
            "title": title,
            "not_done": outcome.reason,
            "figures": {figure.id: figure.as_json() for figure in outcome.figures},
            "curves": [curve.as_json() for curve in outcome.curves],
        }
        for name, (title, outcome) in found.items()
    }


def _extra(run: Run, result: Result) -> dict[str, float]:
    """What the plant is in the parameters of effects that were estimated."""
    true = run.device.all_parameters
    return {name: true[name] for name in result.extra_names}


def _acting(device: Device) -> list[str]:
    return [effect.id for effect in device.model.effects if not effect.nominal and device.acts(effect)]
