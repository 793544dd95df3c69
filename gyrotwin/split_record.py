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
    found = [_heading(headings, name) for name in named]
    wanted = 1 if carrier is None else 2
    if found:
        if len(found) != wanted:
            raise InputError(
                f"{len(found)} columns named: give one voltage, or with --carrier two, --column I --column Q"
            )
        if len(set(found)) < len(found):
            raise InputError(f"--column {named[0]} twice: I and Q are two columns")
        return found
    bare = {_bare(heading).lower(): heading for heading in headings}
    pair = next(([bare[name] for name in pair] for pair in PAIRS if set(pair) <= set(bare)), None)
    if wanted == 2:
        if pair is None:
            raise InputError(f"which columns are I and Q? Give --column HEADING --column HEADING ({_all(headings)})")
        return pair
    guess = next((bare[name] for name in VOLTAGES if name in bare), None)
    others = [heading for name, heading in bare.items() if name not in ("t", "time", "timestamp")]
    if guess is None and pair is not None:
        raise InputError(
            f"{pair[0]!r} and {pair[1]!r} are I and Q: around which carrier? Give --carrier HZ, or the one voltage by "
            "--column NAME"
        )
    if guess is None and len(others) != 1:
        raise InputError(f"which column is the sense voltage? Give --column NAME ({_all(headings)})")
    return [guess or others[0]]


def _heading(headings: Sequence[str], name: str) -> str:
    """The heading that is ``name``, with its unit or without. Raises InputError where none is, or several are."""
    if name in headings:
        return name
    fitting = [heading for heading in headings if _bare(heading) == name]
    if len(fitting) != 1:
        what = "several such columns" if fitting else "no such column"
        raise InputError(f"--column {name}: {what}{nearest(name, headings)} ({_all(headings)})")
    return fitting[0]


def _bare(heading: str) -> str:
    """Without its unit."""
    return heading.split("[")[0].split("(")[0].strip()


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
