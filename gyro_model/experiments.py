"""Reference traces as other tools read them: experiments (Modelica Association, ma-hs-experiments) with parameters as
SSV and time series as CSV, announced in an FMU by the layered standard fmi-ls-ref 1.0.0-alpha.1.

Inputs are held from one row to the next; outputs are those at the row's time, before its inputs act. How far an output
may be off, and why, stands in annotations.
"""

import csv
import io
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, NamedTuple
from xml.etree import ElementTree as ET

import numpy as np
from numpy.typing import NDArray

from gyro_model.errors import InputError
from gyro_model.platforms import own_platform, platform_of, platforms_of

Floats = NDArray[np.float64]
Reader = Callable[[str], bytes]
"""The bytes of a file beside the experiments file, by its name; KeyError or OSError where there is none."""

FOLDER: Final = "extra/org.fmi-standard.fmi-ls-ref"
EXPERIMENTS: Final = "experiments.exp"
SSV: Final = "http://ssp-standard.org/SSP1/SystemStructureParameterValues"
LS: Final = "http://fmi-standard.org/fmi-ls-manifest"
_TOLERANCES: Final = "gyrotwin.tolerances"


class Tolerance(NamedTuple):
    """How far an output may be off, relative to the largest value of its reference, and why."""

    relative: float
    reason: str


@dataclass(frozen=True)
class Experiment:
    """One trace. ``time`` [s], shape (n,), evenly spaced; ``inputs`` and ``outputs`` by name, SI, shape (n,)."""

    name: str
    description: str
    parameters: Mapping[str, float]
    time: Floats
    inputs: Mapping[str, Floats]
    outputs: Mapping[str, Floats]
    tolerances: Mapping[str, Tolerance]

    def __post_init__(self) -> None:
        for name, column in {**self.inputs, **self.outputs}.items():
            if np.shape(column) != np.shape(self.time) or not np.all(np.isfinite(column)):
                raise InputError(f"experiment {self.name}: {name} needs one finite value a row")
        if len(self.time) < 2 or not np.all(np.diff(self.time) > 0):
            raise InputError(f"experiment {self.name}: time does not increase")
        if missing := set(self.outputs) - set(self.tolerances):
            raise InputError(f"experiment {self.name}: {', '.join(sorted(missing))} without a tolerance")


def experiment_files(title: str, experiments: Iterable[Experiment]) -> dict[str, bytes]:
    """The files of ``experiments`` by name: the experiments file and what it refers to."""
    root = ET.Element("Experiments", name=title)
    files: dict[str, bytes] = {}
    for e in experiments:
        worst = max(t.relative for t in e.tolerances.values())
        head = {"name": e.name, "description": e.description, "tolerance": repr(worst)}
        one = ET.SubElement(root, "Experiment", head)
        step = (e.time[-1] - e.time[0]) / (len(e.time) - 1)
        times = {"startTime": e.time[0], "stopTime": e.time[-1], "stepSize": step}
        ET.SubElement(one, "TransientSimulation", {k: repr(float(v)) for k, v in times.items()})
        ET.SubElement(one, "Parameters", source=f"{e.name}.ssv")
        ET.SubElement(one, "Stimuli", source=f"{e.name}_in.csv")
        ET.SubElement(one, "References", source=f"{e.name}_ref.csv")
        annotation = ET.SubElement(ET.SubElement(one, "Annotations"), "Annotation", type=_TOLERANCES)
        for output, (relative, reason) in e.tolerances.items():
            ET.SubElement(annotation, "Tolerance", output=output, relative=repr(relative), reason=reason)
        files[f"{e.name}.ssv"] = parameter_set(e.name, e.parameters)
        files[f"{e.name}_in.csv"] = _csv({"time": e.time, **e.inputs})
        files[f"{e.name}_ref.csv"] = _csv({"time": e.time, **e.outputs})
    return {EXPERIMENTS: xml_bytes(root), **files}


def packaged_experiments(form: str) -> dict[str, bytes]:
    """The files of the traces that come with the package for the FMU of that name; none where it has none."""
    package = Path(__file__).parent
    for folder in (package.parent / "tests" / "traces", package / "traces"):
        if (folder / form / EXPERIMENTS).is_file():
            return {path.name: path.read_bytes() for path in sorted((folder / form).iterdir())}
    return {}


