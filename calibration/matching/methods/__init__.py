"""Ways to match the modes, one file each, found by a scan of this folder: a file states ``METHOD = Method(...)``."""

from collections.abc import Mapping
from functools import cache
from importlib import import_module
from pathlib import Path

from calibration.matching.methods.method import Method


@cache
def methods() -> Mapping[str, Method]:
    """The methods by name."""
    modules = (import_module(f"{__name__}.{path.stem}") for path in sorted(Path(__file__).parent.glob("*.py")))
    found = [module.METHOD for module in modules if hasattr(module, "METHOD")]
    return {method.name: method for method in found}
