"""One setting of an observer, a controller or the monitor: its default and what it can be."""

from collections.abc import Mapping
from math import inf, isfinite
from typing import NamedTuple

from gyro_model.errors import InputError, nearest


class Setting(NamedTuple):
    """default; low, high: the least and the most that can work, both included, in ``unit``; zero: 0 too, which switches
    it off; switch: 0 or 1 alone; why: what goes wrong beyond."""

    default: float
    low: float = -inf
    high: float = inf
    unit: str = ""
    zero: bool = False
    switch: bool = False
    why: str = ""

    @property
    def shown(self) -> str:
        """What it can be, for a reader."""
        if self.switch:
            return "0 or 1"
        low, high = (number(value) for value in (self.low, self.high))
        if not isfinite(self.low) and not isfinite(self.high):
            bounds = "a finite number"
        elif not isfinite(self.high):
            bounds = f"{low} or more"
        else:
            bounds = f"{low} to {high}"
        return ("0, or " if self.zero else "") + bounds + (f" {self.unit}" if self.unit else "")

    def check(self, owner: str, name: str, value: float) -> None:
        """Raises InputError where it can't be ``value``."""
        inside = value in (0.0, 1.0) if self.switch else isfinite(value) and self.low <= value <= self.high
        if not (inside or (self.zero and value == 0.0)):
            why = f" ({self.why})" if self.why else ""
            raise InputError(f"{owner}: setting {name} = {value:g}: give {self.shown}{why}")


Table = Mapping[str, Setting]
"""Settings by name."""


def switch(default: float) -> Setting:
    """A setting that is 0 or 1."""
    return Setting(default, 0.0, 1.0, switch=True)


def defaults(table: Table) -> dict[str, float]:
    """The defaults of ``table`` by name, in its order."""
    return {name: setting.default for name, setting in table.items()}


def complete(owner: str, table: Table, changes: Mapping[str, float]) -> dict[str, float]:
    """All settings of ``table`` in its order, with ``changes`` made. Raises InputError for a name that ``owner`` does
    not have, and for a value that can't be."""
    for name, value in changes.items():
        if name not in table:
            raise InputError(f"{owner} has no setting {name!r} (= {value}){nearest(name, table)}")
        table[name].check(owner, name, value)
    return defaults(table) | dict(changes)


def number(value: float) -> str:
    """A bound as one types it."""
    return f"{value:g}".replace("e+0", "e").replace("e+", "e").replace("e-0", "e-")
