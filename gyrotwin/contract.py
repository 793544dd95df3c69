"""The checks that the packaged parts pass, for parts of a user's own: effects, observers, controllers, scenarios."""

import shutil
import tempfile
from pathlib import Path

from gyro_model.contract import CHECKS, check_effect
from gyro_model.errors import InputError
from gyro_model.model import load_model

__all__ = ["CHECKS", "check", "check_effect"]


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
    if "OBSERVER" in text or "CONTROLLER" in text:
        return _parts(place, text)
    with tempfile.TemporaryDirectory(prefix="gyrotwin-") as folder:
        shutil.copy(place, folder)
        return _effects(Path(folder))


def _effects(folder: Path) -> list[str]:
    model = load_model(folder)
    own = [model.effect(file.stem) for file in sorted(folder.glob("*.py")) if not file.stem.startswith("_")]
    if not own:
        raise InputError(f"effect folder {folder}: holds no effect file")
    return [f"effect {effect.id}: {len(CHECKS)} checks passed" for effect in own]


def _parts(file: Path, text: str) -> list[str]:
    """An observer or controller is run: the loop with it ends with finite numbers."""
    from gyrotwin.api import run

    kinds = [kind for kind in ("observer", "controller") if kind.upper() in text]
    for kind in kinds:
        arguments = {kind: str(file)}
        result = run("constant", duration=0.02, **arguments)  # type: ignore[arg-type]
        if not result.trace["u_x"].is_finite().all() or not result.trace["est_omega_z"].is_finite().all():
            raise InputError(f"{kind} {file}: estimates or forces are not finite after 20 ms of `constant`")
    return [f"{kind} {file.stem}: built, compiled and run for 20 ms" for kind in kinds]