def parameter_set(name: str, parameters: Mapping[str, float], units: Mapping[str, str] | None = None) -> bytes:
    """An SSV file of ``parameters`` in SI; whole numbers of type int become Integer."""
    ET.register_namespace("ssv", SSV)
    root = ET.Element(f"{{{SSV}}}ParameterSet", version="1.0", name=name)
    group = ET.SubElement(root, f"{{{SSV}}}Parameters")
    for key, value in parameters.items():
        one = ET.SubElement(group, f"{{{SSV}}}Parameter", name=key)
        kind = "Integer" if isinstance(value, int) else "Real"
        unit = {"unit": units[key]} if units and units.get(key, "1") != "1" else {}
        ET.SubElement(one, f"{{{SSV}}}{kind}", {"value": repr(value), **unit})
    return xml_bytes(root)


def layered_standard(name: str, version: str, description: str) -> dict[str, str]:
    """The attributes by which the manifest of a layered standard says which it is."""
    ET.register_namespace("fmi-ls", LS)
    about = {"name": name, "version": version, "description": description}
    return {f"{{{LS}}}fmi-ls-{key}": value for key, value in about.items()}


def manifest() -> bytes:
    """``fmi-ls-manifest.xml`` of an FMU with an experiments file beside it."""
    description = "Layered Standard providing information on related files included in an FMU."
    about = layered_standard("org.fmi-standard.fmi-ls-ref", "1.0.0-alpha.1", description)
    root = ET.Element("fmiReferences", about)
    ET.SubElement(
        root,
        "Related",
        type="application/x-ma-hs-experiments",
        source=EXPERIMENTS,
        role="experiment/validation",
        description="Reference traces, made independently of this FMU",
    )
    return xml_bytes(root)


def read_experiments(read: Reader) -> list[Experiment]:
    """The experiments that ``read`` gives. Raises InputError where they are missing or not of this form."""
    try:
        root = ET.fromstring(read(EXPERIMENTS))
        return [_experiment(one, read) for one in root.iter("Experiment")]
    except (KeyError, OSError):
        raise InputError(f"{EXPERIMENTS}: there is none, or a file that it names is missing") from None
    except (ET.ParseError, ValueError, AttributeError, TypeError) as error:
        raise InputError(f"{EXPERIMENTS}: not experiments of this form ({error})") from None


def _experiment(one: ET.Element, read: Reader) -> Experiment:
    def source(tag: str) -> bytes:
        name = one.find(tag).attrib["source"]  # type: ignore[union-attr]
        return read(name)

    stimuli, references = _columns(source("Stimuli")), _columns(source("References"))
    time = references.pop("time")
    if not np.array_equal(stimuli.pop("time"), time):
        raise InputError(f"experiment {one.get('name')}: stimuli and references have other times")
    values = {
        parameter.attrib["name"]: int(v.attrib["value"]) if v.tag.endswith("Integer") else float(v.attrib["value"])
        for parameter in ET.fromstring(source("Parameters")).iter(f"{{{SSV}}}Parameter")
        for v in parameter
    }
    tolerances = {
        t.attrib["output"]: Tolerance(float(t.attrib["relative"]), t.attrib["reason"]) for t in one.iter("Tolerance")
    }
    text = one.get("description", "")
    return Experiment(one.attrib["name"], text, values, time, stimuli, references, tolerances)


def _csv(columns: Mapping[str, Floats]) -> bytes:
    rows = [",".join(f'"{name}"' for name in columns)]
    rows += [",".join(repr(value.item()) for value in row) for row in zip(*columns.values(), strict=True)]
    return ("\n".join(rows) + "\n").encode()


def _columns(data: bytes) -> dict[str, Floats]:
    names, *rows = csv.reader(io.StringIO(data.decode()))
    columns = dict(zip(names, np.array(rows).T, strict=True))
    # Whole numbers are written without a point.
    whole = {name for name, column in columns.items() if all(cell.lstrip("-").isdigit() for cell in column)}
    return {name: column.astype(np.int64 if name in whole else np.float64) for name, column in columns.items()}


def xml_bytes(root: ET.Element) -> bytes:
    """``root`` as an XML file in UTF-8."""
    ET.indent(root)
    return b'<?xml version="1.0" encoding="UTF-8"?>\n' + ET.tostring(root, encoding="utf-8") + b"\n"


class Residual(NamedTuple):
    """How far one output of one experiment is off, relative to its largest reference value, beside what is allowed."""

    experiment: str
    output: str
    found: float
    allowed: Tolerance

    @property
    def met(self) -> bool:
        """Whether it is within what is allowed."""
        return self.found <= self.allowed.relative


