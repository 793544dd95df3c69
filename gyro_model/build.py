"""Builds the FMUs: generates the C and XML of a model, compiles, packs, and remembers what is built by the model's
token."""

import hashlib
import itertools
import logging
import os
import shutil
import tempfile
import zipfile
from collections.abc import Callable, Mapping, Sequence
from datetime import UTC, datetime
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree as ET

import platformdirs

from gyro_model import (
    RELEASED,
    generate_c,
    generate_docs,
    generate_effects,
    generate_envelope,
    generate_forces,
    generate_package,
    generate_rooms,
    generate_series,
    generate_starts,
    generate_tangent,
    generate_xml,
    kept_token,
)
from gyro_model.clocked import clocked_model
from gyro_model.compiling import WHOLE, check_zig, compile_for, compile_library, compile_object, write_whole
from gyro_model.component.interface import KINDS
from gyro_model.component.wrap import component
from gyro_model.envelope import envelope_model
from gyro_model.errors import InputError
from gyro_model.form import Form
from gyro_model.model import Model, load_model
from gyro_model.platforms import COMPONENT, WASM, own_platform, platform_of, platforms_of
from gyro_model.progress import Progress
from gyro_model.sensor import SensorModel
from gyro_model.whole_file import whole_file

LOGGER = logging.getLogger("gyrotwin")
PACKAGE = Path(__file__).parent
CHECKOUT = PACKAGE.parent
GENERATED = "generated"
EFFECTS = f"{GENERATED}/effects.h"
TABLE = f"{GENERATED}/model.c"
WRITERS: dict[str, dict[str, Callable[[Any], str]]] = {
    "device": {EFFECTS: generate_effects.effects},
    "full": {
        f"{GENERATED}/expansions.h": generate_series.expansions,
        f"{GENERATED}/rooms.h": generate_rooms.rooms,
        f"{GENERATED}/starts.h": generate_starts.starts,
        f"{GENERATED}/tangent.h": generate_tangent.tangent,
    },
    "envelope": {f"{GENERATED}/envelope.h": generate_envelope.envelope},
    "varied": {f"{GENERATED}/forces.h": generate_forces.forces},
}
"""What is generated for a layer of C beside the tables of the FMU's variables, by its path in the sources."""


class Fmus(NamedTuple):
    """Paths of the two FMUs of a form that both standards have."""

    fmi2: Path
    fmi3: Path


def handwritten_folder() -> Path:
    """The folder of the handwritten C: beside the package in a checkout, inside it when installed."""
    for folder in (CHECKOUT / "fmu_src", PACKAGE / "fmu_src"):
        if (folder / "core.c").is_file():
            return folder
    raise InputError("C sources: found neither beside the package nor in it; install gyrotwin anew")


def handwritten_files(model: Form) -> dict[str, Path]:
    """The handwritten C of the FMU of ``model`` by name, in the order of names: what all share, then its layers."""
    folder = handwritten_folder()
    files = [path for layer in ("", *model.LAYERS) for path in (folder / layer).glob("*.[ch]")]
    return {path.name: path for path in sorted(files, key=lambda path: path.name)}


def generated_files(model: Form) -> dict[str, str]:
    """Every generated text by its path in the sources of the FMU, the token filled in."""
    return _joined(_generated_layers(model, made_token(model)))


def _joined(layers: Mapping[str, Mapping[str, str]]) -> dict[str, str]:
    return {name: text for files in layers.values() for name, text in files.items()}


def _generated_layers(model: Form, token: str) -> dict[str, dict[str, str]]:
    """The generated texts by layer, then by path in the sources; the tables are the last layer's."""
    headers = (path.read_text(encoding="utf-8") for path in handwritten_files(model).values() if path.suffix == ".h")
    layers = {layer: dict(texts) for layer, texts in _printed(model).items()}
    layers[model.LAYERS[-1]] |= {
        f"{GENERATED}/names.h": generate_c.names(model, headers),
        f"{GENERATED}/model.h": generate_c.header(model),
        TABLE: generate_c.table(model, token),
    }
    return layers


@lru_cache(maxsize=8)
def _printed(model: Form) -> Mapping[str, Mapping[str, str]]:
    """What ``WRITERS`` write by layer: some hundred effects take seconds."""
    return {name: {file: write(model) for file, write in WRITERS.get(name, {}).items()} for name in model.LAYERS}


