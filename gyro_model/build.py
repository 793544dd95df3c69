"""Builds the FMUs: generates the C and XML of a model, compiles, packs, and remembers what is built by the model's
token."""

import hashlib
import importlib.util
import logging
import os
import shlex
import shutil
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Sequence
from datetime import UTC, datetime
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree as ET

import platformdirs

from gyro_model import (
    RELEASED,
    generate_c,
    generate_docs,
    generate_effects,
    generate_envelope,
    generate_package,
    generate_tangent,
    generate_xml,
)
from gyro_model.envelope import EnvelopeModel, envelope_model
from gyro_model.errors import InputError
from gyro_model.model import Model, load_model

LOGGER = logging.getLogger("gyrotwin")
PACKAGE = Path(__file__).parent
CHECKOUT = PACKAGE.parent
# Strict arithmetic: contraction to fused multiply-add would make platforms differ in the last bit. Nothing asks for
# errno, so that a root is one instruction.
STRICT = ("-ffp-contract=off", "-fno-math-errno")
FLAGS = ("-std=c99", "-O3", *STRICT, "-fvisibility=hidden", "-Wall", "-Wextra", "-Wpedantic")
GENERATED = "generated"
EFFECTS = f"{GENERATED}/effects.h"
# Below the folder of the handwritten C: what the envelope form has of its own. A file there takes the place of the
# one of the same name.
ENVELOPE = "envelope"
FULL_ALONE = ("integrator.h", "linear.h", "lag.c", "lag.h", "pink.c", "pink.h")


class Fmus(NamedTuple):
    """Paths of the two FMUs of a model."""

    fmi2: Path
    fmi3: Path


class _Platform(NamedTuple):
    fmi2: str
    fmi3: str
    suffix: str


def _platform() -> _Platform:
    import fmpy

    suffix = {"win32": ".dll", "darwin": ".dylib"}.get(sys.platform, ".so")
    return _Platform(fmpy.platform, fmpy.platform_tuple, suffix)


def handwritten_folder() -> Path:
    """The folder of the handwritten C: beside the package in a checkout, inside it when installed."""
    for folder in (CHECKOUT / "fmu_src", PACKAGE / "fmu_src"):
        if (folder / "core.c").is_file():
            return folder
    raise InputError("C sources: found neither beside the package nor in it; install gyrotwin anew")


def handwritten_files(model: Model) -> dict[str, Path]:
    """The handwritten C of the FMU of ``model`` by name, in the order of names."""
    folder = handwritten_folder()
    files = {path.name: path for path in folder.glob("*.[ch]")}
    if isinstance(model, EnvelopeModel):
        files = {name: path for name, path in files.items() if name not in FULL_ALONE}
        files |= {path.name: path for path in (folder / ENVELOPE).glob("*.[ch]")}
    return dict(sorted(files.items()))


def generated_files(model: Model) -> dict[str, str]:
    """Every generated text by its path in the sources of the FMU, the token filled in."""
    return _generated_files(model, model_token(model))


def _generated_files(model: Model, token: str) -> dict[str, str]:
    headers = (path.read_text(encoding="utf-8") for path in handwritten_files(model).values() if path.suffix == ".h")
    files = {
        f"{GENERATED}/names.h": generate_c.names(model, headers),
        f"{GENERATED}/model.h": generate_c.header(model, token),
        f"{GENERATED}/model.c": generate_c.table(model),
        EFFECTS: generate_effects.effects(model),
    }
    if isinstance(model, EnvelopeModel):
        files[f"{GENERATED}/envelope.h"] = generate_envelope.envelope(model)
    else:
        files[f"{GENERATED}/tangent.h"] = generate_tangent.tangent(model)
    return files


def committed_files(model: Model) -> dict[Path, str]:
    """What a checkout holds of generated text, by path: the C of both forms of ``model``, which share the effects, and
    README.md with its tables."""
    folder = handwritten_folder()
    own = {name: text for name, text in generated_files(envelope_model(model)).items() if name != EFFECTS}
    files = {folder / name: text for name, text in generated_files(model).items()}
    files |= {folder / ENVELOPE / name: text for name, text in own.items()}
    return files | generate_docs.readme(CHECKOUT, model)


