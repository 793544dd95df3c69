"""The rows of a sweep on disk: a folder of Parquet files, one a batch, to which an interrupted sweep adds the rest."""

import uuid
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final

import polars as pl

from gyro_model.whole_file import whole_file
from gyrotwin.sweeping.work import Done

ROWS: Final = "rows"
TIMES: Final = "rows-times"
"""Seconds apart from the rows, which are the same in every repetition."""


def add(folder: Path, done: Sequence[Done]) -> None:
    """Adds finished points, each file whole or not at all."""
    rows = [{"point": d.point.number, "seed": d.point.seed, **d.point.values, **d.outputs, "error": d.error}
            for d in done]  # fmt: skip
    _write(_typed(pl.DataFrame(rows, infer_schema_length=None)), folder / ROWS)
    times = [{"point": d.point.number, "seconds": d.seconds} for d in done]
    _write(pl.DataFrame(times), folder / TIMES)


def _write(table: pl.DataFrame, folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    _replace(table, folder / f"part-{int(table['point'][0]):07d}-{uuid.uuid4().hex[:8]}.parquet")


def _replace(table: pl.DataFrame, path: Path) -> None:
    with whole_file(path) as file:
        table.write_parquet(file)


def _typed(table: pl.DataFrame) -> pl.DataFrame:
    """A column that says nothing in any row has a type all the same: errors are text, outputs are numbers."""
    types = {name: pl.String if name == "error" else pl.Float64 for name, kind in table.schema.items()
             if kind == pl.Null}  # fmt: skip
    return table.cast(types)  # type: ignore[arg-type]


def _parts(folder: Path, kind: str) -> Iterator[tuple[Path, pl.DataFrame]]:
    for path in sorted((folder / kind).glob("part-*.parquet")):
        yield path, pl.read_parquet(path)


def level(folder: Path) -> None:
    """Gives all files of rows the same columns of the same types, so that any program reads them as one table.

    Only when all points are done is it known which outputs there are, and of which type.
    """
    whole = read(folder).head(0)
    for path, table in _parts(folder, ROWS):
        if list(table.schema.items()) != list(whole.schema.items()):
            _replace(pl.concat([whole, _typed(table)], how="diagonal_relaxed"), path)


def drop_failed(folder: Path) -> None:
    """Takes out the points that failed, as if they had never been tried."""
    table = read(folder)
    if "error" not in table.columns:
        return
    failed = table.filter(pl.col("error").is_not_null())["point"].to_list()
    for kind in (ROWS, TIMES):
        for path, part in _parts(folder, kind):
            kept = part.filter(~pl.col("point").is_in(failed))
            if kept.is_empty():
                path.unlink()
            elif len(kept) < len(part):
                _replace(kept, path)


def read(folder: Path, kind: str = ROWS) -> pl.DataFrame:
    """All rows there are, by point; of one that was finished twice the first."""
    parts = [_typed(part) for _, part in _parts(folder, kind)]
    if not parts:
        return pl.DataFrame({"point": pl.Series([], dtype=pl.Int64)})
    table = pl.concat(parts, how="diagonal_relaxed").sort("point", maintain_order=True)
    table = table.unique("point", keep="first", maintain_order=True)
    if "error" in table.columns:
        table = table.select(*(name for name in table.columns if name != "error"), "error")
    return table