def committed_files(model: Model) -> dict[Path, str]:
    """What a checkout holds of generated text, by path: the C of all forms, of which some share layers, and the page of
    the FMUs with its tables."""
    folder = handwritten_folder()
    files: dict[Path, str] = {}
    for form in forms(model):
        for layer, texts in _generated_layers(form, made_token(form)).items():
            files |= {folder / layer / name: text for name, text in texts.items()}
    return files | generate_docs.reference_page(CHECKOUT, model)


def forms(model: Model) -> tuple[Form, ...]:
    """All forms of ``model``: as it is, as envelopes, what a datasheet says of a gyroscope, and with a clock."""
    return (model, envelope_model(model), SensorModel(), clocked_model(model))


def model_token(model: Form) -> str:
    """Names a model: a digest of all its C and XML, so that an FMU of other effects, bounds or code has another
    token. It is the one that is kept on disk, or else made."""
    key = _token_key(model)
    return (key and kept_token.kept(key)) or made_token(model)


def made_token(model: Form) -> str:
    """The token from all that is generated, whatever is kept on disk; it is kept there from now on."""
    digest = hashlib.sha256(_generated_text(model))
    for path in handwritten_files(model).values():
        digest.update(path.read_bytes())
    code = digest.hexdigest()
    token = f"{{{code[:8]}-{code[8:12]}-{code[12:16]}-{code[16:20]}-{code[20:32]}}}"
    key = _token_key(model)
    if key and kept_token.kept(key) != token:
        kept_token.keep(key, token)
    return token


def _token_key(model: Form) -> str | None:
    """What the token of ``model`` is kept under; None where it is not kept: start values are those of one device, and
    its FMU is built for once."""
    if model.starts:
        return None
    handwritten = ((name, path.read_bytes()) for name, path in handwritten_files(model).items())
    return kept_token.key_of(model, (*handwritten, *generate_package.finished_files(model).items()))


@lru_cache(maxsize=8)
def _generated_text(model: Form) -> bytes:
    """All that is generated for a model, but for the token that follows from it."""
    describe = {"fmi2": lambda: generate_xml.fmi2(model, "", "", ()), "fmi3": lambda: generate_xml.fmi3(model, "", "")}
    texts = [*_joined(_generated_layers(model, "")).values(), *(describe[fmi]() for fmi in model.STANDARDS)]
    files = [generate_package.package_files(model, fmi) for fmi in model.STANDARDS]
    return "".join(texts).encode() + b"".join(data for package in files for data in package.values())


def default_folder(model: Form) -> Path:
    """Where FMUs of ``model`` go: ``dist`` in a checkout, else the user's cache, by token."""
    packaged = not model.effects or model.effects == load_model().effects
    if packaged and (CHECKOUT / "pyproject.toml").is_file() and handwritten_folder().parent == CHECKOUT:
        return CHECKOUT / "dist"
    return Path(platformdirs.user_cache_dir("gyrotwin")) / model_token(model).strip("{}")


def build(
    model: Form | None = None, folder: Path | None = None, *, force: bool = False, platforms: Sequence[str] = ()
) -> Fmus:
    """Builds the FMUs of a ``model`` that both standards have. Raises InputError as ``build_form`` does."""
    return Fmus(**build_form(model or load_model(), folder, force=force, platforms=platforms))


def build_form(
    model: Form,
    folder: Path | None = None,
    *,
    force: bool = False,
    platforms: Sequence[str] = (),
    compiled: Callable[[], None] = lambda: None,
) -> dict[str, Path]:
    """Builds the FMUs of ``model`` by standard, ``fmi2/NAME.fmu`` and ``fmi3/NAME.fmu`` in ``folder``, unless those
    there already are of this model and hold the libraries asked for.

    platforms: names from ``gyro_model.platforms``, compiled by zig; none: this machine's, by its own compiler. With
    wasm32-wasip2 among them the FMU for FMI 3.0 holds a component, with wasm32 ``wasm32/NAME.wasm`` the functions of
    FMI 3.0. compiled: called after each library. Raises
    InputError where there is no compiler or it fails.
    """
    folder = folder or default_folder(model)
    token = model_token(model)
    fmus = {fmi: folder / fmi / f"{model.NAME}.fmu" for fmi in model.STANDARDS}
    wanted = {fmi: _inside(platforms, fmi) for fmi in fmus}
    stale = [fmi for fmi, path in fmus.items() if force or not _fits(path, token, wanted[fmi] or [own_platform()], fmi)]
    if stale or WASM.fmi3 in platforms:
        token = made_token(model)
        with tempfile.TemporaryDirectory(prefix="gyrotwin-") as name:
            write_sources(model, Path(name))
            for fmi in stale:
                _build_one(model, token, fmi, fmus[fmi], Path(name), wanted[fmi], compiled)
            if WASM.fmi3 in platforms:
                _compile_module(Path(name), _module_path(model, folder))
                compiled()
    return fmus


