"""What an FMU holds beside description, sources and binaries: documentation, licence, icon, terminals."""

from collections.abc import Iterable, Sequence
from html import escape
from math import isfinite
from pathlib import Path
from xml.etree import ElementTree as ET

from gyro_model import VERSION, icon
from gyro_model.errors import InputError
from gyro_model.experiments import FOLDER, LS, layered_standard, manifest, packaged_experiments, xml_bytes
from gyro_model.form import Form
from gyro_model.generate_xml import text_of
from gyro_model.quantities import Quantity
from gyro_model.units import DISPLAYED

_TERMINALS = {
    "mechanical": "forces on the mass and its motion",
    "electrical": "sensor voltages and electrodes",
    "inertial": "motion of the package",
    "thermal": "temperatures",
}


def package_files(model: Form, fmi: str) -> dict[str, bytes]:
    """The files by path in the FMU; ``fmi`` is "fmi2" or "fmi3". Raises InputError where the licence is missing."""
    files = {"documentation/index.html": documentation(model).encode()} | finished_files(model)
    if any(name.startswith(f"{FOLDER}/") for name in files):
        files[f"{FOLDER}/fmi-ls-manifest.xml"] = manifest()
    if fmi == "fmi2":
        return files | {"model.png": icon.png()}
    return files | {
        "terminalsAndIcons/terminalsAndIcons.xml": terminals(model).encode(),
        "terminalsAndIcons/icon.png": icon.png(),
        "terminalsAndIcons/icon.svg": icon.svg().encode(),
    }


def finished_files(model: Form) -> dict[str, bytes]:
    """Those of ``package_files`` that are not generated: the licence and the reference traces. Raises InputError where
    the licence is missing."""
    traces = {} if model.starts else packaged_experiments(model.TRACES or model.NAME)
    return {
        "documentation/licenses/license.txt": _licence().read_bytes(),
        **{f"{FOLDER}/{name}": data for name, data in traces.items()},
    }


def component_files() -> dict[str, bytes]:
    """What announces a WebAssembly component, by path in the FMU: the draft of fmi-ls-wasm has another name for it than
    FMI 3.0."""
    name = "org.modelica.fmi-ls-wasm"
    about = layered_standard(name, "0.1.0", "FMI Layered Standard for WebAssembly")
    data = xml_bytes(ET.Element(f"{{{LS}}}fmiLayeredStandardManifest", about))
    return {f"extra/{name}/{file}": data for file in ("manifest.xml", "fmi-ls-manifest.xml")}


def _licence() -> Path:
    package = Path(__file__).parent
    for folder in (package.parent, package):
        if (folder / "LICENSE").is_file():
            return folder / "LICENSE"
    raise InputError("LICENSE: found neither beside the package nor in it; install gyrotwin anew")


def terminals(model: Form) -> str:
    """``terminalsAndIcons.xml`` of FMI 3.0: inputs and outputs by what they connect to."""
    root = ET.Element("fmiTerminalsAndIcons", fmiVersion="3.0")
    corners = {"x1": "-100", "y1": "-100", "x2": "100", "y2": "100"}
    graphics = ET.SubElement(root, "GraphicalRepresentation")
    ET.SubElement(graphics, "CoordinateSystem", {**corners, "suggestedScalingFactorTo_mm": "0.1"})
    ET.SubElement(graphics, "Icon", corners)
    groups = ET.SubElement(root, "Terminals")
    for name, description in _TERMINALS.items():
        members = [q.name for q in model.quantities if q.terminal == name]
        if members:
            group = ET.SubElement(groups, "Terminal", name=name, matchingRule="bus", description=description)
        for member in members:
            ET.SubElement(
                group, "TerminalMemberVariable", variableName=member, memberName=member, variableKind="signal"
            )
    return text_of(root)


def documentation(model: Form) -> str:
    """``documentation/index.html``: conventions, every variable, every effect."""
    groups = {
        "Inputs": [q for q in model.quantities if q.role == "input"],
        "Outputs": [q for q in model.quantities if q.role == "output"],
        "Parameters": [q for q in model.quantities if q.role == "parameter"],
        "Parameters of effects": [q for q in model.quantities if q.role in ("size", "shape", "start")],
    }
    heading = ("name", "unit", "shown in", "start", "lowest", "highest", "nominal", "changes", "what")
    tables = "".join(
        f"<h2>{title}</h2>\n{_table(heading, (_row(q, model) for q in members))}" for title, members in groups.items()
    )
    effects = (
        (
            f"<code>{e.id}</code>",
            "always acts"
            if e.nominal
            else ", ".join(f"<code>{q.name}</code>" for q in e.parameters if q.name in model.by_name),
            escape(e.stage),
            f"<pre>{escape(e.doc.strip())}</pre>",
        )
        for e in model.effects
    )
    listed = _table(("effect", "parameters", "stage", "what"), effects)
    chapter = f"<h2>Effects</h2>\n{listed}" if model.effects else ""
    conventions = "".join(f"<p>{escape(text)}</p>\n" for text in model.CONVENTIONS)
    return f"""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<title>{model.NAME}</title>
<style>
body {{ font: 15px/1.5 sans-serif; max-width: 70em; margin: 2em auto; padding: 0 1em; }}
table {{ border-collapse: collapse; display: block; overflow-x: auto; }}
td, th {{ border: 1px solid #999; padding: 0.2em 0.5em; text-align: left; vertical-align: top; }}
</style>
</head>
<body>
<h1>{model.NAME}</h1>
<p>{escape(model.DESCRIPTION)}. Version {VERSION}; licence: <a href="licenses/license.txt">MIT</a>.</p>
<h2>Conventions</h2>
{conventions}{tables}{chapter}</body>
</html>
"""


def _row(quantity: Quantity, model: Form) -> Sequence[str]:
    def number(value: float) -> str:
        return f"{value:g}" if isfinite(value) else ""

    factor, offset = DISPLAYED[quantity.unit][quantity.display] if quantity.display else (1.0, 0.0)
    shown = f"{escape(quantity.display)}: {factor:g}{f' SI {offset:+g}' if offset else ''}" if quantity.display else ""
    computed = quantity.role == "output"
    changes = "tunable" if quantity.name in model.tunable else "" if quantity.role in ("input", "output") else "fixed"
    return (
        f"<code>{quantity.name}</code>",
        escape(quantity.unit),
        shown,
        "" if computed else number(model.start(quantity)),
        number(quantity.low),
        number(quantity.high),
        number(quantity.typical) if quantity.typical else "",
        changes,
        escape(quantity.description),
    )


def _table(heading: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    cells = ["".join(f"<td>{cell}</td>" for cell in row) for row in rows]
    head = "".join(f"<th>{cell}</th>" for cell in heading)
    return f"<table>\n<tr>{head}</tr>\n" + "".join(f"<tr>{row}</tr>\n" for row in cells) + "</table>\n"
