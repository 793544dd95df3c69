"""A temperature test from a table: one that `gyrotwin rate` wrote, or a lab's own with its columns named."""

import re
from collections.abc import Mapping, Sequence
from math import radians
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from calibration.compensation.record import CIRCUIT, FREQUENCY, STRUCTURE, TemperatureTest
from cosim.rate.courses import ZERO_CELSIUS
from discrepancy.data.import_table import read_lab_table
from discrepancy.data.table import numbers
from gyro_model.errors import InputError, nearest
from gyro_model.tables import misread, stated_unit
from gyro_model.units import conversion

Floats = NDArray[np.float64]
KELVIN: Final = (1.0, -ZERO_CELSIUS)
UNIT_TEXTS: Final = {"degC": "°C", "K": "K"}


class Column(NamedTuple):
    """A column of the record: what it is in the test, by unit (factor, offset) to what the test holds, and its SI unit,
    in whose units a heading may say what it is in."""

    quantity: str
    units: Mapping[str, tuple[float, float]]
    default: str
    si: str


RATE: Final = {"rad/s": (1.0, 0.0), "deg/s": (radians(1), 0.0), "counts": (1.0, 0.0)}
CELSIUS: Final = {"K": KELVIN, "degC": (1.0, 0.0)}
COLUMNS: Final[Mapping[str, Column]] = {
    "t": Column("t", {"s": (1.0, 0.0), "ms": (1e-3, 0.0), "us": (1e-6, 0.0)}, "s", "s"),
    "rate": Column("rate", RATE, "rad/s", "rad/s"),
    "rate_true": Column("rate_true", RATE, "rad/s", "rad/s"),
    "sensor_structure": Column(STRUCTURE, CELSIUS, "K", "K"),
    "sensor_circuit": Column(CIRCUIT, CELSIUS, "K", "K"),
    "drive_frequency": Column(FREQUENCY, {"Hz": (1.0, 0.0), "kHz": (1e3, 0.0)}, "Hz", "Hz"),
}
"""The columns of trace.parquet that a compensation uses."""


def read_test(path: Path, maps: Sequence[str] = (), scales: Sequence[str] = ()) -> TemperatureTest:
    """The test in a .csv, .csv.gz or .parquet file.

    maps: COLUMN=HEADING where the heading is another; scales: COLUMN=UNIT, or COLUMN=FACTOR,OFFSET to the column's
    default unit (K for a temperature). Without rate_true the test is at rest. Raises InputError for what does not fit.
    """
    headings, units = _pairs("--map", maps), _pairs("--scale", scales)
    table = read_lab_table(path)
    given = {heading.strip(): heading for heading in table.columns}
    given |= {bare: heading for heading in table.columns if (bare := _bare(heading)) not in given}
    found = {}
    for name, column in COLUMNS.items():
        heading = headings.get(name, name)
        if heading not in given:
            if name in headings:
                raise InputError(
                    f"--map {name}={heading}: no such heading{nearest(heading, given)} (there are {', '.join(given)})"
                )
            if name in ("t", "rate"):
                raise InputError(
                    f"{path}: no column {name}{nearest(name, given)}: name one by --map {name}=HEADING "
                    f"(there are {', '.join(given)})"
                )
            continue
        factor, offset = _factor(name, column, units.get(name), given[heading])
        try:
            found[column.quantity] = factor * numbers(table, given[heading]) + offset
        except InputError as error:
            raise InputError(f"{path}: {error}") from None
    for name, column in COLUMNS.items():
        if column.quantity in found and column.units is CELSIUS:
            _check_celsius(f"{path}: {name}", name, found[column.quantity])
    unit = "counts" if units.get("rate") == "counts" else "rad/s"
    if (units.get("rate_true") == "counts") != (unit == "counts") and "rate_true" in found:
        raise InputError("--scale: give rate and rate_true the same kind of unit, both counts or neither")
    t, rate = found.pop("t"), found.pop("rate")
    true = found.pop("rate_true", np.zeros(len(t)))
    return TemperatureTest(t, rate, true, found, unit, str(path))


def _check_celsius(what: str, name: str, values: Floats) -> None:
    """Raises InputError where a temperature [°C] is none that electronics work at: most often another unit."""
    doubt = misread(values + ZERO_CELSIUS)
    if doubt is None:
        return
    remedy = f"give a --scale {name}=FACTOR,OFFSET to K"
    if doubt.likely is not None:
        remedy = f"are they in {UNIT_TEXTS[doubt.likely]}? Then give --scale {name}={doubt.likely}"
    raise InputError(f"{what} {doubt.text}: {remedy}")


def _pairs(option: str, texts: Sequence[str]) -> dict[str, str]:
    pairs = {}
    for text in texts:
        name, equals, value = text.partition("=")
        if not equals or not value:
            raise InputError(f"{option} {text}: give COLUMN=VALUE")
        if name not in COLUMNS:
            raise InputError(f"{option} {text}: no column {name!r}{nearest(name, COLUMNS)} ({', '.join(COLUMNS)})")
        pairs[name] = value
    return pairs


def _bare(heading: str) -> str:
    """A heading without a unit in brackets."""
    return re.split(r"[\[(]", heading, maxsplit=1)[0].strip()


def _factor(name: str, column: Column, text: str | None, heading: str) -> tuple[float, float]:
    """Factor and offset from what the table holds to what the test holds: by ``text``, else by the unit in the heading,
    else in the column's default. Raises InputError where ``text`` and heading differ."""
    stated = stated_unit(heading, column.si)
    to_factor, to_offset = column.units[column.default]
    if stated is not None:
        # To the default unit, which is SI.
        own = conversion(stated, column.si)
        told = (to_factor * own.factor, to_factor * own.offset + to_offset)
        if text is not None and text in column.units and not np.allclose(column.units[text], told, rtol=1e-12):
            raise InputError(f"--scale {name}={text}: the heading {heading!r} says {stated}: leave --scale out")
        if text is None:
            return told
    if text is None:
        return column.units[column.default]
    if text in column.units:
        return column.units[text]
    try:
        factor, offset = (float(part) for part in (text if "," in text else text + ",0").split(","))
    except ValueError:
        raise InputError(
            f"--scale {name}={text}: give {', '.join(column.units)}, or FACTOR,OFFSET to {column.default}"
            f"{nearest(text, column.units)}"
        ) from None
    return to_factor * factor, to_factor * offset + to_offset
