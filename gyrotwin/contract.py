"""The checks that the packaged parts pass, for parts of a user's own: effects, observers, controllers, scenarios."""

import re
import shutil
import tempfile
from pathlib import Path
from typing import Final

from cosim.controllers.record import Controller
from cosim.observers.record import Observer
from gyro_model.contract import CHECKS, check_effect
from gyro_model.errors import InputError
from gyro_model.model import load_model

__all__ = ["CHECKS", "check", "check_effect"]

DURATION: Final = 0.02
"""How long observers and controllers are run [s]."""
FINITE: Final = ("u_", "est_")
"""How the columns of a trace begin that observers and controllers write."""


def check(path: str | Path) -> list[str]:
    """Check a part, or every effect of a folder.

    Parameters
    ----------
    path : str or Path
        Folder of effect files; an effect file; a Python file that defines ``OBSERVER`` or ``CONTROLLER``; a scenario
        file (TOML).

    Returns
    -------
    list of str
        What was checked, one line each.

    Raises
    ------
    InputError
        With the reason why a part is refused.

    Examples
    --------
    >>> import tempfile
    >>> from gyro_model.model import EFFECTS_FOLDER
    >>> from gyrotwin import contract
    >>> text = (EFFECTS_FOLDER / "cubic_stiffness.py").read_text()
    >>> folder = Path(tempfile.mkdtemp())
    >>> own = text.replace("cubic_stiffness", "my_stiffness").replace("k3_", "my_")
    >>> _ = (folder / "my_stiffness.py").write_text(own)
    >>> [line.split(":")[0] for line in contract.check(folder)]
    ['effect my_stiffness']

    """
    place = Path(path)
    if place.is_dir():
        return _effects(place)
    if not place.is_file():
        raise InputError(f"{place}: no such file or folder")
    if place.suffix == ".toml":
        from cosim.scenarios import scenario

        chosen = scenario(str(place))
        return [f"scenario {chosen.name}: {chosen.duration:g} s, as it should be"]
    if place.suffix != ".py":
        raise InputError(f"{place}: give an effect, observer or controller as .py, or a scenario as .toml")
    text = place.read_text(encoding="utf-8", errors="replace")
    if kinds := [kind for kind in ("observer", "controller") if _defines(text, kind)]:
        return [_part(place, kind) for kind in kinds]
    if not _defines(text, "effect"):
        raise InputError(f"{place}: defines no EFFECT, OBSERVER or CONTROLLER; assign one (a scenario is a .toml file)")
    with tempfile.TemporaryDirectory(prefix="gyrotwin-") as folder:
        shutil.copy(place, folder)
        try:
            return _effects(Path(folder))
        except InputError as error:
            raise InputError(str(error).replace(folder, str(place.parent))) from error


def _defines(text: str, kind: str) -> bool:
    return re.search(rf"^\s*{kind.upper()}\b", text, re.MULTILINE) is not None


def _effects(folder: Path) -> list[str]:
    model = load_model(folder)
    own = [model.effect(file.stem) for file in sorted(folder.glob("*.py")) if not file.stem.startswith("_")]
    if not own:
        raise InputError(f"effect folder {folder}: holds no effect file")
    return [f"effect {effect.id}: {len(CHECKS)} checks passed" for effect in own]


def _part(file: Path, kind: str) -> str:
    """An observer or controller is run, in plain Python and compiled: the loop with it gives finite numbers."""
    from cosim.running import design_for, rehearse
    from gyrotwin.api import run
    from gyrotwin.tasks.run import Request, prepare

    arguments: dict[str, str] = {kind: str(file)}
    asked = prepare(Request("constant", duration=DURATION, **arguments))  # type: ignore[arg-type]
    part = getattr(asked, kind)
    if isinstance(part, (Observer, Controller)):
        rehearse(part, design_for(asked.observer, asked.design), asked.period, {}, asked.samples)
    trace = run("constant", duration=DURATION, trace_rate=asked.sample_rate, **arguments).trace  # type: ignore[arg-type]
    for name in trace.columns:
        if name.startswith(FINITE) and not (finite := trace[name].is_finite()).all():
            sample = int(finite.arg_min() or 0)
            said = f"{name} is {trace[name][sample]} at sample {sample} of `constant`"
            raise InputError(f"{kind} {file}: {said}; write finite numbers")
    return f"{kind} {file.stem}: built, compiled and run for {1e3 * DURATION:g} ms"
