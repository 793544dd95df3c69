"""`gyrotwin split` as a user types it: a record in, numbers with intervals and a report out, or one line."""

import html.parser
import json
from pathlib import Path

import numpy as np
import polars as pl
import pytest

import gyrotwin as gt
from benchmarks.split_records import SenseAxis, make_envelope, make_record
from gyrotwin.cli import main

AXIS = SenseAxis(q=500.0, f_y=3030.0)
RATE = 8000.0
RECORD = make_record(AXIS, 8.0, 1, RATE)
T = np.arange(len(RECORD.values)) / RATE


def table(path: Path, **columns: object) -> Path:
    frame = pl.DataFrame(columns)
    if path.suffix == ".parquet":
        frame.write_parquet(path)
    else:
        frame.write_csv(path)
    return path


def split(*arguments: object) -> None:
    with pytest.raises(SystemExit) as end:
        main(["split", *map(str, arguments)])
    assert end.value.code in (0, None)


def refused(capsys: pytest.CaptureFixture[str], folder: Path, *arguments: object) -> str:
    """The one line on stderr; nothing written."""
    with pytest.raises(SystemExit) as end:
        main(["split", *map(str, arguments), "--out", str(folder / "out")])
    assert end.value.code == 2
    lines = capsys.readouterr().err.strip().splitlines()
    assert len(lines) == 1
    assert not (folder / "out").exists()
    return lines[0]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("split")
    table(path / "record.parquet", t=T, v=RECORD.values)
    split(path / "record.parquet", "--out", path / "out")
    return path


def test_the_answer_has_an_interval_that_holds_the_truth(folder: Path) -> None:
    summary = json.loads((folder / "out" / "summary.json").read_text())
    # A seed inside its 95 %; the deviation is at most a quarter over the bound (prices of taper, floor and Q).
    assert summary["split"]["low"] < 30.0 < summary["split"]["high"]
    assert summary["split"]["low"] < summary["split"]["value"] < summary["split"]["high"]
    assert 1.0 <= summary["deviation"] / summary["bound"] < 1.25
    assert summary["q"]["low"] < 500 < summary["q"]["high"]
    assert summary["f_x"] == pytest.approx(3000.0, abs=1e-3)