def model_token(model: Model) -> str:
    """Names a model: a digest of all its C and XML, so that an FMU of other effects, bounds or code has another
    token."""
    digest = hashlib.sha256(_generated_text(model))
    for path in handwritten_files(model).values():
        digest.update(path.read_bytes())
    code = digest.hexdigest()
    return f"{{{code[:8]}-{code[8:12]}-{code[12:16]}-{code[16:20]}-{code[20:32]}}}"


@lru_cache(maxsize=8)
def _generated_text(model: Model) -> bytes:
    """All that is generated for a model. Kept: printing some hundred effects takes a second, at each load of an FMU."""
    texts = [
        *_generated_files(model, "").values(),
        generate_xml.fmi2(model, "", "", ()),
        generate_xml.fmi3(model, "", ""),
    ]
    files = [generate_package.package_files(model, fmi) for fmi in Fmus._fields]
    return "".join(texts).encode() + b"".join(data for package in files for data in package.values())


def default_folder(model: Model) -> Path:
    """Where FMUs of ``model`` go: ``dist`` in a checkout, else the user's cache, by token."""
    packaged = model.effects == load_model().effects
    if packaged and (CHECKOUT / "pyproject.toml").is_file() and handwritten_folder().parent == CHECKOUT:
        return CHECKOUT / "dist"
    return Path(platformdirs.user_cache_dir("gyrotwin")) / model_token(model).strip("{}")


def build(model: Model | None = None, folder: Path | None = None, *, force: bool = False) -> Fmus:
    """Builds the FMUs of ``model``, ``fmi2/NAME.fmu`` and ``fmi3/NAME.fmu`` in ``folder``, unless those there already
    are of this model.

    Raises InputError where there is no compiler or it fails.
    """
    model = model or load_model()
    folder = folder or default_folder(model)
    token = model_token(model)
    fmus = Fmus(*(folder / name / f"{model.NAME}.fmu" for name in Fmus._fields))
    for fmi, path in zip(Fmus._fields, fmus, strict=True):
        if force or token_of(path) != token:
            _build_one(model, token, fmi, path)
    return fmus


def build_all(model: Model | None = None, folder: Path | None = None, *, force: bool = False) -> tuple[Path, ...]:
    """The FMUs of both forms of ``model``: as it is, then as envelopes. Raises InputError as ``build`` does."""
    full = model or load_model()
    return (*build(full, folder, force=force), *build(envelope_model(full), folder, force=force))


def token_of(path: Path) -> str | None:
    """The token of the FMU at ``path``; None where there is no FMU."""
    try:
        with zipfile.ZipFile(path) as archive:
            root = ET.fromstring(archive.read("modelDescription.xml"))
    except (OSError, KeyError, zipfile.BadZipFile, ET.ParseError):
        return None
    return root.get("guid") or root.get("instantiationToken")


def update_generated(model: Model | None = None) -> list[Path]:
    """Writes the committed generated files and tables anew; gives those that changed."""
    changed = []
    for path, text in committed_files(model or load_model()).items():
        if not path.is_file() or path.read_text(encoding="utf-8") != text:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, encoding="utf-8")
            changed.append(path)
    return changed


def find_compiler() -> list[str]:
    """The command of the C compiler: $CC, cc, gcc, clang, or that of the package ziglang. Raises InputError where
    there is none."""
    asked = shlex.split(os.environ.get("CC", ""))
    if asked:
        if shutil.which(asked[0]) is None:
            raise InputError(f"compiler CC={asked[0]!r}: not found; correct CC or unset it")
        return asked
    for name in ("cc", "gcc", "clang"):
        if shutil.which(name):
            return [name]
    if importlib.util.find_spec("ziglang"):
        return [sys.executable, "-m", "ziglang", "cc"]
    raise InputError("no C compiler: install gcc or clang, set CC, or `pip install gyrotwin[zig]`")


