"""Compiles C into a library: for this machine by its own compiler, for any platform by zig."""

import hashlib
import importlib.util
import os
import shlex
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import cache
from pathlib import Path

import platformdirs

from gyro_model.component.wrap import PAGES, STACK
from gyro_model.errors import InputError
from gyro_model.platforms import COMPONENT, WASM, Platform
from gyro_model.whole_file import whole_file

# Strict arithmetic: contraction to fused multiply-add would make platforms differ in the last bit. Nothing asks for
# errno, so that a root is one instruction.
STRICT = ("-ffp-contract=off", "-fno-math-errno")
FLAGS = ("-std=c99", "-O3", *STRICT, "-fvisibility=hidden", "-Wall", "-Wextra", "-Wpedantic")

WHOLE = "whole.c"
MOST_KEPT = 40
"""Objects of half a megabyte each."""
_POSITION = () if sys.platform == "win32" else ("-fPIC",)
_ZIG = (sys.executable, "-m", "ziglang", "cc")
# malloc and free for an importer's arrays, the table for its callbacks.
_WASM_EXPORTS = ("export-dynamic", "export=malloc", "export=free", "export-table")
_REACTOR = "-mexec-model=reactor"
_PAGE = 0x10000
_KINDS = {
    WASM.fmi3: (_REACTOR, *(f"-Wl,--{name}" for name in _WASM_EXPORTS)),
    # Its memory is that of a module before it.
    COMPONENT.fmi3: (
        _REACTOR,
        *("-Wl,--import-memory", f"-Wl,--initial-memory={PAGES * _PAGE}", f"-Wl,-z,stack-size={STACK * _PAGE}"),
    ),
    "x86_64-windows": ("-shared",),
}


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
        return list(_ZIG)
    raise InputError("no C compiler: install gcc or clang, set CC, or `pip install gyrotwin[zig]`")


def fmi_headers() -> Path:
    """The folder of the C headers of both standards."""
    return Path(importlib.util.find_spec("fmpy").submodule_search_locations[0]) / "c-code"  # type: ignore[union-attr,index]


def compile_library(sources: Path, files: Sequence[str], library: Path, extra: Sequence[str] = ()) -> None:
    """Compiles the C ``files`` in the folder ``sources`` into a shared ``library`` for this machine. Raises InputError
    with the compiler's first words."""
    math = () if sys.platform == "win32" else ("-lm",)
    _compile([*find_compiler(), *FLAGS, *extra, *_POSITION, "-shared"], sources, files, library, math)


def compile_object(
    sources: Path, file: str, besides: str, made: Path, begin: Callable[[], None], extra: Sequence[str] = ()
) -> None:
    """Makes the object of a C ``file`` in ``sources`` that does not include ``besides``: one that is kept of the same
    texts by the same compiler, else compiled after ``begin`` was called, which is most of the time of a library. Raises
    InputError as ``compile_library`` does."""
    compiler = find_compiler()
    command = [*compiler, *FLAGS, *extra, *_POSITION, "-c"]
    digest = hashlib.sha256(repr((command, _version(tuple(compiler)), file)).encode())
    for root in (sources, fmi_headers()):
        for path in sorted(root.rglob("*.[ch]")):
            name = path.relative_to(root).as_posix()
            if name != besides:
                text = path.read_bytes()
                digest.update(f"{name} {len(text)} ".encode() + text)
    kept = Path(platformdirs.user_cache_dir("gyrotwin")) / "objects" / f"{digest.hexdigest()}.o"
    with suppress(OSError):
        made.write_bytes(kept.read_bytes())
        return
    begin()
    _compile(command, sources, [file], made)
    with suppress(OSError):
        with whole_file(kept) as whole:
            whole.write(made.read_bytes())
        for old in sorted(kept.parent.glob("*.o"), key=lambda path: path.stat().st_mtime)[:-MOST_KEPT]:
            old.unlink(missing_ok=True)


@cache
def _version(compiler: tuple[str, ...]) -> bytes:
    """What a compiler says that it is."""
    return subprocess.run([*compiler, "--version"], capture_output=True, check=False).stdout


def write_whole(sources: Path, files: Sequence[str]) -> str:
    """A file in ``sources`` that includes the C ``files``: a compiler which sees them at once calls little."""
    (sources / WHOLE).write_text("".join(f'#include "{name}"\n' for name in files), encoding="utf-8")
    return WHOLE


def compile_for(platform: Platform, sources: Path, files: Sequence[str], library: Path) -> None:
    """The same for any platform that zig knows, and without the C library's mathematics. Raises InputError where the
    package ziglang is missing."""
    check_zig(platform)
    kind = _KINDS.get(platform.fmi3, ("-shared", "-fPIC"))
    with tempfile.TemporaryDirectory(prefix="gyrotwin-") as name:
        # Elsewhere first: beside a library for Windows zig leaves other files. Stripped of names and dates, so that
        # equal sources give equal libraries.
        made = Path(name) / library.name
        _compile([*_ZIG, *FLAGS, "-target", platform.target, "-s", *kind], sources, files, made)
        shutil.copy(made, library)


def check_zig(platform: Platform) -> None:
    """Raises InputError where the package ziglang, which compiles for ``platform``, is missing."""
    if not importlib.util.find_spec("ziglang"):
        raise InputError(f"platform {platform.fmi3!r}: to compile for it takes zig; `pip install gyrotwin[zig]`")


def _compile(
    compiler: Sequence[str], sources: Path, files: Sequence[str], library: Path, last: Sequence[str] = ()
) -> None:
    command = [*compiler, "-isystem", str(fmi_headers()), "-I", str(sources)]
    command += [str(sources / name) for name in files] + ["-o", str(library), *last]
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    if result.returncode != 0:
        complaint = next((line for line in result.stderr.splitlines() if "error" in line), result.stderr.strip()[:300])
        raise InputError(f"compiler {compiler[0]!r} failed: {complaint}")