def _inside(platforms: Sequence[str], fmi: str) -> list[str]:
    """Those of which an FMU can hold a library."""
    return [name for name in platforms if name != WASM.fmi3 and getattr(platform_of(name), fmi)]


def build_module(model: Form | None = None, folder: Path | None = None) -> Path:
    """Compiles the WebAssembly module of ``model``, ``wasm32/NAME.wasm`` in ``folder``, unless the one there already
    is of this model. It exports the functions of FMI 3.0, malloc and free.

    Raises InputError where the package ziglang is missing or it fails.
    """
    model = model or load_model()
    path = _module_path(model, folder or default_folder(model))
    # The token stands in the module: what it compares an importer's with.
    if not path.is_file() or model_token(model).encode() not in path.read_bytes():
        check_zig(WASM)
        LOGGER.info("compiling the %s module for web browsers, once for this model, some 10 s ...", model.NAME)
        with tempfile.TemporaryDirectory(prefix="gyrotwin-") as name:
            write_sources(model, Path(name))
            _compile_module(Path(name), path)
    return path


def _module_path(model: Form, folder: Path) -> Path:
    return folder / WASM.fmi3 / f"{model.NAME}{WASM.suffix}"


def _compile_module(sources: Path, path: Path) -> None:
    made = sources / path.name
    compile_for(WASM, sources, _in_two(sources, c_files(sources, "fmi3")), made)
    with whole_file(path) as file:
        file.write(made.read_bytes())


def _compile_component(sources: Path, files: Sequence[str], library: Path, description: str) -> None:
    """The component of an FMU for FMI 3.0, with the kinds of instances that its ``description`` has."""
    compile_for(COMPONENT, sources, [*files, str(handwritten_folder() / "component" / "component.c")], library)
    kinds = [kind for kind in KINDS if f"<{kind.element}" in description]
    library.write_bytes(component(library.read_bytes(), kinds))


def build_all(
    model: Model | None = None,
    folder: Path | None = None,
    *,
    force: bool = False,
    platforms: Sequence[str] = (),
    progress: Progress = lambda done, total: None,
) -> tuple[Path, ...]:
    """The FMUs of all forms of ``model``. progress: told the libraries compiled so far, and all where none is up to
    date. Raises InputError as ``build_form`` does."""
    every = forms(model or load_model())
    libraries = {fmi: len(_inside(platforms, fmi)) or 1 for form in every for fmi in form.STANDARDS}
    total = sum(libraries[fmi] for form in every for fmi in form.STANDARDS) + len(every) * (WASM.fmi3 in platforms)
    count = itertools.count(1)
    paths: list[Path] = []
    for form in every:
        fmus = build_form(form, folder, force=force, platforms=platforms, compiled=lambda: progress(next(count), total))
        paths += fmus.values()
    return tuple(paths)


def token_of(path: Path) -> str | None:
    """The token of the FMU at ``path``; None where there is no FMU."""
    try:
        with zipfile.ZipFile(path) as archive:
            root = ET.fromstring(archive.read("modelDescription.xml"))
    except (OSError, KeyError, zipfile.BadZipFile, ET.ParseError):
        return None
    return root.get("guid") or root.get("instantiationToken")


def _fits(path: Path, token: str, platforms: Sequence[str], fmi: str) -> bool:
    return token_of(path) == token and {getattr(platform_of(name), fmi) for name in platforms} <= platforms_of(path)


def update_generated(model: Model | None = None) -> list[Path]:
    """Writes the committed generated files and tables anew; gives those that changed."""
    changed = []
    for path, text in committed_files(model or load_model()).items():
        if not path.is_file() or path.read_text(encoding="utf-8") != text:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, encoding="utf-8")
            changed.append(path)
    return changed


