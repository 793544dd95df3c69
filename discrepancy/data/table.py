"""The table of one run: .csv, .csv.gz or .parquet with columns t, u_x, u_y, v_x, v_y and conditions."""

from difflib import get_close_matches
from pathlib import Path
from typing import Final

import numpy as np
import polars as pl

from discrepancy.data.record import CONDITIONS, Floats
from gyro_model.errors import InputError, nearest
from gyro_model.tables import read_table as read_any

SUFFIXES: Final = (".csv", ".csv.gz", ".parquet")
ONE_AXIS: Final = ("t", "u_x", "v_x")
TWO_AXES: Final = ("t", "u_x", "u_y", "v_x", "v_y")
COLUMNS: Final = (*TWO_AXES, *CONDITIONS)


def read_columns(path: Path) -> tuple[dict[str, Floats], tuple[str, ...]]:
    """The columns of a data set (docs/theory/records.md) in a table, each (n,), SI, NaN where a cell is empty; and the
    names of others.

    Raises InputError for a file that is missing or no table, a column that is missing or nearly right, and text in
    place of a number.
    """
    table = read_table(path)
    if len(table) == 0:
        raise InputError("the table has no rows")
    _check_names(table.columns)
    known = [name for name in COLUMNS if name in table.columns]
    return {name: numbers(table, name) for name in known}, tuple(n for n in table.columns if n not in COLUMNS)


def read_table(path: Path) -> pl.DataFrame:
    """The table in a file, in whatever dialect. Raises InputError where it can't be read."""
    if not path.is_file():
        raise InputError(f"file {path} does not exist: check the path")
    return read_any(path).frame


def numbers(table: pl.DataFrame, name: str) -> Floats:
    """One column as float64 (n,), NaN where a cell is empty. Raises InputError for text."""
    column = table[name]
    if column.dtype.is_nested() or column.dtype in (pl.Object, pl.Binary):
        raise InputError(f"column {name} holds {column.dtype}: give one number a row")
    values = column.cast(pl.Float64, strict=False)
    text = values.is_null() & column.is_not_null()
    if text.any():
        row = int(text.arg_max() or 0)
        raise InputError(f"column {name} is {column[row]!r} in data row {row + 1}: give numbers")
    return np.ascontiguousarray(values.fill_null(np.nan).to_numpy(), dtype=np.float64)


def _check_names(columns: list[str]) -> None:
    if len(set(columns)) < len(columns):
        raise InputError(f"columns {', '.join(columns)}: a name appears twice")
    two = "u_y" in columns or "v_y" in columns
    for name in TWO_AXES if two else ONE_AXIS:
        if name not in columns:
            axes = "two axes" if two else "one axis"
            raise InputError(
                f"column {name} is missing for {axes}{nearest(name, columns)} (columns: {', '.join(columns)})"
            )
    for name in columns:
        meant = _meant(name, [known for known in COLUMNS if known not in columns])
        if name not in COLUMNS and meant:
            raise InputError(f"column {name!r} looks like {meant!r}: rename it, or take it out of the table")


def _meant(name: str, absent: list[str]) -> str:
    """The column of ``absent`` that a heading misspells or shortens, or "": a lab's further columns are no fault."""
    shortened = [known for known in absent if len(name) >= 3 and known.startswith(name.lower())]
    return next(iter([*shortened, *get_close_matches(name.lower(), absent, n=1, cutoff=0.8)]), "")
