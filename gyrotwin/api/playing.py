"""The gyroscope in a page."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from gyro_model.device import Device
from gyrotwin.api.files import DeviceSource, load_device

if TYPE_CHECKING:
    from gyrotwin.playing.page import PlayResult


def play(device: DeviceSource = "pendulum", *, effects: Sequence[str | Path] = ()) -> "PlayResult":
    """Make a page that runs the FMU in a browser: orbit, spectrum, ring-down, a slider for every effect, a game.

    Parameters
    ----------
    device : str, Path or Device
        What swings in it.
    effects : sequence of str or Path
        Folders of further effect files, which get sliders as well.

    Returns
    -------
    PlayResult
        With ``html``, ``hash``, ``save(folder)``, which writes play.html.

    Raises
    ------
    InputError
        If an argument is wrong, or the package ziglang, which compiles the module, is missing.

    Examples
    --------
    >>> import gyrotwin as gt
    >>> page = gt.play()
    >>> page.summary["bytes"] < 300_000
    True

    """
    from gyrotwin.playing.page import play_page

    named = device.name if isinstance(device, Device) else str(device)
    return play_page(load_device(device, effects=effects), named)
