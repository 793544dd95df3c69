"""A temperature test from a table: one that `gyrotwin rate` wrote, or a lab's own with its columns named."""

from collections.abc import Mapping, Sequence
from math import radians
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from calibration.compensation.record import CIRCUIT, FREQUENCY, STRUCTURE, TemperatureTest
from cosim.rate.courses import ZERO_CELSIUS
from discrepancy.import_table import read_lab_table
from discrepancy.table import numbers
from gyro_model.errors import InputError, nearest

Floats = NDArray[np.float64]
KELVIN: Final = (1.0, -ZERO_CELSIUS)
COLDEST: Final = -120.0
HOTTEST: Final = 250.0
"""Temperatures beyond these [°C] are taken for a wrong unit: high-temperature parts are rated to 225 °C."""


class Column(NamedTuple):
    """A column of the record: what it is in the test, and by unit (factor, offset) to what the test holds."""

    quantity: str
    units: Mapping[str, tuple[float, float]]
    default: str


RATE: Final = {"rad/s": (1.0, 0.0), "deg/s": (radians(1), 0.0), "counts": (1.0, 0.0)}
CELSIUS: Final = {"K": KELVIN, "degC": (1.0, 0.0)}
COLUMNS: Final[Mapping[str, Column]] = {
    "t": Column("t", {"s": (1.0, 0.0), "ms": (1e-3, 0.0), "us": (1e-6, 0.0)}, "s"),
    "rate": Column("rate", RATE, "rad/s"),
    "rate_true": Column("rate_true", RATE, "rad/s"),
    "sensor_structure": Column(STRUCTURE, CELSIUS, "K"),
    "sensor_circuit": Column(CIRCUIT, CELSIUS, "K"),
    "drive_frequency": Column(FREQUENCY, {"Hz": (1.0, 0.0), "kHz": (1e3, 0.0)}, "Hz"),
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
        factor, offset = _factor(name, column, units.get(name))
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
    low, high = float(values.min()), float(values.max())
    if low >= COLDEST and high <= HOTTEST:
        return
    remedy = f"give a --scale {name}=FACTOR,OFFSET to K"
    if low + ZERO_CELSIUS >= COLDEST and high + ZERO_CELSIUS <= HOTTEST:
        remedy = f"are they in °C? Then give --scale {name}=degC"
    elif low - ZERO_CELSIUS >= COLDEST and high - ZERO_CELSIUS <= HOTTEST:
        remedy = f"are they in K? Then give --scale {name}=K"
    raise InputError(f"{what} reads as {low:.4g} to {high:.4g} °C, at which no gyroscope is tested: {remedy}")


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


def _factor(name: str, column: Column, text: str | None) -> tuple[float, float]:
    """Factor and offset from what the table holds to what the test holds."""
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
    to_factor, to_offset = column.units[column.default]
    return to_factor * factor, to_factor * offset + to_offset
