"""A record of one voltage from a lab's table: which columns it is in, and whether its samples are evenly spaced."""

from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np
import polars as pl

from calibration.mode_split import VoltageRecord
from discrepancy.data.import_table import Request, guess_sources, read_lab_table
from discrepancy.data.record import Floats, check_time, measured_rate
from discrepancy.data.table import numbers
from gyro_model.errors import InputError, nearest

VOLTAGES: Final = ("v_y", "v", "voltage", "sense", "signal", "u")
"""Headings taken for the voltage, in this order, where none is named."""
PAIRS: Final = (("v_y_i", "v_y_q"), ("i", "q"))
"""Headings taken for in-phase and quadrature, where a carrier is given."""
CARRIER: Final = "carrier_frequency"
"""Column with the frequency of a demodulator that follows the drive [Hz], beside I and Q."""
AS_TYPED: Final = 1e-3
"""Of the carrier: one given by hand is that of the column where it agrees with it to three digits."""
UNEVEN: Final = 0.5
"""Largest error of a sample's time, in steps, before the record has a hole; printing t may round it by as much."""


def read_record(
    path: Path, columns: Sequence[str] = (), sample_rate: float | None = None, carrier: float | None = None
) -> VoltageRecord:
    """The record in a .csv, .csv.gz or .parquet file.

    columns: none (guessed), one of a voltage, or two of I and Q around ``carrier`` [Hz]; sample_rate [Hz]: needed where
    there is no time, checked against it else. A table with I, Q and CARRIER, as `gyrotwin rate` writes it, says all of
    that itself; the record's carrier is then the mean, in whose frame the drive stands still. Raises InputError for
    whatever does not fit.
    """
    table = read_lab_table(path)
    try:
        if not columns and CARRIER in table.columns:
            carrier = _own_carrier(table, carrier)
        chosen = _columns(table.columns, columns, carrier)
        voltages = [_voltage(table, path, heading) for heading in chosen]
        rate = _rate(table, path, sample_rate)
        values = voltages[0] if len(voltages) == 1 else voltages[0] + 1j * voltages[1]
        return VoltageRecord(values, rate, carrier or 0.0)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def _columns(headings: Sequence[str], named: Sequence[str], carrier: float | None) -> list[str]:
    for name in named:
        if name not in headings:
            raise InputError(f"--column {name}: no such column{nearest(name, headings)} ({_all(headings)})")
    wanted = 1 if carrier is None else 2
    if named:
        if len(named) != wanted:
            raise InputError(
                f"{len(named)} columns named: give one voltage, or with --carrier two, --column I --column Q"
            )
        if len(set(named)) < len(named):
            raise InputError(f"--column {named[0]} twice: I and Q are two columns")
        return list(named)
    lower = {heading.lower(): heading for heading in headings}
    if wanted == 2:
        for pair in PAIRS:
            if set(pair) <= set(lower):
                return [lower[name] for name in pair]
        raise InputError(f"which columns are I and Q? Give --column I --column Q ({_all(headings)})")
    bare = {name.split("[")[0].split("(")[0].strip(): heading for name, heading in lower.items()}
    guess = next((bare[name] for name in VOLTAGES if name in bare), None)
    others = [heading for name, heading in bare.items() if name not in ("t", "time", "timestamp")]
    if guess is None and len(others) != 1:
        raise InputError(f"which column is the sense voltage? Give --column NAME ({_all(headings)})")
    return [guess or others[0]]


def _voltage(table: pl.DataFrame, path: Path, heading: str) -> Floats:
    """A column in V, by the unit in its heading."""
    [source] = [s for c, s in guess_sources(table.columns, _request(path, v_y=heading)).items() if c == "v_y"]
    return source.factor * numbers(table, heading)


def _own_carrier(table: pl.DataFrame, given: float | None) -> float:
    """The mean of the carrier's column [Hz]. Raises InputError where ``given`` is another."""
    carriers = numbers(table, CARRIER)
    fits = np.isfinite(carriers) & (carriers > 0)
    if not fits.all():
        raise InputError(f"{CARRIER} is no positive number in data row {int(np.argmin(fits)) + 1}: mend the row")
    mean = float(carriers.mean())
    reach = max(float(np.ptp(carriers)), AS_TYPED * mean)
    if given is not None and not abs(given - mean) <= reach:
        raise InputError(
            f"--carrier {given:g}: the column {CARRIER} says {mean:.9g} Hz; leave --carrier out, or name the columns, "
            "--column I --column Q, whose carrier you know"
        )
    return mean


def _rate(table: pl.DataFrame, path: Path, sample_rate: float | None) -> float:
    """Samples a second [Hz]."""
    if sample_rate is not None and not 0 < sample_rate < np.inf:
        raise InputError(f"--sample-rate {sample_rate:g}: give a positive number in Hz")
    source = guess_sources(table.columns, _request(path)).get("t")
    if source is None:
        if sample_rate is None:
            raise InputError(f"no column is the time: give --sample-rate HZ ({_all(table.columns)})")
        return sample_rate
    t = source.factor * numbers(table, source.heading)
    if not np.isfinite(t).all():
        raise InputError(f"the time is no finite number in data row {int(np.argmin(np.isfinite(t))) + 1}")
    if len(t) < 2:
        raise InputError(f"{len(t)} rows: no record")
    check_time(t, sample_rate or measured_rate(t))
    # An even grid through both ends: a hole in the middle puts times off it.
    off = np.abs(t - np.linspace(t[0], t[-1], len(t))) * measured_rate(t)
    step = np.diff(t) * measured_rate(t)
    if off.max() > UNEVEN or step.max() > 1 + UNEVEN:
        row = int(np.argmax(step)) + 1
        raise InputError(
            f"samples are not evenly spaced: after data row {row} ({t[row - 1]:.9g} s) the next comes "
            f"{step[row - 1]:.3g} steps later; cut the record at its holes, or resample it"
        )
    return sample_rate or (len(t) - 1) / float(t[-1] - t[0])


def _request(path: Path, **maps: str) -> Request:
    return Request((path,), path.parent, maps)


def _all(names: Sequence[str]) -> str:
    return "there are " + ", ".join(map(repr, names))
