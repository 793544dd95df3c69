"""Writes ``modelDescription.xml`` of a model for FMI 2.0 and FMI 3.0, and the build description of FMI 3.0."""

from collections.abc import Sequence
from math import isfinite
from xml.etree import ElementTree as ET

from gyro_model import VERSION
from gyro_model.model import Model
from gyro_model.quantities import Quantity
from gyro_model.units import DISPLAYED, dimension

TOOL = f"gyrotwin {VERSION}"
ABOUT = {
    "author": "The gyrotwin authors",
    "version": VERSION,
    "copyright": "Copyright (c) 2026 The gyrotwin authors",
    "license": "MIT",
}
LOG_CATEGORIES = {"logStatusError": "refused calls and failed steps", "logEvents": "life-cycle calls", "logAll": "both"}


def fmi2(model: Model, token: str, date: str, sources: Sequence[str]) -> str:
    """The model description for FMI 2.0; ``date`` of generation as in 2026-11-22T00:00:00Z; ``sources`` are the C
    files relative to the folder sources/."""
    root = ET.Element("fmiModelDescription", fmiVersion="2.0", modelName=model.NAME, guid=token)
    _add_about(root, model, date)
    root.set("variableNamingConvention", "flat")
    simulation = ET.SubElement(
        root,
        "CoSimulation",
        modelIdentifier=model.NAME,
        canHandleVariableCommunicationStepSize="true",
        canNotUseMemoryManagementFunctions="true",
        canGetAndSetFMUstate="true",
        canSerializeFMUstate="true",
    )
    files = ET.SubElement(simulation, "SourceFiles")
    for name in sources:
        ET.SubElement(files, "File", name=name)
    _add_units(root, model)
    _add_log_categories(root)
    ET.SubElement(root, "DefaultExperiment", startTime="0", stopTime="1", stepSize=model.STEP_SIZE)
    variables = ET.SubElement(root, "ModelVariables")
    for reference, quantity in enumerate(model.quantities):
        scalar = ET.SubElement(variables, "ScalarVariable", _common(quantity, reference, model))
        ET.SubElement(scalar, "Integer" if quantity.integer else "Real", _typed(quantity, model))
    structure = ET.SubElement(root, "ModelStructure")
    for group in ("Outputs", "InitialUnknowns"):
        element = ET.SubElement(structure, group)
        for reference in _outputs(model):
            unknown = ET.SubElement(element, "Unknown", index=str(reference + 1))
            if group == "Outputs":
                # Outputs are those of the last communication point: no loop through the FMU is algebraic.
                unknown.set("dependencies", "")
    return text_of(root)


def fmi3(model: Model, token: str, date: str) -> str:
    """The model description for FMI 3.0; ``date`` as for ``fmi2``."""
    root = ET.Element("fmiModelDescription", fmiVersion="3.0", modelName=model.NAME, instantiationToken=token)
    _add_about(root, model, date)
    ET.SubElement(
        root,
        "CoSimulation",
        modelIdentifier=model.NAME,
        canHandleVariableCommunicationStepSize="true",
        providesIntermediateUpdate="true",
        canReturnEarlyAfterIntermediateUpdate="true",
        canGetAndSetFMUState="true",
        canSerializeFMUState="true",
    )
    _add_units(root, model)
    _add_log_categories(root)
    ET.SubElement(root, "DefaultExperiment", startTime="0", stopTime="1", stepSize=model.STEP_SIZE)
    variables = ET.SubElement(root, "ModelVariables")
    for reference, quantity in enumerate(model.quantities):
        tag = "Int32" if quantity.integer else "Float64"
        ET.SubElement(variables, tag, {**_common(quantity, reference, model), **_typed(quantity, model)})
    time = {"name": "time", "valueReference": str(len(model.quantities)), "causality": "independent", "unit": "s"}
    ET.SubElement(variables, "Float64", {**time, "variability": "continuous", "description": "simulation time"})
    structure = ET.SubElement(root, "ModelStructure")
    for group in ("Output", "InitialUnknown"):
        for reference in _outputs(model):
            unknown = ET.SubElement(structure, group, valueReference=str(reference))
            if group == "Output":
                unknown.set("dependencies", "")
    return text_of(root)


