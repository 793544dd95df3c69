"""What a task starts from: devices, designs, effects."""

import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from gyro_model.device import Device, write_device
from gyro_model.device import load_device as _load_device
from gyro_model.model import load_model

if TYPE_CHECKING:
    from cosim.design import Design
    from gyro_model.anatomy import Effect

DeviceSource = str | Path | Device
"""A packaged name, a file, or the device itself."""


def load_device(source: DeviceSource, *, effects: Sequence[str | Path] = ()) -> Device:
    """Load a device.

    Parameters
    ----------
    source : str, Path or Device
        Packaged name (``gyrotwin list devices``) or path of a device file.
    effects : sequence of str or Path
        Folders of further effect files, whose parameters the device file may set.

    Returns
    -------
    Device
        With parameters in SI.

    Raises
    ------
    InputError
        If there is no such device, or the file is wrong.

    Examples
    --------
    >>> import gyrotwin as gt
    >>> device = gt.load_device("reference")
    >>> round(device.frequencies[0])  # Hz
    2893

    """
    if isinstance(source, Device):
        return source
    return _load_device(str(source), load_model(*map(Path, effects)))


def load_design(source: "str | Path | Design | Device", device: DeviceSource = "reference", seed: int = 1) -> "Design":
    """Load a design: all that a loop may know of a device.

    Parameters
    ----------
    source : str, Path, Design or Device
        Packaged name (``gyrotwin list designs``), path of a design file, or a device, whose parameters are then known
        within its intervals.
    device : str, Path or Device
        The device for which the design is completed.
    seed : int
        Seed of the first estimates that the design leaves open.

    Returns
    -------
    Design

    Raises
    ------
    InputError
        If there is no such design, or the file is wrong.

    Examples
    --------
    >>> import gyrotwin as gt
    >>> design = gt.load_design("plain", "reference", seed=7)
    >>> sorted(design.deviations)
    ['dxx', 'dxy', 'dyy', 'kxx', 'kxy', 'kyy', 'm']

    """
    from cosim.design import Design
    from cosim.design import load_design as load

    if isinstance(source, Design):
        return source
    plant = load_device(device)
    if not isinstance(source, Device):
        return load(str(source), plant, seed)
    with tempfile.TemporaryDirectory(prefix="gyrotwin-") as folder:
        path = Path(folder) / "device.toml"
        write_device(source, path)
        return load(str(path), plant, seed)


def effects(*folders: str | Path) -> "tuple[Effect, ...]":
    """List the effects of the model.

    Parameters
    ----------
    *folders : str or Path
        Folders of further effect files.

    Returns
    -------
    tuple of Effect
        Each with ``id``, ``stage``, ``parameters`` (name, unit, bounds), ``signature``, ``doc``.

    Raises
    ------
    InputError
        If a file is wrong.

    Examples
    --------
    >>> import gyrotwin as gt
    >>> "cubic_stiffness" in [effect.id for effect in gt.effects()]
    True

    """
    return load_model(*map(Path, folders)).effects
