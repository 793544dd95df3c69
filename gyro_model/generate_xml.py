"""Writes ``modelDescription.xml`` of a model for FMI 2.0 and FMI 3.0, and the build description of FMI 3.0."""

from collections.abc import Sequence
from math import isfinite
from xml.etree import ElementTree as ET

from gyro_model import VERSION
from gyro_model.continuous_states import continuous_states, first_clock, hidden_states
from gyro_model.form import Form
from gyro_model.quantities import Quantity
from gyro_model.units import DISPLAYED, dimension, rate_unit

TOOL = f"gyrotwin {VERSION}"
ABOUT = {
    "author": "The gyrotwin authors",
    "version": VERSION,
    "copyright": "Copyright (c) 2026 The gyrotwin authors",
    "license": "MIT",
}
LOG_CATEGORIES = {"logStatusError": "refused calls and failed steps", "logEvents": "life-cycle calls", "logAll": "both"}


def fmi2(model: Form, token: str, date: str, sources: Sequence[str]) -> str:
    """The model description for FMI 2.0; ``date`` of generation as in 2026-11-22T00:00:00Z; ``sources`` are the C
    files relative to the folder sources/."""
    states = continuous_states(model)
    root = ET.Element("fmiModelDescription", fmiVersion="2.0", modelName=model.NAME, guid=token)
    _add_about(root, model, date)
    root.set("variableNamingConvention", "flat")
    if states:
        root.set("numberOfEventIndicators", "0")
    saving = {"canGetAndSetFMUstate": "true", "canSerializeFMUstate": "true"}
    common = {"modelIdentifier": model.NAME, "canNotUseMemoryManagementFunctions": "true", **saving}
    common |= {"providesDirectionalDerivative": "true"} if states else {}
    interfaces = (
        [ET.SubElement(root, "ModelExchange", common, completedIntegratorStepNotNeeded="true")] if states else []
    )
    interfaces += [ET.SubElement(root, "CoSimulation", common, canHandleVariableCommunicationStepSize="true")]
    for interface in interfaces:
        files = ET.SubElement(interface, "SourceFiles")
        for name in sources:
            ET.SubElement(files, "File", name=name)
    _add_units(root, model)
    _add_log_categories(root)
    ET.SubElement(root, "DefaultExperiment", startTime="0", stopTime="1", stepSize=model.STEP_SIZE)
    variables = ET.SubElement(root, "ModelVariables")
    reinit = {state.reference: {"reinit": "true"} for state in states}
    for reference, quantity in enumerate(model.quantities):
        scalar = ET.SubElement(variables, "ScalarVariable", _common(quantity, reference, model))
        typed = _typed(quantity, model) | reinit.get(reference, {})
        ET.SubElement(scalar, "Integer" if quantity.integer else "Real", typed)
    if states:
        ET.SubElement(ET.SubElement(variables, "ScalarVariable", _time(model)), "Real", unit="s")
    for names, typed in _locals(model):
        # FMI 2 counts variables from 1 where FMI 3 names them by reference.
        own = {key: str(int(value) + 1) if key == "derivative" else value for key, value in typed.items()}
        ET.SubElement(ET.SubElement(variables, "ScalarVariable", names), "Real", own)
    structure = ET.SubElement(root, "ModelStructure")
    rates = [state.rate_reference for state in states]
    groups = {"Outputs": _outputs(model), "Derivatives": rates, "InitialUnknowns": _initial_unknowns(model)}
    for group, references in groups.items():
        element = ET.SubElement(structure, group) if references else structure
        for reference in references:
            unknown = ET.SubElement(element, "Unknown", index=str(reference + 1))
            if group != "InitialUnknowns" and (known := _dependencies(model, reference)) is not None:
                unknown.set("dependencies", " ".join(str(other + 1) for other in known))
    return text_of(root)


def fmi3(model: Form, token: str, date: str) -> str:
    """The model description for FMI 3.0; ``date`` as for ``fmi2``."""
    states = continuous_states(model)
    root = ET.Element("fmiModelDescription", fmiVersion="3.0", modelName=model.NAME, instantiationToken=token)
    _add_about(root, model, date)
    common = {"modelIdentifier": model.NAME, "canGetAndSetFMUState": "true", "canSerializeFMUState": "true"}
    if states:
        common |= {"providesDirectionalDerivatives": "true", "providesAdjointDerivatives": "true"}
    if states and not model.CLOCKS:
        ET.SubElement(root, "ModelExchange", common, needsCompletedIntegratorStep="false")
    ET.SubElement(
        root,
        "CoSimulation",
        common,
        canHandleVariableCommunicationStepSize="true",
        providesIntermediateUpdate="true",
        canReturnEarlyAfterIntermediateUpdate="true",
        **({"hasEventMode": "true"} if states else {}),
    )
    _add_units(root, model)
    _add_log_categories(root)
    ET.SubElement(root, "DefaultExperiment", startTime="0", stopTime="1", stepSize=model.STEP_SIZE)
    variables = ET.SubElement(root, "ModelVariables")
    reinit = {state.reference: {"reinit": "true"} for state in states}
    for reference, quantity in enumerate(model.quantities):
        tag = "Int32" if quantity.integer else "Float64"
        typed = _typed(quantity, model) | reinit.get(reference, {})
        ET.SubElement(variables, tag, {**_common(quantity, reference, model), **typed, **_clocks_of(quantity, model)})
    ET.SubElement(variables, "Float64", _time(model), unit="s")
    for names, typed in _locals(model):
        ET.SubElement(variables, "Float64", {**names, **typed})
    clocks = [first_clock(model) + i for i in range(len(model.CLOCKS))]
    for reference, clock in zip(clocks, model.CLOCKS, strict=True):
        names = {"name": clock.name, "valueReference": str(reference), "description": clock.description}
        ticks = {"causality": "output", "variability": "discrete", "intervalVariability": "triggered"}
        ET.SubElement(variables, "Clock", names | ticks)
    structure = ET.SubElement(root, "ModelStructure")
    rates = [state.rate_reference for state in states]
    groups = {
        "Output": [*_outputs(model), *clocks],
        "ContinuousStateDerivative": rates,
        "InitialUnknown": [*_initial_unknowns(model), *clocks],
    }
    for group, references in groups.items():
        for reference in references:
            unknown = ET.SubElement(structure, group, valueReference=str(reference))
            if group != "InitialUnknown" and (known := _dependencies(model, reference)) is not None:
                unknown.set("dependencies", " ".join(map(str, known)))
    return text_of(root)


