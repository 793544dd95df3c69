"""Columns that say date and time, as data loggers write them, as seconds since the first row."""

import re
from typing import Final

import polars as pl

STAMP: Final = re.compile(r"\d{1,4}([-/.])\d{1,2}\1\d{1,4}[T ]\s*\d{1,2}:\d\d|\d{1,2}:\d\d:\d\d")
"""How a stamp begins."""
DATES: Final = ("%Y-%m-%d", "%Y/%m/%d", "%d.%m.%Y", "%d/%m/%Y", "%m/%d/%Y", "%d-%m-%Y", "")
"""Day before month where a record tells neither: within a day they are as many seconds apart."""
ZONE: Final = r"(Z|[+-]\d\d:?\d\d)$"


def in_seconds(frame: pl.DataFrame) -> pl.DataFrame:
    """``frame`` with columns of seconds in place of those that say date and time in every cell that is not empty."""
    return frame.with_columns([found for name in frame.columns if (found := _seconds(frame[name])) is not None])


def _seconds(column: pl.Series) -> pl.Series | None:
    if column.dtype == pl.String:
        return _of_text(column)
    if column.dtype == pl.Time:
        return _since_first(column.cast(pl.Int64))
    if isinstance(column.dtype, pl.Datetime | pl.Duration):
        own = column.dtype.time_unit or "us"
        return _since_first(column.to_physical() * {"ms": 1_000_000, "us": 1_000, "ns": 1}[own])
    return None


def _of_text(column: pl.Series) -> pl.Series | None:
    filled = column.filter(column.is_not_null() & (column != ""))
    if filled.is_empty() or not STAMP.match(filled[0]):
        return None
    text = column.str.replace_all(",", ".", literal=True).str.replace(ZONE, "").str.replace("T", " ", literal=True)
    for date in DATES:
        # A time of day is one of any day.
        own, form = (text, date) if date else ("2000-01-01 " + text, "%Y-%m-%d")
        found = own.str.to_datetime(f"{form} %H:%M:%S%.f", time_unit="ns", strict=False)
        if found.count() == len(filled):
            return _since_first(found.to_physical()).alias(column.name)
    return None


def _since_first(nanoseconds: pl.Series) -> pl.Series:
    return (nanoseconds - nanoseconds.drop_nulls().first()) * 1e-9
