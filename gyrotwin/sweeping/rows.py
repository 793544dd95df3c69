"""The rows of a sweep on disk: a folder of Parquet files, one a batch, to which an interrupted sweep adds the rest."""

import os
import uuid
from collections.abc import Sequence
from pathlib import Path
from typing import Final

import polars as pl

from gyrotwin.sweeping.work import Done

ROWS: Final = "rows"
TIMES: Final = "rows-times"
"""Seconds apart from the rows, which are the same in every repetition."""


def add(folder: Path, done: Sequence[Done]) -> None:
    """Adds finished points, each file whole or not at all."""
    rows = [{"point": d.point.number, "seed": d.point.seed, **d.point.values, **d.outputs, "error": d.error}
            for d in done]  # fmt: skip
    _write(pl.DataFrame(rows, infer_schema_length=None), folder / ROWS)
    times = [{"point": d.point.number, "seconds": d.seconds} for d in done]
    _write(pl.DataFrame(times), folder / TIMES)


def _write(table: pl.DataFrame, folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    name = f"part-{int(table['point'][0]):07d}-{uuid.uuid4().hex[:8]}.parquet"
    beside = folder / f".{name}.part"
    table.write_parquet(beside)
    os.replace(beside, folder / name)


def read(folder: Path, kind: str = ROWS) -> pl.DataFrame:
    """All rows there are, by point; of one that was finished twice the first."""
    parts = [pl.read_parquet(path) for path in sorted((folder / kind).glob("part-*.parquet"))]
    if not parts:
        return pl.DataFrame({"point": pl.Series([], dtype=pl.Int64)})
    table = pl.concat(parts, how="diagonal_relaxed").sort("point", maintain_order=True)
    table = table.unique("point", keep="first", maintain_order=True)
    if "error" in table.columns:
        table = table.with_columns(pl.col("error").cast(pl.String))
        table = table.select(*(name for name in table.columns if name != "error"), "error")
    return table