def test_a_hump_that_was_not_held_against_kt_is_said_everywhere(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text, image = json.loads((folder / "out" / "summary.json").read_text())["warnings"]
    assert "not checked against kT" in text
    assert "it would be the image" in image
    assert f"Warning: {text}" in (folder / "out" / "report.html").read_text(encoding="utf-8")
    capsys.readouterr()
    split(folder / "record.parquet", "--track", "2", "--q", "500", "--out", tmp_path / "track")
    assert f"warning: {text}" in capsys.readouterr().out
    assert f"Warning: {text}" in (tmp_path / "track" / "report.html").read_text(encoding="utf-8")
    assert image in json.loads((tmp_path / "track" / "summary.json").read_text())["warnings"]
    assert ("warning", text) in gt.split(folder / "record.parquet").headline()


def test_numbers_of_the_correlation_have_intervals_too(folder: Path) -> None:
    found = json.loads((folder / "out" / "summary.json").read_text())["cross_correlation"]
    # 300 °/s of line: its flank is higher than the hump.
    assert found["as_printed"] is None
    assert found["line_removed"]["low"] < 3030 < found["line_removed"]["high"]


class Page(html.parser.HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.ids: list[str] = []
        self.headings: list[str] = []
        self.links: list[str] = []
        self.inside = False

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = dict(attrs)
        self.ids += [given["id"] or ""] if "id" in given else []
        self.links += [given[key] or "" for key in ("src", "href") if key in given]
        self.inside = tag in ("h1", "h2")

    def handle_data(self, data: str) -> None:
        if self.inside:
            self.headings.append(data)
        self.inside = False


def test_report_shows_spectra_correlation_and_fit_without_a_network(folder: Path) -> None:
    text = (folder / "out" / "report.html").read_text(encoding="utf-8")
    page = Page()
    page.feed(text)
    assert {"spectra", "fit", "correlation", "data"} <= set(page.ids)
    assert page.headings[0] == "Split from noise: record.parquet"
    assert page.links == []
    data = json.loads(text.split('id="data">')[1].split("</script>")[0])
    [spectra] = data["spectra"]
    assert [line["name"] for line in spectra["lines"]] == ["M, measured", "N at f_x", "M, model"]
    assert len(data["fit"]) == len(data["correlation"]) == 2


def test_units_are_read_from_the_headings(tmp_path: Path, folder: Path) -> None:
    path = tmp_path / "lab.csv"
    table(path, **{"Time (ms)": 1e3 * T, "sense [mV]": 1e3 * RECORD.values, "remark": ["x"] * len(T)})
    split(path, "--column", "sense [mV]", "--out", tmp_path / "out")
    here, there = (json.loads((f / "out" / "summary.json").read_text()) for f in (tmp_path, folder))
    # Cells are written with all digits; times in ms round the rate in its last ones.
    assert here["split"]["value"] == pytest.approx(there["split"]["value"], abs=1e-6)


def test_envelopes_are_read_as_two_columns(tmp_path: Path) -> None:
    axis = SenseAxis(q=5000.0, f_y=3003.0)
    record = make_envelope(axis, 150 / axis.decay, 3)
    z = record.values
    path = table(tmp_path / "iq.parquet", v_y_i=z.real, v_y_q=z.imag)
    split(path, "--carrier", 3000, "--sample-rate", record.rate, "--q", 5000, "--out", tmp_path / "out")
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert summary["split"]["low"] < 3.0 < summary["split"]["high"]


def test_no_hump_is_said_in_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    cold = make_record(AXIS, 8.0, 2, RATE, hot=False)
    said = refused(capsys, tmp_path, table(tmp_path / "cold.parquet", t=T, v=cold.values))
    assert "no thermal hump found from" in said
    assert "dB over the floor" in said


@pytest.mark.parametrize(
    ("columns", "options", "message"),
    [
        ({"t": T, "v": RECORD.values}, ["--q", 50000], "record at least 133 s"),
        ({"t": T, "v": RECORD.values}, ["--resolution", 0.01], "record at least"),
        ({"t": T, "v": RECORD.values}, ["--column", "w"], "--column w: no such column"),
        ({"t": T, "a [V]": T, "a [mV]": T}, ["--column", "a"], "--column a: several such columns"),
        ({"t": T, "I [V]": T, "Q [V]": T}, [], "around which carrier? Give --carrier HZ"),
        ({"t": T, "v": RECORD.values}, ["--sample-rate", 9000], "t steps at 8000 Hz"),
        ({"t": T, "a": T, "b": T}, [], "which column is the sense voltage"),
        ({"v": RECORD.values}, [], "no column is the time"),
        ({"t": np.delete(np.append(T, T[-1] + 1 / RATE), 900), "v": RECORD.values}, [], "not evenly spaced"),
        ({"t": T, "v": np.where(np.arange(len(T)) == 7, np.nan, RECORD.values)}, [], "no finite number in data row 8"),
        ({"t": T, "v": np.ones(len(T))}, [], "never changes"),
        ({"t": T, "v": RECORD.values}, ["--carrier", 3000], "which columns are I and Q"),
        (
            {"t": T, "v_y_i": T, "v_y_q": T, "carrier_frequency": 3e3 + T},
            ["--carrier", 4e3],
            "--carrier 4000: the column",
        ),
        ({"t": T, "v": RECORD.values}, ["--column", "t", "--column", "v"], "2 columns named"),
        ({"t": T[:100], "v": RECORD.values[:100]}, [], "at least 256"),
        ({"t": T, "v": RECORD.values}, ["--drive-frequency", 5000], "folded to 3000 Hz"),
        ({"t": T, "v": ["a"] * len(T)}, [], "give numbers"),
    ],
)
def test_bad_input_is_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], columns: dict[str, object], options: list[object], message: str
) -> None:
    assert message in refused(capsys, tmp_path, table(tmp_path / "r.parquet", **columns), *options)


def test_missing_file_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert "does not exist" in refused(capsys, tmp_path, tmp_path / "none.csv")


def test_i_and_q_are_named_with_their_unit_or_without(tmp_path: Path) -> None:
    z = make_envelope(SenseAxis(f_x=3000.0, f_y=3003.0, q=5000.0), 60.0, 1)
    columns = {"t": np.arange(len(z.values)) / z.rate, "Q [mV]": 1e3 * z.values.imag, "I [V]": z.values.real}
    path = table(tmp_path / "r.parquet", **columns)
    for k, named in enumerate([[], ["--column", "I", "--column", "Q"]]):
        split(path, "--carrier", 3000, *named, "--out", tmp_path / f"out{k}")
        summary = json.loads((tmp_path / f"out{k}" / "summary.json").read_text())
        assert summary["split"]["value"] == pytest.approx(3.0, abs=0.1)


def test_one_column_is_not_i_and_q(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = table(tmp_path / "pair.csv", t=T[:2000], i=RECORD.values[:2000], q=RECORD.values[:2000])
    told = refused(capsys, tmp_path, path, "--carrier", 3000, "--column", "i", "--column", "i")
    assert "--column i twice: I and Q are two columns" in told