def verify(fmu: Path) -> list[Residual]:
    """Replays every experiment that the FMU at ``fmu`` (FMI 2.0 or 3.0, co-simulation) brings, on this machine.

    Raises InputError where it is no FMU, brings none, has no binary for this platform, or refuses a value or a step.
    """
    import shutil
    import zipfile

    import fmpy

    try:
        with zipfile.ZipFile(fmu) as archive:
            experiments = read_experiments(lambda name: archive.read(f"{FOLDER}/{name}"))
        ours, held = platform_of(own_platform()), platforms_of(fmu)
        if not held & {ours.fmi2, ours.fmi3}:
            raise InputError(f"{fmu}: no library for {ours.fmi3}, this machine; there are {', '.join(sorted(held))}")
        description = fmpy.read_model_description(str(fmu))
        folder = fmpy.extract(str(fmu))
    except (OSError, zipfile.BadZipFile) as error:
        raise InputError(f"{fmu}: not a readable FMU ({error})") from None
    try:
        return [residual for e in experiments for residual in _replayed(e, description, folder, fmu)]
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _replayed(experiment: Experiment, description: object, folder: str, fmu: Path) -> list[Residual]:
    try:
        found = _replay(experiment, description, folder)
    except InputError:
        raise
    except Exception as error:  # fmpy raises Exception itself
        raise InputError(f"{fmu}: experiment {experiment.name}: {error}") from None
    residuals = []
    for name, wanted in experiment.outputs.items():
        size = np.max(np.abs(wanted)) or 1.0
        off = float(np.max(np.abs(found[name] - wanted)) / size)
        # What is not a number is beyond every limit.
        residuals.append(Residual(experiment.name, name, off if off == off else np.inf, experiment.tolerances[name]))
    return residuals


def _replay(experiment: Experiment, description: object, folder: str) -> dict[str, Floats]:
    from fmpy.simulation import instantiate_fmu

    fmu = instantiate_fmu(folder, description, fmi_type="CoSimulation")
    try:
        known = {v.name for v in description.modelVariables}  # type: ignore[attr-defined]
        unknown = [n for n in (*experiment.parameters, *experiment.inputs, *experiment.outputs) if n not in known]
        if unknown:
            raise InputError(f"experiment {experiment.name}: the FMU has no variable {', '.join(unknown)}")
        access = _Access(fmu, description)
        access.set(experiment.parameters)
        start = float(experiment.time[0])
        held = [dict(zip(experiment.inputs, row, strict=True)) for row in zip(*experiment.inputs.values(), strict=True)]
        access.set(held[0])
        if access.old:
            fmu.setupExperiment(startTime=start)
            fmu.enterInitializationMode()
        else:
            fmu.enterInitializationMode(startTime=start)
        fmu.exitInitializationMode()
        rows = [access.get(experiment.outputs)]
        for k, (begin, end) in enumerate(zip(experiment.time[:-1], experiment.time[1:], strict=True)):
            access.set(held[k])
            fmu.doStep(float(begin), float(end - begin))
            rows.append(access.get(experiment.outputs))
        fmu.terminate()
    finally:
        fmu.freeInstance()
    return dict(zip(experiment.outputs, np.array(rows).T, strict=True))


class _Access:
    """Sets and gets variables of an instance by name, whole numbers through the functions for those."""

    def __init__(self, fmu: Any, description: Any) -> None:
        self.old = description.fmiVersion.startswith("2")
        self.references = {v.name: v.valueReference for v in description.modelVariables}
        self.whole = {v.name for v in description.modelVariables if v.type in ("Integer", "Int32")}
        self.set_whole, self.get_whole = (fmu.setInteger, fmu.getInteger) if self.old else (fmu.setInt32, fmu.getInt32)
        self.set_real, self.get_real = (fmu.setReal, fmu.getReal) if self.old else (fmu.setFloat64, fmu.getFloat64)

    def set(self, values: Mapping[str, float]) -> None:
        """Values in SI."""
        whole = {name: int(value) for name, value in values.items() if name in self.whole}
        reals = {name: float(value) for name, value in values.items() if name not in self.whole}
        for some, setter in ((whole, self.set_whole), (reals, self.set_real)):
            if some:
                setter([self.references[name] for name in some], list(some.values()))

    def get(self, names: Iterable[str]) -> list[float]:
        """Values in SI."""
        return [(self.get_whole if name in self.whole else self.get_real)([self.references[name]])[0] for name in names]
