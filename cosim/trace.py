"""The trace of a run as it grows: in memory while it is short, else in files of a temporary folder."""

import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np
import polars as pl
from numpy.typing import NDArray

HELD_ROWS: Final = 240_000
"""Rows in memory, of some 35 columns: 70 MB; summary and figures are made from them."""
PART_ROWS: Final = 20_000
"""Rows of a part, which is a row group of the file: small groups keep the memory of its writer small."""


class Trace:
    """Takes ``rows`` rows, known beforehand, block by block. Memory holds all of them up to HELD_ROWS, else every n-th;
    ``write`` gives all."""

    def __init__(self, rows: int) -> None:
        self.every = max(-(-rows // HELD_ROWS), 1)
        self._held: list[pl.DataFrame] = []
        self._part: dict[str, NDArray[Any]] = {}
        self._filled = self._written = 0
        self._folder: tempfile.TemporaryDirectory[str] | None = None

    def add(self, block: Mapping[str, NDArray[Any]]) -> None:
        """Takes columns of equal length, the same names in each call."""
        rows = len(next(iter(block.values())))
        if not self._part:
            self._part = {name: np.empty(PART_ROWS, values.dtype) for name, values in block.items()}
        taken = 0
        while taken < rows:
            count = min(rows - taken, PART_ROWS - self._filled)
            for name, values in block.items():
                self._part[name][self._filled : self._filled + count] = values[taken : taken + count]
            self._filled += count
            taken += count
            if self._filled == PART_ROWS:
                self._end_part()

    def frame(self) -> pl.DataFrame:
        """The rows in memory."""
        self._end_part()
        return pl.concat(self._held)

    def write(self, path: Path) -> None:
        """Writes all rows as Parquet."""
        self._end_part()
        if self._folder is None:
            pl.concat(self._held).write_parquet(path, row_group_size=PART_ROWS)
        else:
            parts = [self._part_file(number) for number in range(-(-self._written // PART_ROWS))]
            pl.scan_parquet(parts).sink_parquet(path, row_group_size=PART_ROWS)

    def _end_part(self) -> None:
        if not self._filled:
            return
        part = pl.DataFrame({name: values[: self._filled].copy() for name, values in self._part.items()})
        if self.every > 1:
            part.write_parquet(self._part_file(self._written // PART_ROWS))
        self._held.append(part.gather_every(self.every, -self._written % self.every))
        self._written += self._filled
        self._filled = 0

    def _part_file(self, number: int) -> Path:
        if self._folder is None:
            self._folder = tempfile.TemporaryDirectory(prefix="gyrotwin-trace-")
        return Path(self._folder.name) / f"{number:06d}.parquet"
