"""The platforms that an FMU can hold a library for, by their names in FMI 3.0."""

import platform
import sys
import zipfile
from pathlib import Path
from typing import NamedTuple

from gyro_model.errors import InputError, nearest


class Platform(NamedTuple):
    """A platform by its name in FMI 2.0 and in FMI 3.0, the suffix of a library there, and the target as zig calls it;
    "" where the standard has no place for it, or zig is not asked to compile for it."""

    fmi2: str
    fmi3: str
    suffix: str
    target: str = ""


COMPONENT = Platform("", "wasm32-wasip2", ".wasm", "wasm32-wasi")
"""A WebAssembly component, by the draft of the layered standard fmi-ls-wasm."""
# glibc 2.17 is that of 2012, which every Linux in service has. macOS 11 is the first for both processors.
PLATFORMS = {
    p.fmi3: p
    for p in (
        Platform("linux64", "x86_64-linux", ".so", "x86_64-linux-gnu.2.17"),
        Platform("aarch64-linux", "aarch64-linux", ".so", "aarch64-linux-gnu.2.17"),
        Platform("win64", "x86_64-windows", ".dll", "x86_64-windows-gnu"),
        Platform("darwin64", "x86_64-darwin", ".dylib", "x86_64-macos.11.0"),
        Platform("aarch64-darwin", "aarch64-darwin", ".dylib", "aarch64-macos.11.0"),
        COMPONENT,
    )
}
# A module beside the FMUs, in which no standard has a place for it.
WASM = Platform("", "wasm32", ".wasm", "wasm32-wasi")
NAMES = (*PLATFORMS, WASM.fmi3)


def own_platform() -> str:
    """The name of this machine's platform, which need not be one of ``PLATFORMS``."""
    system = {"win32": "windows"}.get(sys.platform, sys.platform)
    processor = {"amd64": "x86_64", "arm64": "aarch64"}.get(platform.machine().lower(), platform.machine().lower())
    return f"{processor}-{system}"


def platform_of(name: str) -> Platform:
    """A platform by name; one that is not in ``PLATFORMS`` goes by the same name in both standards."""
    system = name.partition("-")[2]
    return PLATFORMS.get(name) or Platform(name, name, {"windows": ".dll", "darwin": ".dylib"}.get(system, ".so"))


def platforms_of(path: Path) -> set[str]:
    """The folders in binaries/ of the FMU at ``path``."""
    with zipfile.ZipFile(path) as archive:
        return {name.split("/")[1] for name in archive.namelist() if name.startswith("binaries/")}


def chosen_platforms(text: str) -> tuple[str, ...]:
    """Names from "all", or from a list with commas. Raises InputError at a name that is none."""
    names = NAMES if text == "all" else tuple(dict.fromkeys(name.strip() for name in text.split(",")))
    for name in names:
        if name not in NAMES:
            raise InputError(f"platform {name!r}: give `all` or some of {', '.join(NAMES)}{nearest(name, NAMES)}")
    return names