def _clocks_of(quantity: Quantity, model: Form) -> dict[str, str]:
    own = [str(first_clock(model) + i) for i, clock in enumerate(model.CLOCKS) if quantity.name in clock.clocked]
    return {"clocks": " ".join(own)} if own else {}


def _time(model: Form) -> dict[str, str]:
    names = {"name": "time", "valueReference": str(len(model.quantities)), "description": "simulation time"}
    return names | {"causality": "independent", "variability": "continuous"}


def _locals(model: Form) -> list[tuple[dict[str, str], dict[str, str]]]:
    """Names and types of the states that are no outputs, then of all rates."""
    states = continuous_states(model)
    kept = {"causality": "local", "variability": "continuous", "initial": "calculated"}
    rows = []
    for state in hidden_states(model):
        names = {"name": state.name, "valueReference": str(state.reference), "description": state.description}
        unit = {} if state.unit == "1" else {"unit": state.unit}
        rows.append((names | kept, unit | {"nominal": repr(state.nominal), "reinit": "true"}))
    for state in states:
        text = f"rate of {state.name}"
        names = {"name": state.rate_name, "valueReference": str(state.rate_reference), "description": text}
        rows.append((names | kept, {"unit": rate_unit(state.unit), "derivative": str(state.reference)}))
    return rows


def _initial_unknowns(model: Form) -> list[int]:
    states = continuous_states(model)
    hidden = [state.reference for state in hidden_states(model)]
    clocked = {name for clock in model.CLOCKS for name in clock.clocked}
    outputs = [reference for reference in _outputs(model) if model.quantities[reference].name not in clocked]
    return [*outputs, *hidden, *(state.rate_reference for state in states)]


def _dependencies(model: Form, reference: int) -> list[int] | None:
    """What an output or rate depends on; None: on all inputs and states. A sample depends on nothing between events,
    and the outputs of a co-simulation are those of the last communication point: no loop through it is algebraic."""
    states = continuous_states(model)
    if reference >= first_clock(model):
        return []
    if not states or reference < len(model.quantities):
        name = model.quantities[reference].name
        own = [state.reference for state in states if state.reference == reference]
        if states and name.startswith("temperature"):
            names = {s.name: s.reference for s in states}
            inputs = [i for i, q in enumerate(model.quantities) if q.role == "input" and q.name == "temperature"]
            return [*inputs, names[f"{name}_lagging"]]
        return own
    [state] = [state for state in states if state.rate_reference == reference]
    speeds = {f"{name}_dot": name for name in ("x", "y")}
    return [s.reference for s in states if speeds.get(s.name) == state.name] or None


def build_description(model: Form, sources: Sequence[str]) -> str:
    """``sources/buildDescription.xml`` of FMI 3.0."""
    root = ET.Element("fmiBuildDescription", fmiVersion="3.0")
    configuration = ET.SubElement(root, "BuildConfiguration", modelIdentifier=model.NAME)
    files = ET.SubElement(configuration, "SourceFileSet", language="C99", compilerOptions="-O3 -ffp-contract=off")
    for name in sources:
        ET.SubElement(files, "SourceFile", name=name)
    return text_of(root)


def _add_about(root: ET.Element, model: Form, date: str) -> None:
    root.set("description", model.DESCRIPTION)
    for name, value in ABOUT.items():
        root.set(name, value)
    root.set("generationTool", TOOL)
    root.set("generationDateAndTime", date)


def _outputs(model: Form) -> list[int]:
    return [reference for reference, q in enumerate(model.quantities) if q.role == "output"]


def _common(quantity: Quantity, reference: int, model: Form) -> dict[str, str]:
    attributes = {"name": quantity.name, "valueReference": str(reference), "description": quantity.description}
    if quantity.role in ("input", "output"):
        attributes |= {"causality": quantity.role, "variability": "discrete" if quantity.discrete else "continuous"}
        return attributes | ({"initial": "calculated"} if quantity.role == "output" else {})
    variability = "tunable" if quantity.name in model.tunable else "fixed"
    return attributes | {"causality": "parameter", "variability": variability, "initial": "exact"}


def _typed(quantity: Quantity, model: Form) -> dict[str, str]:
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


def _add_units(root: ET.Element, model: Form) -> None:
    definitions = ET.SubElement(root, "UnitDefinitions")
    rates = (rate_unit(state.unit) for state in continuous_states(model))
    shown = {unit: set[str]() for unit in (*(q.unit for q in model.quantities), "s", *rates)}
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
