"""System structure packages (SSP 2.0, ssp-standard.org): the plant with the parameter set of each packaged device.

One package holds the FMU, a parameter set a device, and a structure a device; the one that importers open by default is
that of the reference device.
"""

import zipfile
from pathlib import Path
from xml.etree import ElementTree as ET

from gyro_model import VERSION
from gyro_model.device import load_device, packaged_devices
from gyro_model.experiments import parameter_set, xml_bytes
from gyro_model.model import Model, load_model
from gyro_model.quantities import Quantity
from gyro_model.units import dimension

SSD = "http://ssp-standard.org/SSP1/SystemStructureDescription"
SSC = "http://ssp-standard.org/SSP1/SystemStructureCommon"
DEFAULT = "reference"


def structure(model: Model, device: str) -> bytes:
    """The structure of a system that is the FMU of ``model`` alone, with the parameter set of ``device``."""
    ET.register_namespace("ssd", SSD)
    ET.register_namespace("ssc", SSC)
    about = {"version": "2.0", "name": f"{model.NAME} {device}", "generationTool": f"gyrotwin {VERSION}"}
    root = ET.Element(f"{{{SSD}}}SystemStructureDescription", about)
    system = ET.SubElement(root, f"{{{SSD}}}System", name="system")
    _add_connectors(system, model)
    elements = ET.SubElement(system, f"{{{SSD}}}Elements")
    source = {"type": "application/x-fmu-sharedlibrary", "source": f"resources/{model.NAME}.fmu"}
    plant = ET.SubElement(elements, f"{{{SSD}}}Component", {"name": "gyroscope", **source})
    _add_connectors(plant, model)
    bindings = ET.SubElement(plant, f"{{{SSD}}}ParameterBindings")
    values = {"type": "application/x-ssp-parameter-set", "source": f"resources/{device}.ssv"}
    ET.SubElement(bindings, f"{{{SSD}}}ParameterBinding", values)
    connections = ET.SubElement(system, f"{{{SSD}}}Connections")
    for quantity in model.quantities:
        if quantity.role in ("input", "output"):
            inner = {"Element": "gyroscope", "Connector": quantity.name}
            ends = ({"Connector": quantity.name}, inner)
            start, end = ends if quantity.role == "input" else reversed(ends)
            sides = {f"start{key}": value for key, value in start.items()}
            ET.SubElement(connections, f"{{{SSD}}}Connection", {**sides, **{f"end{k}": v for k, v in end.items()}})
    _add_units(root, model)
    return xml_bytes(root)


def _add_connectors(owner: ET.Element, model: Model) -> None:
    connectors = ET.SubElement(owner, f"{{{SSD}}}Connectors")
    for quantity in model.quantities:
        if quantity.role in ("input", "output"):
            one = ET.SubElement(connectors, f"{{{SSD}}}Connector", name=quantity.name, kind=quantity.role)
            ET.SubElement(one, f"{{{SSC}}}Real", unit=quantity.unit)


def _add_units(root: ET.Element, model: Model) -> None:
    units = ET.SubElement(root, f"{{{SSD}}}Units")
    for name in sorted({q.unit for q in model.quantities if q.role in ("input", "output")}):
        one = ET.SubElement(units, f"{{{SSC}}}Unit", name=name)
        exponents = zip(("kg", "m", "s", "A", "K", "rad"), dimension(name).exponents, strict=True)
        ET.SubElement(one, f"{{{SSC}}}BaseUnit", {base: str(value) for base, value in exponents if value})


def build_ssp(fmu: Path, path: Path, model: Model | None = None) -> Path:
    """Writes the package of the FMU at ``fmu``, which is that of ``model``, to ``path``; gives ``path``."""
    model = model or load_model()
    files = {f"resources/{model.NAME}.fmu": fmu.read_bytes(), "SystemStructure.ssd": structure(model, DEFAULT)}
    for name in packaged_devices():
        values = load_device(name, model).all_parameters
        own = {q.name: int(values[q.name]) if q.integer else float(values[q.name]) for q in _parameters(model)}
        files[f"resources/{name}.ssv"] = parameter_set(name, own)
        files[f"{name}.ssd"] = structure(model, name)
    path.parent.mkdir(parents=True, exist_ok=True)
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in sorted(files.items()):
            # A fixed date makes equal packages equal files.
            archive.writestr(zipfile.ZipInfo(name, (2000, 1, 1, 0, 0, 0)), data, zipfile.ZIP_DEFLATED)
    return path


def _parameters(model: Model) -> list[Quantity]:
    return [q for q in model.quantities if q.role not in ("input", "output")]