def fmi_headers() -> Path:
    """The folder of the C headers of both standards."""
    return Path(importlib.util.find_spec("fmpy").submodule_search_locations[0]) / "c-code"  # type: ignore[union-attr,index]


def compile_library(sources: Path, files: Sequence[str], library: Path, extra: Sequence[str] = ()) -> None:
    """Compiles the C ``files`` in the folder ``sources`` into a shared ``library``. Raises InputError with the
    compiler's first words."""
    headers = fmi_headers()
    position = () if sys.platform == "win32" else ("-fPIC",)
    math = () if sys.platform == "win32" else ("-lm",)
    command = [*find_compiler(), *FLAGS, *extra, *position, "-shared", "-isystem", str(headers), "-I", str(sources)]
    command += [str(sources / name) for name in files] + ["-o", str(library), *math]
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    if result.returncode != 0:
        complaint = next((line for line in result.stderr.splitlines() if "error" in line), result.stderr.strip()[:300])
        raise InputError(f"compiler {command[0]!r} failed: {complaint}")


def write_sources(model: Model, folder: Path) -> None:
    """Copies the handwritten C and writes the generated C into ``folder``."""
    for name, path in handwritten_files(model).items():
        shutil.copy(path, folder / name)
    for name, text in generated_files(model).items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_text(text, encoding="utf-8")


def c_files(folder: Path, fmi: str) -> list[str]:
    """The C files of one FMU, relative to ``folder``: all but the layer of the other FMI version."""
    other = {"fmi2": "fmi3.c", "fmi3": "fmi2.c"}[fmi]
    return sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*.c") if path.name != other)


def _build_one(model: Model, token: str, fmi: str, path: Path) -> None:
    LOGGER.info("compiling the %s FMU for %s, once for this model, some 5 s ...", model.NAME, fmi.upper())
    platform = _platform()
    with tempfile.TemporaryDirectory(prefix="gyrotwin-") as name:
        root = Path(name)
        sources = root / "sources"
        sources.mkdir()
        write_sources(model, sources)
        files = c_files(sources, fmi)
        (sources / {"fmi2": "fmi3.c", "fmi3": "fmi2.c"}[fmi]).unlink()
        if fmi == "fmi2":
            description, binaries = generate_xml.fmi2(model, token, _date(), files), platform.fmi2
        else:
            description, binaries = generate_xml.fmi3(model, token, _date()), platform.fmi3
            (sources / "buildDescription.xml").write_text(
                generate_xml.build_description(model, files), encoding="utf-8"
            )
        (root / "modelDescription.xml").write_text(description, encoding="utf-8")
        for place, data in generate_package.package_files(model, fmi).items():
            (root / place).parent.mkdir(parents=True, exist_ok=True)
            (root / place).write_bytes(data)
        library = root / "binaries" / binaries / f"{model.NAME}{platform.suffix}"
        library.parent.mkdir(parents=True)
        compile_library(sources, files, library)
        _pack(root, path)


def _date() -> str:
    """What an FMU gives as its date: one that is built again is the same (reproducible-builds.org)."""
    epoch = os.environ.get("SOURCE_DATE_EPOCH", "")
    return datetime.fromtimestamp(int(epoch), UTC).strftime("%Y-%m-%dT%H:%M:%SZ") if epoch.isdigit() else RELEASED


def _pack(root: Path, path: Path) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    beside = path.with_suffix(f".{os.getpid()}.part")
    try:
        with zipfile.ZipFile(beside, "w", zipfile.ZIP_DEFLATED) as archive:
            for file in sorted(p for p in root.rglob("*") if p.is_file()):
                # A fixed date makes equal models give equal files.
                info = zipfile.ZipInfo(file.relative_to(root).as_posix(), (2000, 1, 1, 0, 0, 0))
                info.external_attr = (0o755 if "binaries" in file.parts else 0o644) << 16
                info.compress_type = zipfile.ZIP_DEFLATED
                archive.writestr(info, file.read_bytes())
        os.replace(beside, path)
    finally:
        beside.unlink(missing_ok=True)
