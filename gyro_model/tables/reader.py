"""From a file to a table: which kind of file it is, and in which dialect its text is written."""

import gzip
import re
import zlib
from collections.abc import Sequence
from pathlib import Path
from typing import Final

import polars as pl

from gyro_model.errors import InputError
from gyro_model.tables.dialect import Dialect, decoded, dialect_of
from gyro_model.tables.formats import READERS, frame_of
from gyro_model.tables.stamps import in_seconds
from gyro_model.tables.table import Table

TEXT: Final = (".csv", ".csv.gz", ".txt", ".tsv", ".dat", ".asc", ".lvm")
SUFFIXES: Final = (*TEXT, ".parquet", *READERS)
"""What a table's name ends in. Text under another name is read as .csv."""


def read_table(path: Path) -> Table:
    """The table in a file: text in any dialect, .parquet, .npy, .npz, .mat, and with further packages HDF5 and TDMS.

    Stamps of date and time are seconds since the first. Raises InputError where there is no such file, it can't be
    read, or it holds no table.
    """
    try:
        content = path.read_bytes()
        if path.suffix.lower() == ".gz":
            content = gzip.decompress(content)
    except FileNotFoundError:
        raise InputError(f"table {path} does not exist: check the path") from None
    except (OSError, EOFError, zlib.error) as error:
        raise InputError(f"table {path} can't be read: {error}") from None
    suffix = path.suffix.lower()
    try:
        if suffix in READERS:
            frame = frame_of(path, content)
        else:
            frame = pl.read_parquet(content) if suffix == ".parquet" else parsed(content)
    except (pl.exceptions.PolarsError, UnicodeDecodeError) as error:
        # A file that is no text must not speak to the terminal.
        reason = "".join(letter if letter.isprintable() else "?" for letter in str(error).strip().splitlines()[0][:200])
        raise InputError(f"table {path} is no table with a header line: {reason}") from None
    if frame.width == 0:
        raise InputError(f"table {path} has no columns: give a header line and rows")
    return Table(str(path), in_seconds(frame))


def parsed(content: bytes) -> pl.DataFrame:
    """The table in the bytes of a text file."""
    text = decoded(content)
    dialect = dialect_of(text)
    # The type of a column is guessed from all its rows: a first row of integers must not decide.
    if dialect.plain:
        frame = _without_blanks(pl.read_csv(text.encode(), infer_schema_length=None))
        return _named(frame, [name.strip() for name in frame.columns])
    return _unusual(text, dialect)


def _unusual(text: str, dialect: Dialect) -> pl.DataFrame:
    lines = text.splitlines()[dialect.first :]
    if dialect.separator == " ":
        lines = [re.sub(r"\s+", "\t", line.strip()) for line in lines]
    separator = "\t" if dialect.separator == " " else dialect.separator
    body = "\n".join(line for line in lines if line.strip())
    frame = pl.read_csv(body.encode(), infer_schema_length=None, separator=separator, has_header=False,
                        decimal_comma=dialect.decimal == ",")  # fmt: skip
    return _named(_without_blanks(frame), dialect.headings or [""] * frame.width)


def _without_blanks(frame: pl.DataFrame) -> pl.DataFrame:
    """The frame with numbers in place of text that blanks around a cell made of them."""
    frame = frame.with_columns(pl.col(pl.String).str.strip_chars())
    numbers = [name for name in frame.columns if frame[name].dtype == pl.String and _all_numbers(frame[name])]
    return frame.with_columns(pl.col(numbers).cast(pl.Float64, strict=False))


def _named(frame: pl.DataFrame, names: Sequence[str]) -> pl.DataFrame:
    """The frame under ``names``, one a column, empty where a column has none; equal ones are told apart."""
    named = [name or f"column {k}" for k, name in enumerate(names, 1)]
    # Channels that nobody selected bear one name.
    unique = [f"{name} ({named[:k].count(name) + 1})" if name in named[:k] else name for k, name in enumerate(named)]
    return frame.rename(dict(zip(frame.columns, unique, strict=True)))


def _all_numbers(column: pl.Series) -> bool:
    return bool((column.cast(pl.Float64, strict=False).is_not_null() | column.is_null() | (column == "")).all())
