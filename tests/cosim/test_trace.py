"""The trace of a run: every row is written, whatever the blocks, and memory holds every n-th of a long one."""

from pathlib import Path

import numpy as np
import polars as pl
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cosim import trace
from cosim.trace import Trace


@pytest.fixture
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(trace, "HELD_ROWS", 40)
    monkeypatch.setattr(trace, "PART_ROWS", 7)


@pytest.mark.usefixtures("small")
@given(blocks=st.lists(st.integers(0, 30), min_size=1, max_size=12).filter(any))
def test_all_rows_are_written_and_memory_holds_every_nth(
    blocks: list[int], tmp_path_factory: pytest.TempPathFactory
) -> None:
    rows = sum(blocks)
    grown, first = Trace(rows), 0
    for count in blocks:
        t = np.arange(first, first + count, dtype=float)
        grown.add({"t": t, "odd": t % 2 == 1})
        first += count
    path = tmp_path_factory.mktemp("trace") / "trace.parquet"
    frame = grown.frame()
    grown.write(path)
    written = pl.read_parquet(path)
    assert written["t"].to_list() == list(range(rows))
    assert written["odd"].dtype == pl.Boolean
    assert len(frame) <= 40
    assert frame.equals(written.gather_every(grown.every))


def test_a_run_shorter_than_planned_keeps_what_there_is(small: None, tmp_path: Path) -> None:
    grown = Trace(1000)
    grown.add({"t": np.arange(10.0)})
    grown.write(tmp_path / "trace.parquet")
    assert pl.read_parquet(tmp_path / "trace.parquet")["t"].to_list() == list(range(10))
