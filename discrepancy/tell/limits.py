"""What a laboratory can do: the limits that a designed experiment keeps."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from math import isfinite
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

from discrepancy.data.record import CONDITIONS, Record
from gyro_model.errors import InputError, nearest
from gyro_model.toml_text import read_toml_file

Range = tuple[float, float]

LEVEL: Final = 2.0
"""Largest force and voltage over what the device has been seen to bear."""
LONGEST: Final = 40_000
"""Samples of a run at most."""
ORDINARY: Final[Mapping[str, float]] = {
    "v_bias": 10.0,
    "a_x": 9.80665,
    "a_y": 9.80665,
    "omega_z": 5.0,
    "temperature": 20.0,
}
"""Steps where the runs show none: a laboratory supply [V], a tilt by 90° [m/s²], a turntable [rad/s], an oven [K]."""
REST: Final[Mapping[str, float]] = {"v_bias": 0.0, "a_x": 0.0, "a_y": 0.0, "omega_z": 0.0, "temperature": 298.15}
"""Conditions that a run does not state, as the FMU starts with them."""
LARGEST: Final = 1e6
"""Of any limit, in its unit: no laboratory is beyond."""


@dataclass(frozen=True)
class Limits:
    """Limits of a laboratory; ``--limits FILE`` sets them by name (TOML). None: what the runs measured so far suggest.

    Raises InputError, naming the limit and the remedy, where one is none.
    """

    force_x: float | None = field(default=None, metadata={"unit": "N"})
    """Largest force on x; by default twice the largest measured."""
    force_y: float | None = field(default=None, metadata={"unit": "N"})
    """The same on y."""
    voltage_x: float | None = field(default=None, metadata={"unit": "V"})
    """Largest voltage of x, as a converter or a stop allows; by default twice the largest measured."""
    voltage_y: float | None = field(default=None, metadata={"unit": "V"})
    """The same of y."""
    sample_rate: float | None = field(default=None, metadata={"unit": "Hz"})
    """Samples a second; by default that of the loudest run."""
    longest: float | None = field(default=None, metadata={"unit": "s"})
    """Longest run; by default 40,000 samples."""
    v_bias: Range | None = field(default=None, metadata={"unit": "V"})
    """Lowest and highest bias; one value twice: it can't be changed. By default the rest and as far to both sides as
    the runs went, 10 V at least, never below 0."""
    omega_z: Range | None = field(default=None, metadata={"unit": "rad/s"})
    """Rate of turn; by default as the runs, 5 rad/s at least."""
    temperature: Range | None = field(default=None, metadata={"unit": "K"})
    """Temperature; by default as the runs, 20 K upwards at least."""
    a_x: Range | None = field(default=None, metadata={"unit": "m/s²"})
    """Acceleration along x; by default as the runs, 9.8 m/s² at least: a table that tilts."""
    a_y: Range | None = field(default=None, metadata={"unit": "m/s²"})
    """The same along y."""

    def __post_init__(self) -> None:
        for own in fields(self):
            value = getattr(self, own.name)
            if value is None:
                continue
            if own.name in CONDITIONS:
                _check_range(own.name, value)
            elif not _number(value) or not 0 < value <= LARGEST * (1e3 if own.name == "sample_rate" else 1):
                raise InputError(f"limits: {own.name} = {value!r}: give a positive number in {own.metadata['unit']}")

    @classmethod
    def of(cls, given: Mapping[str, Any]) -> "Limits":
        """From names and values; a pair may be a list. Raises InputError for a name that is none."""
        known = [own.name for own in fields(cls)]
        for name in given:
            if name not in known:
                raise InputError(f"limits: {name!r} is unknown{nearest(name, known)}")
        values: dict[str, Any] = {name: tuple(v) if isinstance(v, list) else v for name, v in given.items()}
        return cls(**values)


class Room(NamedTuple):
    """Limits with every number known. force [N], voltage [V]: by axis; rate [Hz]; samples: at most; base: conditions as
    they are unless changed; ranges: what can be changed, from and to, cheapest first."""

    force: tuple[float, ...]
    voltage: tuple[float, ...]
    rate: float
    samples: int
    base: Mapping[str, float]
    ranges: Mapping[str, Range]


def room_of(limits: Limits, records: Sequence[Record]) -> Room:
    """The limits beside what was measured: a force, a voltage or a condition that is not limited goes as far as a
    laboratory may that has measured ``records``."""
    loudest = max(records, key=lambda r: float(np.mean(r.u**2)))
    rate = limits.sample_rate or loudest.sample_rate
    force, voltage = [], []
    most = max(float(np.abs(r.u).max()) for r in records)
    for number, axis in enumerate("xy"[: loudest.axes]):
        own = max(float(np.abs(r.u[:, number]).max()) for r in records)
        force.append(getattr(limits, f"force_{axis}") or LEVEL * (own or most))
        seen = max(float(np.abs(r.v[:, number]).max()) for r in records)
        voltage.append(getattr(limits, f"voltage_{axis}") or LEVEL * seen)
    base = {name: float(values[0]) for name, values in loudest.conditions.items()}
    ranges = {name: getattr(limits, name) or _usual(name, records)
              for name in ORDINARY if loudest.axes == 2 or name != "a_y"}  # fmt: skip
    samples = int(limits.longest * rate) if limits.longest else LONGEST
    return Room(tuple(force), tuple(voltage), rate, samples, base,
                {name: own for name, own in ranges.items() if own[0] < own[1]})  # fmt: skip


def _usual(name: str, records: Sequence[Record]) -> Range:
    """As far from rest as the runs went, or as a laboratory goes; beyond the value of the loudest run as far."""
    rest = REST[name]
    seen = [v for r in records if name in r.conditions for v in (r.conditions[name].min(), r.conditions[name].max())]
    base = float(seen[0]) if seen else rest
    size = max(ORDINARY[name], *(abs(float(v) - rest) for v in seen), 0.0)
    low, high = min(base, rest - size), max(rest + size, base + size)
    # A supply has one sign, and an oven does not cool.
    return (min([rest, *map(float, seen)]), high) if name in ("v_bias", "temperature") else (low, high)


def load_limits(path: Path) -> Limits:
    """The limits of a TOML file. Raises InputError where it can't be read or one is wrong."""
    try:
        return Limits.of(read_toml_file(path))
    except InputError as error:
        raise InputError(f"--limits {path}: {error}") from None


def _check_range(name: str, value: object) -> None:
    if not (isinstance(value, tuple) and len(value) == 2 and all(map(_number, value)) and value[0] <= value[1]):
        raise InputError(f"limits: {name} = {value!r}: give the lowest and the highest value, [low, high]")
    if max(map(abs, value)) > LARGEST or (name == "temperature" and value[0] <= 0):
        raise InputError(f"limits: {name} = {value!r}: give values that a laboratory reaches")


def _number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and isfinite(value)
