"""`gyrotwin list`."""

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from gyro_model.device import load_device, packaged_devices
from gyro_model.errors import InputError, nearest
from gyro_model.model import load_model
from gyrotwin.terminal_table import Table

console = Console()


def list_(
    what: Annotated[str, typer.Argument(help="effects, devices, designs, scenarios, observers.")],
    effects: Annotated[
        list[Path] | None, typer.Option(metavar="DIR", help="Folder of further effect files; repeatable.")
    ] = None,
) -> None:
    """List what there is by name."""
    listings: dict[str, Callable[[], Table]] = {
        "effects": lambda: _effects(effects or ()),
        "devices": _devices,
        "designs": _designs,
        "scenarios": _scenarios,
        "observers": _observers,
    }
    if what not in listings:
        raise InputError(f"list {what!r}: there are {', '.join(listings)}{nearest(what, listings)}")
    if effects and what != "effects":
        raise InputError(f"--effects {effects[0]}: a folder of effects; `gyrotwin list effects` takes it")
    console.print(listings[what]())


def _table(*headings: str) -> Table:
    table = Table(box=None, header_style="bold")
    for heading in headings:
        table.add_column(heading, overflow="fold")
    return table


def _effects(folders: Iterable[Path]) -> Table:
    table = _table("effect", "stage", "parameters", "signature")
    for effect in load_model(*folders).effects:
        names = [
            f"{q.name} \\[{q.unit}]" if q.role == "size" else f"({q.name} \\[{q.unit}])" for q in effect.parameters
        ]
        table.add_row(effect.id, effect.stage, ", ".join(names), effect.signature)
    return table


def _devices() -> Table:
    table = _table("device", "mass", "x alone", "Q of x", "file")
    for name, path in packaged_devices().items():
        p = load_device(name).all_parameters
        w = (p["kxx"] / p["m"]) ** 0.5
        table.add_row(
            name, f"{p['m']:.3g} kg", f"{w / 6.283185307179586:.1f} Hz", f"{p['m'] * w / p['dxx']:.4g}", str(path)
        )
    return table


def _designs() -> Table:
    from cosim.design import packaged_designs

    table = _table("design", "what the loop knows", "file")
    for name, path in packaged_designs().items():
        comment = [
            line.removeprefix("# ") for line in path.read_text(encoding="utf-8").splitlines() if line[:2] == "# "
        ]
        table.add_row(name, comment[0], str(path))
    return table


def _scenarios() -> Table:
    from cosim.scenarios import DESCRIPTIONS

    table = _table("scenario", "what happens")
    for name, text in DESCRIPTIONS.items():
        table.add_row(name, text)
    return table


def _observers() -> Table:
    from cosim.registry import controller_names, observer_names

    table = _table("name", "kind")
    for name in observer_names():
        table.add_row(name, "observer")
    for name in controller_names():
        table.add_row(name, "controller")
    return table