def build_description(model: Model, sources: Sequence[str]) -> str:
    """``sources/buildDescription.xml`` of FMI 3.0."""
    root = ET.Element("fmiBuildDescription", fmiVersion="3.0")
    configuration = ET.SubElement(root, "BuildConfiguration", modelIdentifier=model.NAME)
    files = ET.SubElement(configuration, "SourceFileSet", language="C99", compilerOptions="-O3 -ffp-contract=off")
    for name in sources:
        ET.SubElement(files, "SourceFile", name=name)
    return text_of(root)


def _add_about(root: ET.Element, model: Model, date: str) -> None:
    root.set("description", model.DESCRIPTION)
    for name, value in ABOUT.items():
        root.set(name, value)
    root.set("generationTool", TOOL)
    root.set("generationDateAndTime", date)


def _outputs(model: Model) -> list[int]:
    return [reference for reference, q in enumerate(model.quantities) if q.role == "output"]


def _common(quantity: Quantity, reference: int, model: Model) -> dict[str, str]:
    attributes = {"name": quantity.name, "valueReference": str(reference), "description": quantity.description}
    if quantity.role in ("input", "output"):
        sampled = quantity.role == "output" and quantity.name.startswith("v_")
        attributes |= {"causality": quantity.role, "variability": "discrete" if sampled else "continuous"}
        return attributes | ({"initial": "calculated"} if quantity.role == "output" else {})
    variability = "tunable" if quantity.name in model.tunable else "fixed"
    return attributes | {"causality": "parameter", "variability": variability, "initial": "exact"}


def _typed(quantity: Quantity, model: Model) -> dict[str, str]:
    def number(value: float) -> str:
        return str(int(value)) if quantity.integer else repr(float(value))

    attributes = {} if quantity.unit == "1" else {"unit": quantity.unit}
    if quantity.display:
        attributes["displayUnit"] = quantity.display
    bounds = {"min": quantity.low, "max": quantity.high}
    attributes |= {name: number(value) for name, value in bounds.items() if isfinite(value)}
    if quantity.typical and not quantity.integer:
        attributes["nominal"] = number(quantity.typical)
    return attributes | ({} if quantity.role == "output" else {"start": number(model.start(quantity))})


def _add_units(root: ET.Element, model: Model) -> None:
    definitions = ET.SubElement(root, "UnitDefinitions")
    shown = {q.unit: set[str]() for q in model.quantities} | {"s": set()}
    for quantity in model.quantities:
        shown[quantity.unit] |= {quantity.display} - {""}
    for name in sorted(shown):
        if name == "1":
            continue
        unit = ET.SubElement(definitions, "Unit", name=name)
        exponents = dict(zip(("kg", "m", "s", "A", "K", "rad"), dimension(name).exponents, strict=True))
        # FMI knows whole exponents only; a unit such as V/Hz0.5 goes by its name.
        if all(value.denominator == 1 for value in exponents.values()):
            ET.SubElement(unit, "BaseUnit", {base: str(value) for base, value in exponents.items() if value})
        for display in sorted(shown[name]):
            factor, offset = DISPLAYED[name][display]
            shift = {"offset": repr(offset)} if offset else {}
            ET.SubElement(unit, "DisplayUnit", {"name": display, "factor": repr(factor), **shift})


def _add_log_categories(root: ET.Element) -> None:
    categories = ET.SubElement(root, "LogCategories")
    for name, description in LOG_CATEGORIES.items():
        ET.SubElement(categories, "Category", name=name, description=description)


def text_of(root: ET.Element) -> str:
    """``root`` as an XML file."""
    ET.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ET.tostring(root, encoding="unicode") + "\n"