def write_sources(model: Form, folder: Path) -> None:
    """Copies the handwritten C and writes the generated C into ``folder``."""
    for name, path in handwritten_files(model).items():
        shutil.copy(path, folder / name)
    for name, text in generated_files(model).items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_text(text, encoding="utf-8")


def c_files(folder: Path, fmi: str) -> list[str]:
    """The C files of one FMU, relative to ``folder``: all but the layer of the other FMI version."""
    other = {"fmi2": "fmi3.c", "fmi3": "fmi2.c"}[fmi]
    return sorted(
        path.relative_to(folder).as_posix() for path in folder.rglob("*.c") if path.name not in (other, WHOLE)
    )


def _in_two(sources: Path, files: Sequence[str]) -> list[str]:
    """A file that includes all C ``files`` but the table of variables, and that table."""
    return [write_whole(sources, [name for name in files if name != TABLE]), TABLE]


def _build_one(
    model: Form, token: str, fmi: str, path: Path, sources: Path, platforms: Sequence[str], compiled: Callable[[], None]
) -> None:
    """Packs an FMU of the C in ``sources`` with libraries for ``platforms``; none: for this machine. ``compiled`` is
    called after each."""

    def begin() -> None:
        LOGGER.info("compiling the %s FMU for %s, once for this model, some 5 s ...", model.NAME, fmi.upper())

    files = c_files(sources, fmi)
    other = {"fmi2": "fmi3.c", "fmi3": "fmi2.c"}[fmi]
    with tempfile.TemporaryDirectory(prefix="gyrotwin-") as name:
        root = Path(name) / "fmu"
        shutil.copytree(sources, root / "sources", ignore=shutil.ignore_patterns(other, WHOLE))
        whole = _in_two(sources, files)
        if fmi == "fmi2":
            description = generate_xml.fmi2(model, token, issue_date(), files)
        else:
            description = generate_xml.fmi3(model, token, issue_date())
            build_description = generate_xml.build_description(model, files)
            (root / "sources" / "buildDescription.xml").write_text(build_description, encoding="utf-8")
        (root / "modelDescription.xml").write_text(description, encoding="utf-8")
        announced = generate_package.component_files() if COMPONENT.fmi3 in platforms else {}
        for place, data in (generate_package.package_files(model, fmi) | announced).items():
            (root / place).parent.mkdir(parents=True, exist_ok=True)
            (root / place).write_bytes(data)
        for platform in map(platform_of, platforms or (own_platform(),)):
            if platforms:
                LOGGER.info("compiling the %s FMU for %s on %s ...", model.NAME, fmi.upper(), platform.fmi3)
            library = root / "binaries" / getattr(platform, fmi) / f"{model.NAME}{platform.suffix}"
            library.parent.mkdir(parents=True)
            if platform == COMPONENT:
                _compile_component(sources, whole, library, description)
            elif platforms:
                compile_for(platform, sources, whole, library)
            else:
                made = Path(name) / "whole.o"
                compile_object(sources, whole[0], TABLE, made, begin, model.compiler_flags)
                compile_library(sources, [str(made), TABLE], library)
            compiled()
        pack({p.relative_to(root).as_posix(): p.read_bytes() for p in root.rglob("*") if p.is_file()}, path)


def issue_date() -> str:
    """What an FMU gives as its date: one that is built again is the same (reproducible-builds.org)."""
    epoch = os.environ.get("SOURCE_DATE_EPOCH", "")
    return datetime.fromtimestamp(int(epoch), UTC).strftime("%Y-%m-%dT%H:%M:%SZ") if epoch.isdigit() else RELEASED


def pack(files: Mapping[str, bytes], path: Path) -> None:
    """Writes an FMU of ``files`` by name; equal files give an equal FMU."""
    with whole_file(path) as file, zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        for name in sorted(files, key=lambda name: name.split("/")):
            # A fixed date makes equal models give equal files.
            info = zipfile.ZipInfo(name, (2000, 1, 1, 0, 0, 0))
            info.external_attr = (0o755 if name.startswith("binaries/") else 0o644) << 16
            info.compress_type = zipfile.ZIP_DEFLATED
            archive.writestr(info, files[name])
