"""Observers and controllers by name: those of the package, found by a scan of its folders, or a user's own file."""

import hashlib
import importlib
import importlib.util
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from cosim.controllers.record import Controller, CoreController
from cosim.observers.record import CoreObserver, Observer
from gyro_model.errors import InputError, nearest, one_line

_FOLDER = Path(__file__).parent


def observer_names() -> list[str]:
    """Names of the packaged observers."""
    return _names("observers", "OBSERVER")


def controller_names() -> list[str]:
    """Names of the packaged controllers."""
    return _names("controllers", "CONTROLLER")


def find_observer(name: str) -> Observer | CoreObserver:
    """The observer of that name, or the OBSERVER of the Python file at that path. Raises InputError where there is
    none."""
    found = _find("observers", "OBSERVER", name)
    if not isinstance(found, (Observer, CoreObserver)):
        raise InputError(f"observer {name}: OBSERVER is no cosim.observers.record.Observer; build it as one")
    return found


def find_controller(name: str) -> Controller | CoreController:
    """The controller of that name, or the CONTROLLER of the Python file at that path. Raises InputError where there
    is none."""
    found = _find("controllers", "CONTROLLER", name)
    if not isinstance(found, (Controller, CoreController)):
        raise InputError(f"controller {name}: CONTROLLER is no cosim.controllers.record.Controller; build it as one")
    return found


def _names(folder: str, attribute: str) -> list[str]:
    # By their text, so that listing the names compiles none of them.
    files = sorted((_FOLDER / folder).glob("*.py"))
    return [path.stem for path in files if f"\n{attribute}:" in path.read_text(encoding="utf-8")]


def _find(folder: str, attribute: str, name: str) -> Any:
    if name.endswith(".py"):
        return _from_file(Path(name), attribute)
    names = _names(folder, attribute)
    if name not in names:
        raise InputError(f"{attribute.lower()} {name!r} is unknown{nearest(name, names)} (or give a file NAME.py)")
    return getattr(importlib.import_module(f"cosim.{folder}.{name}"), attribute)


@contextmanager
def _own_cache(path: Path) -> Iterator[None]:
    """What a file compiles with ``cache=True`` is kept for the text of all files beside it, which it may call: numba
    itself sees changes in the file alone."""
    import numba

    digest = hashlib.sha256(str(path.resolve()).encode())
    for file in sorted(path.parent.glob("*.py")):
        digest.update(file.read_bytes())
    before = numba.config.CACHE_DIR
    numba.config.CACHE_DIR = str(Path(before) / f"own-{digest.hexdigest()[:16]}")
    try:
        yield
    finally:
        numba.config.CACHE_DIR = before


def _from_file(path: Path, attribute: str) -> Any:
    if not path.is_file():
        raise InputError(f"{attribute.lower()} file {path}: not found")
    spec = importlib.util.spec_from_file_location(f"_user_{path.stem}", path)
    if spec is None or spec.loader is None:
        raise InputError(f"{attribute.lower()} file {path}: can't be loaded as Python")
    module = importlib.util.module_from_spec(spec)
    # What numba finds in its cache looks for its module by name.
    sys.modules[spec.name] = module
    try:
        with _own_cache(path):
            spec.loader.exec_module(module)
    except (Exception, SystemExit) as error:
        raise InputError(f"{attribute.lower()} file {path}: {one_line(error)}") from error
    if not hasattr(module, attribute):
        raise InputError(f"{attribute.lower()} file {path}: defines no {attribute}; assign it")
    return getattr(module, attribute)
