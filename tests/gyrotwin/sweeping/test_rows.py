"""Rows on disk: one table whatever failed, and failures taken out."""

from pathlib import Path

import polars as pl

from gyrotwin.sweeping import rows
from gyrotwin.sweeping.plan import Point
from gyrotwin.sweeping.work import Done


def add(folder: Path, number: int, a: float, error: str | None = None, **outputs: float | str | None) -> None:
    rows.add(folder, [Done(Point(number, {"a": a}, 1), outputs, error, 0.1)])


def test_files_of_all_kinds_of_points_become_one_table(tmp_path: Path) -> None:
    add(tmp_path, 0, 1, "ValueError: one")
    add(tmp_path, 1, 2, q=1.0, text=None)
    add(tmp_path, 2, 0.5, q=None, text="two")
    add(tmp_path, 3, 3, q=None, text=None)
    whole = rows.read(tmp_path)
    rows.level(tmp_path)
    table = pl.read_parquet(tmp_path / "rows").sort("point")
    assert table.equals(whole)
    assert dict(table.schema) == {
        "point": pl.Int64, "seed": pl.Int64, "a": pl.Float64, "q": pl.Float64, "text": pl.String, "error": pl.String,
    }  # fmt: skip
    assert table["error"].to_list() == ["ValueError: one", None, None, None]
    assert table["text"].to_list() == [None, None, "two", None]


def test_files_that_agree_are_left_alone(tmp_path: Path) -> None:
    add(tmp_path, 0, 1.0, q=1.0)
    add(tmp_path, 1, 2.0, q=None)
    before = {path: path.stat().st_ino for path in (tmp_path / "rows").iterdir()}
    rows.level(tmp_path)
    assert {path: path.stat().st_ino for path in (tmp_path / "rows").iterdir()} == before


def test_failures_are_taken_out_with_their_times(tmp_path: Path) -> None:
    batch = [Done(Point(n, {"a": n}, 1), {}, "no" if n == 1 else None, 0.1) for n in range(3)]
    rows.add(tmp_path, batch)
    add(tmp_path, 3, 3, "no")
    rows.drop_failed(tmp_path)
    assert rows.read(tmp_path)["point"].to_list() == [0, 2]
    assert rows.read(tmp_path, rows.TIMES)["point"].to_list() == [0, 2]


def test_nothing_is_taken_out_of_an_empty_folder(tmp_path: Path) -> None:
    rows.drop_failed(tmp_path)
    rows.level(tmp_path)
    assert len(rows.read(tmp_path)) == 0
