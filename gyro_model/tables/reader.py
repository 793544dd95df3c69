"""From a file to a table: which kind of file it is, and in which dialect its text is written."""

import gzip
import zlib
from pathlib import Path
from typing import Final, NamedTuple

import polars as pl

from gyro_model.errors import InputError
from gyro_model.tables.table import Table

SUFFIXES: Final = (".csv", ".csv.gz", ".parquet")
"""What a table's name ends in. Text under another name is read as .csv."""


class Dialect(NamedTuple):
    """How a text table is written. separator: between cells; skip: lines above the header line."""

    separator: str = ","
    skip: int = 0


def read_table(path: Path) -> Table:
    """The table in a .csv, .csv.gz or .parquet file; text has a header line.

    Raises InputError where there is no such file, it can't be read, or it holds no table.
    """
    try:
        content = path.read_bytes()
        if path.suffix.lower() == ".gz":
            content = gzip.decompress(content)
    except FileNotFoundError:
        raise InputError(f"table {path} does not exist: check the path") from None
    except (OSError, EOFError, zlib.error) as error:
        raise InputError(f"table {path} can't be read: {error}") from None
    try:
        frame = pl.read_parquet(content) if path.suffix.lower() == ".parquet" else _parsed(content)
    except (pl.exceptions.PolarsError, UnicodeDecodeError) as error:
        reason = str(error).strip().splitlines()[0]
        raise InputError(f"table {path} is no table with a header line: {reason}") from None
    if frame.width == 0:
        raise InputError(f"table {path} has no columns: give a header line and rows")
    return Table(str(path), frame)


def _parsed(content: bytes) -> pl.DataFrame:
    dialect = _dialect(content)
    # The type of a column is guessed from all its rows: a first row of integers must not decide.
    return pl.read_csv(content, infer_schema_length=None, separator=dialect.separator, skip_rows=dialect.skip)


def _dialect(content: bytes) -> Dialect:
    """The one place that decides how a text table is written; so far all are comma-separated."""
    return Dialect()
