"""The FMUs: built, and verified against their reference traces."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from gyro_model.errors import InputError
from gyro_model.model import load_model
from gyro_model.progress import Progress
from gyrotwin.api.files import DeviceSource, load_device

if TYPE_CHECKING:
    from gyro_model.experiments import Residual


def build(
    device: DeviceSource | None = None,
    *,
    effects: Sequence[str | Path] = (),
    folder: str | Path | None = None,
    force: bool = False,
    platforms: str | Sequence[str] = (),
    progress: Progress | None = None,
) -> tuple[Path, ...]:
    """Build the FMUs Gyroscope, GyroscopeEnvelope, GyroscopeSensor, FMI 2.0 and 3.0, and GyroscopeClocked, FMI 3.0.

    Parameters
    ----------
    device : str, Path or Device
        The FMUs start as this device where nobody sets a parameter, but for the sensor, which knows no device; needs
        ``folder``.
    effects : sequence of str or Path
        Folders of further effect files.
    folder : str or Path
        Where to put them; None: beside the sources in a checkout, else the user's cache.
    force : bool
        Build even where they are up to date.
    platforms : str or sequence of str
        Platforms to hold libraries for, compiled by zig: "all", or names such as x86_64-windows; wasm32-wasip2 is a
        WebAssembly component inside those for FMI 3.0, wasm32 a module beside them. None: this machine's, by its own
        compiler.
    progress : callable
        Called after each library with how many are compiled, and how many there are in all.

    Returns
    -------
    tuple of Path
        Gyroscope for FMI 2.0 and 3.0, then GyroscopeEnvelope, then GyroscopeSensor, then GyroscopeClocked.

    Raises
    ------
    InputError
        If there is no compiler, or it fails; if a platform is unknown.

    Examples
    --------
    >>> import gyrotwin as gt
    >>> [path.stem for path in gt.build()][::2]
    ['Gyroscope', 'GyroscopeEnvelope', 'GyroscopeSensor', 'GyroscopeClocked']

    """
    from gyro_model.build import build_all
    from gyro_model.platforms import chosen_platforms

    named = chosen_platforms(platforms if isinstance(platforms, str) else ",".join(platforms)) if platforms else ()
    model = load_model(*map(Path, effects))
    if device is not None:
        if folder is None:
            raise InputError("build of a device: name the folder, so that the FMUs of the package stay as they are")
        model = model.starting_at(load_device(device, effects=effects).parameters)
    place = None if folder is None else Path(folder)
    return build_all(model, place, force=force, platforms=named, progress=progress or (lambda done, total: None))


def verify(fmu: str | Path) -> "list[Residual]":
    """Replay the reference traces that an FMU brings, on this machine.

    Parameters
    ----------
    fmu : str or Path
        An FMU for FMI 2.0 or 3.0 with the layered standard fmi-ls-ref inside.

    Returns
    -------
    list of Residual
        Of each output of each experiment: how far it is off, what is allowed and why, ``met``.

    Raises
    ------
    InputError
        Where it is no FMU, brings no traces, or has no binary for this machine.

    Examples
    --------
    >>> import gyrotwin as gt
    >>> all(residual.met for residual in gt.verify(gt.build()[0]))
    True

    """
    from gyro_model.experiments import verify as replay

    return replay(Path(fmu))
